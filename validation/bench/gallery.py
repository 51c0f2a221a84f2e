"""`make gallery`: every picture and table of the docs, made again by the program.

Each line is a command and the files of its output that the docs show. `--only NAME` makes one.
"""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

from validation.output import write_text

DOCS = Path(__file__).parents[2] / "docs"
OUT = Path("out/gallery")
PICTURES = {
    "ablation fig12": {"fig12-mujoco-ablation.png": "ablation.png"},
    "convergence fig12": {"fig12-mujoco-accurate-convergence.png": "convergence.png"},
    "tradeoff fig12": {"fig12-mujoco-tradeoff.png": "tradeoff.png"},
    "tradeoff fig12 --friction": {"fig12-mujoco-friction.png": "tradeoff-friction.png"},
    "extremes momentum contact duration": {
        f"extremes-{name}.png": f"extremes-{name}.png"
        for name in ("momentum", "contact", "duration")
    },
}
PROOFS = """
## Proofs

By `robotball paper`: what is left of the printed form, and of the corrected one, of which rounding
or a sampling error may leave something.

| place | corrected | measured |
|---|---|---|
"""
TABLE = r"\| scene \| preset \| step \|.*?(?=\n\n)"


def main(only: str = "") -> None:
    """Run each command whose line begins with `only`, and put what it makes into docs/."""
    for command, files in PICTURES.items():
        if command.startswith(only):
            _run(command, "--out", str(OUT))
            for made, shown in files.items():
                shutil.copyfile(OUT / made, DOCS / shown)
    if "paper".startswith(only):
        _run("paper", "--json", str(OUT / "paper.json"))
        write_proofs(OUT / "paper.json")
    if "demo".startswith(only):
        _run("demo", "--out", str(OUT))
        table = (OUT / "demo.md").read_text(encoding="utf-8").strip()
        page = DOCS / "settings.md"
        text = re.sub(TABLE, lambda _: table, page.read_text(encoding="utf-8"), flags=re.DOTALL)
        write_text(page, text)


def write_proofs(findings: Path) -> None:
    """The table of proofs in the page of errata, from the JSON of `robotball paper`."""
    page = DOCS / "errata.md"
    above = page.read_text(encoding="utf-8").partition(PROOFS)[0].rstrip()
    claims = json.loads(findings.read_text(encoding="utf-8"))["claims"]
    rows = [
        " | ".join(
            str(claim[key]).replace("|", "\\|") for key in ("place", "statement", "evidence")
        )
        for claim in claims
        if claim["verdict"] == "holds as corrected"
    ]
    write_text(page, "\n".join([above, PROOFS.rstrip(), *(f"| {row} |" for row in rows)]) + "\n")


def _run(command: str, *options: str) -> None:
    print(f"robotball {command}", flush=True)
    words = [sys.executable, "-m", "validation", *command.split(), *options]
    if subprocess.run(words).returncode > 1:
        sys.exit(f"robotball {command} failed")


if __name__ == "__main__":
    main(*sys.argv[1:])
