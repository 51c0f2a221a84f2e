"""Make every picture and table of the docs again by the program, as `make gallery` does.

gallery.toml says which pictures there are, and docs/gallery.md shows them all. Arguments select the
commands that begin with one of them: `python -m bench.gallery history examples`. The
pictures of other engines need environments of their own, so they are made only where named.
"""

import json
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby, islice
from operator import itemgetter
from pathlib import Path
from shutil import which
from typing import Any

from PIL import Image

from bench.random_runs import measure_detection
from robotball import FaultKind, sample_times
from robotball.engines.mujoco.settings import FIRST_ORDER
from robotball.files.replacing import replacing
from robotball.view.render import Film, frames
from validation.agreement import compare
from validation.comparing import motions_of
from validation.output import write_text
from validation.studies.extremes import LAWS, Outcome

_DOCS = Path(__file__).parents[1] / "docs"
_OUT = Path("out/gallery")
PICTURES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))["picture"]
_ENGINES = next(row["command"] for row in PICTURES if row["shown"] == "engines.png")
_COSTS = (("cost", 1e3, ".3g"), ("relative_cost", 1, ".2g"), ("spread", 1, ".2f"),
          ("python_share", 1, ".0%"))  # fmt: skip
_RANDOM_RUNS = 500
_SCREEN = ("--headless", "--no-sandbox", "--hide-scrollbars", "--window-size=1000,1400",
           "--enable-unsafe-swiftshader", "--virtual-time-budget=4000")  # fmt: skip
_FILMED, _SHOWN = 3.2, 3.0  # s of the README's film, and the time of its picture
# What the studies counted: the numbers that README and docs print are held against it.
NUMBERS = _DOCS / "numbers.json"
_HEAD = """# Gallery

Every kind of picture that the program makes, and the command that makes it. `make gallery` makes
all of them again, in hours; `python -m bench.gallery history examples` those named."""
ENGINES = r"\| engine, preset \| step or rtol \|.*?(?=\n\n)"
_TABLE = r"\| scene \| preset \| step \|.*?(?=\n\n)"
_LAWS = r"\* `rotation`: .*?(?=\n\n)"
OUTCOMES = r"\| of [0-9]+ runs each \|.*?(?=\n\n)"


def _main(*only: str) -> None:
    """Run each command that begins with one of `only`, or all, and put what it makes into docs/."""

    def wanted(line: str, named: bool = False) -> bool:
        return any(map(line.startswith, only)) or not (only or named)

    if wanted("extremes"):
        _run("extremes", "--out", str(_OUT), "--json", str(_OUT / "extremes.json"))
        record = _read(_OUT / "extremes.json")
        outcomes = _outcomes_of(record["summary"])
        _write_numbers("extremes", {**record["totals"], "outcomes": outcomes})
        _replace(_DOCS / "extremes.md", OUTCOMES, outcomes_table(outcomes))
        _replace(_DOCS / "extremes.md", _LAWS, law_list())
    for command, rows in groupby(PICTURES, itemgetter("command")):
        some = [row for row in rows if "made" in row and wanted(command, row.get("named", False))]
        if some and command.endswith(".py"):
            _run_script(command)
        elif some:
            _run(command, "--out", str(_OUT))
        for row in some:
            _put(_OUT / row["made"], _DOCS / row["shown"])
    if wanted("tradeoff fig12"):
        _write_numbers("tradeoff", numbers_of_tradeoff(_read(_OUT / "fig12-mujoco-tradeoff.json")))
    if wanted(_ENGINES, named=True):
        records = [_read(_OUT / f"{scene}-engines.json") for scene in _ENGINES.split()[1:]]
        _replace(_DOCS / "engines.md", ENGINES, engines_table(records))
    if wanted("random"):
        found = measure_detection(_RANDOM_RUNS, 0, lambda *_: None)
        _write_numbers("random", {**found["extreme"], "false_alarms": len(found["false_alarms"])})
    if wanted("film"):
        _write_frame(_DOCS / "fig12.png")
    if wanted("demo"):
        _run("demo", "--out", str(_OUT))
        table = (_OUT / "demo.md").read_text(encoding="utf-8").strip()
        _replace(_DOCS / "settings.md", _TABLE, table)
    write_text(_DOCS / "gallery.md", gallery_page())


def gallery_page() -> str:
    """Return docs/gallery.md: every picture, what it shows, and below it the command."""
    parts = [_HEAD]
    for row in PICTURES:
        parts += [f"## {row['part']}"] if "part" in row else []
        parts += [f"![{row['words']}]({row['shown']})", row["words"]]
        parts += [f"    {shell_command(row['command'])}"]
    return "\n\n".join(parts) + "\n"


def _put(made: Path, shown: Path) -> None:
    """Copy a picture, or a page's first screen, with 256 colours: a third of its size.

    Chosen to cover the whole range, no pixel is off by more than 13 of 255, measured.
    """
    if made.suffix == ".html":
        browser = next(filter(None, map(which, ("chromium-headless-shell", "chromium"))))
        page, made = made.absolute().as_uri(), made.with_suffix(".png")
        subprocess.run([browser, *_SCREEN, f"--screenshot={made}", page], check=True)
    with replacing(shown) as temporary, Image.open(made) as image:
        few = image.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=3)
        few.save(temporary, format="PNG", optimize=True)


def _write_frame(path: Path) -> None:
    """Write the README's picture: one frame of a film of fig12."""
    import mediapy

    found = [compare("fig12", name, sample_times(_FILMED)) for name in ("naive", "balanced")]
    film = Film(ghost=True)
    shown = islice(frames(motions_of(found, "film"), film), round(_SHOWN * film.fps), None)
    with replacing(path) as temporary:
        mediapy.write_image(temporary, next(shown), fmt="png")


def numbers_of_tradeoff(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return how many configurations there are and are sound, and the best of each kind."""
    runs = record["configurations"]
    servos = [run for run in runs if "gain" in (run["options"]["drive"] or ())]
    off_rate = FaultKind.RATE_OFF.value.partition("{")[0]
    rates = [run for run in servos if off_rate in run["trouble"]]
    first = [run for run in runs if run["sound"] and run["options"]["integrator"] in FIRST_ORDER]
    return {
        "configurations": len(runs),
        "no_result": sum(not run["sound"] for run in runs),
        "servos": len(servos),
        "servos_off_their_rates": len(rates),
        "best_servo": min((run["error"] for run in servos if run["sound"]), default=None),
        "best_of_first_order": min((run["error"] for run in first), default=None),
        "times_at_target": float(f"{record['ratio']:.2g}"),
    }


def _outcomes_of(summary: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, int]]:
    """Return how many runs of each integrator had each outcome, over all maps."""
    found: dict[str, Counter[str]] = {}
    for each in summary:
        found.setdefault(each["integrator"], Counter()).update(each["outcomes"])
    return {integrator: dict(counts) for integrator, counts in found.items()}


def outcomes_table(outcomes: Mapping[str, Mapping[str, int]]) -> str:
    """Return the outcomes as a Markdown table: a row for each outcome that some run had."""
    runs = max(sum(counts.values()) for counts in outcomes.values())
    lines = [f"| of {runs} runs each | {' | '.join(outcomes)} |", "|---|" + "---:|" * len(outcomes)]
    for kind in Outcome:
        counts = [each.get(kind.name, 0) for each in outcomes.values()]
        if any(counts):
            words = kind.sentence.partition(":")[0]
            lines.append(f"| {words} | {' | '.join(map(str, counts))} |")
    return "\n".join(lines)


def law_list() -> str:
    """Return the laws of the predicted limits as a Markdown list, with their names."""
    laws = {name: str(law.__doc__).partition("\n")[0] for name, law in LAWS.items()}
    return "\n".join(f"* `{name}`: {words}" for name, words in laws.items())


def engines_table(records: Sequence[Mapping[str, Any]]) -> str:
    """Return every engine's errors as a Markdown table: a row a run, a column of each scene.

    records: of `robotball engines`, a scene each; costs are those of the first. Bold: on a front.
    """
    last = ["CPU [ms]", "relative", "spread", "Python", "by Python", "ours"]
    head = ["engine, preset", "step or rtol", *(each["scene"] for each in records), *last]
    lines = [f"| {' | '.join(head)} |", "|---|" + "---:|" * (len(head) - 3) + "---|---|"]
    found: dict[str, dict[str, Mapping[str, Any]]] = {}
    for record in records:
        for run in record["runs"]:
            found.setdefault(run["title"], {})[record["scene"]] = run
    for title, runs in found.items():
        errors = [_error(runs.get(each["scene"])) for each in records]
        first = runs.get(records[0]["scene"], {})
        costs = [
            "-" if (number := first.get(key)) is None else f"{number * scale:{form}}"
            for key, scale, form in _COSTS
        ]
        by = ", ".join(sorted({run["python"].rpartition(".")[0] for run in runs.values()}))
        ours = next(iter(runs.values()))["ours"] or "-"
        row = [*title.rsplit(", ", 1), *errors, *costs, by, ours]
        lines.append(f"| {' | '.join(row)} |")
    return "\n".join(lines)


def _error(run: Mapping[str, Any] | None) -> str:
    """Return a run's error, bold on the Pareto front."""
    bold = "**" * bool(run and run["on_the_pareto_front"])
    return f"{bold}{run['error']:.1e}{bold}" if run else "-"


def _write_numbers(study: str, numbers: Mapping[str, Any]) -> None:
    """Write a study's numbers into the file of all."""
    known = _read(NUMBERS) if NUMBERS.exists() else {}
    write_text(NUMBERS, json.dumps({**known, study: numbers}, indent=1) + "\n")


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _replace(page: Path, pattern: str, table: str) -> None:
    """Put a table in the place of the one that a pattern finds."""
    text = page.read_text(encoding="utf-8")
    write_text(page, re.sub(pattern, lambda _: table, text, flags=re.DOTALL))


def shell_command(command: str) -> str:
    """Return a command as typed: of robotball, of tests/bench, or a script of examples."""
    if command.endswith(".py"):
        return f"python {command}"
    return f"python -m bench.{command}" if is_script(command) else f"robotball {command}"


def is_script(command: str) -> bool:
    return (Path(__file__).parent / f"{command.split()[0]}.py").is_file()


def _run(command: str, *options: str) -> None:
    print(shell_command(command), flush=True)
    words = f"bench.{command}" if is_script(command) else f"validation {command}"
    if subprocess.run([sys.executable, "-m", *words.split(), *options]).returncode > 1:
        sys.exit(f"{shell_command(command)} failed")


def _run_script(script: str) -> None:
    """Run a script of examples/, which writes its pictures into the folder `out` beside it."""
    print(f"python {script}", flush=True)
    _OUT.mkdir(parents=True, exist_ok=True)
    subprocess.run([sys.executable, _DOCS.parent / script], cwd=_OUT, check=True)


if __name__ == "__main__":
    _main(*sys.argv[1:])
