"""Make all pictures and tables of the docs again, as `make gallery` does.

gallery.toml lists the pictures and docs/gallery.md shows them. Arguments select commands by their
first words: `python -m bench.gallery history examples`. Pictures of other engines need the engines'
environments, so they are made only if named.
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
from textwrap import wrap
from typing import Any

from PIL import Image

from bench.random_runs import measure_detection
from robotball import FaultKind, sample_times
from robotball.engines.mujoco.settings import FIRST_ORDER
from robotball.files.replacing import replacing
from robotball.view.render import Film, frames
from validation.agreement import compare
from validation.comparing import motions_of, note_of
from validation.output import write_text
from validation.studies.engine_study import python_text
from validation.studies.extremes import LAWS, Outcome

_DOCS = Path(__file__).parents[1] / "docs"
_OUT = Path("out/gallery")
PICTURES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))["picture"]
_ENGINES = next(row["command"] for row in PICTURES if row["shown"] == "engines.png")
# Runs that docs/engines.md leaves out, beside coarser and finer ones of the same preset.
_LEFT_OUT = (
    "balanced, 10 ms", "exact, 50 ms", "best, 1e-09", "ideal, 1e-06", "ideal, 1e-09",
    *(f"{preset}, 4 ms" for preset in ("best", "discrete", "contact")), "RK4, 10 ms",
    "contact, 5 ms", "kept, 20 ms", "best, 10 ms", "3.17.0, naive, 2 ms", "3.17.0, balanced, 1 ms",
)  # fmt: skip
_RANDOM_RUNS = 500
_SCREEN = ("--headless", "--no-sandbox", "--hide-scrollbars", "--window-size=1000,1400",
           "--enable-unsafe-swiftshader", "--virtual-time-budget=4000")  # fmt: skip
_FILMED, _SHOWN = 3.2, 3.0  # s, length of the README's film and the time of its picture
# Results of the studies; tests compare the numbers in README and docs with them.
NUMBERS = _DOCS / "numbers.json"
_HEAD = """# Gallery

The caption of a picture, and the command that makes it, are above the picture. `bench.gallery`
makes all pictures again in hours, or only those whose commands begin with one of its arguments:

    .venv/bin/python -m bench.gallery "dynamics section" examples/paper/fig10"""
_UNBREAKABLE = "\N{NO-BREAK SPACE}"
ENGINES = r"\| engine, preset \| step or rtol \|.*?(?=\n\n)"
_LAWS = r"\* `rotation`: .*?(?=\n\n)"
OUTCOMES = r"\| of [0-9]+ runs each \|.*?(?=\n\n)"


def _main(*only: str) -> None:
    """Run the commands that begin with one of `only`, or all, and put their results into docs/."""

    def wanted(line: str, named: bool = False) -> bool:
        return any(map(line.startswith, only)) or not (only or named)

    if wanted("study extremes"):
        _run("study extremes", "--out", str(_OUT), "--json", str(_OUT / "extremes.json"))
        record = _read(_OUT / "extremes.json")
        outcomes = _outcomes_of(record["summary"])
        _write_numbers("extremes", {**record["totals"], "outcomes": outcomes})
        _replace(_DOCS / "extremes.md", OUTCOMES, outcomes_table(outcomes))
        _replace(_DOCS / "extremes.md", _LAWS, law_list())
    for command, rows in groupby(PICTURES, itemgetter("command")):
        selected = [
            row for row in rows if "made" in row and wanted(command, row.get("named", False))
        ]
        if selected and command.endswith(".py"):
            _run_script(command)
        elif selected:
            _run(command, "--out", str(_OUT))
        for row in selected:
            _put(_OUT / row["made"], _DOCS / row["shown"])
    if wanted("study cost fig12"):
        _write_numbers("cost", numbers_of_cost(_read(_OUT / "fig12-mujoco-cost.json")))
    if wanted(_ENGINES, named=True):
        records = [_read(_OUT / f"{scene}-engines.json") for scene in _ENGINES.split()[1:]]
        _replace(_DOCS / "engines.md", ENGINES, engines_table(records))
    if wanted("random"):
        counts = measure_detection(_RANDOM_RUNS, 0, lambda *_: None)
        _write_numbers("random", {**counts["extreme"], "false_alarms": len(counts["false_alarms"])})
    if wanted("film"):
        _write_frame(_DOCS / "fig12.png")
    write_text(_DOCS / "gallery.md", gallery_page())


def gallery_page() -> str:
    """Return docs/gallery.md: the pictures of each command, with their captions."""
    lines = [_HEAD]
    for command, rows in groupby(PICTURES, itemgetter("command")):
        first, *others = rows
        if "part" in first:
            lines += ["", f"## {first['part']}", ""]
        code = f"`{shell_command(command)}`".replace(" ", _UNBREAKABLE)
        text = f"* {first['words']} {code} ![]({first['shown']})"
        text += "".join(f" {row['words']} ![]({row['shown']})" for row in others)
        lines += wrap(text, 120, subsequent_indent="  ", break_on_hyphens=False)
    return "\n".join(lines).replace(_UNBREAKABLE, " ") + "\n"


def _put(made: Path, shown: Path) -> None:
    """Copy a picture, or a page's first screen, with 256 colours: a third of the size.

    No pixel's colour is off by more than 13 of 255 (measured).
    """
    if made.suffix == ".html":
        browser = next(filter(None, map(which, ("chromium-headless-shell", "chromium"))))
        page, made = made.absolute().as_uri(), made.with_suffix(".png")
        subprocess.run([browser, *_SCREEN, f"--screenshot={made}", page], check=True)
    with replacing(shown) as temporary, Image.open(made) as image:
        few = image.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=3)
        few.save(temporary, format="PNG", optimize=True)


def _write_frame(path: Path) -> None:
    comparisons = [
        compare("fig12", sample_times(_FILMED), settings=name) for name in ("naive", "balanced")
    ]
    film = Film(ghost=True, note=note_of(comparisons))
    later = islice(frames(motions_of(comparisons, "film"), film), round(_SHOWN * film.fps), None)
    with replacing(path) as temporary:
        Image.fromarray(next(later)).save(temporary, format="PNG")


def numbers_of_cost(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of configurations and of sound ones, and the best error of each kind."""
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
    counters: dict[str, Counter[str]] = {}
    for part in summary:
        counters.setdefault(part["integrator"], Counter()).update(part["outcomes"])
    return {integrator: dict(counts) for integrator, counts in counters.items()}


def outcomes_table(outcomes: Mapping[str, Mapping[str, int]]) -> str:
    """Return the outcomes as a Markdown table, a row per outcome that occurred."""
    runs = max(sum(counts.values()) for counts in outcomes.values())
    lines = [f"| of {runs} runs each | {' | '.join(outcomes)} |", "|---|" + "---:|" * len(outcomes)]
    for kind in Outcome:
        counts = [by_kind.get(kind.name, 0) for by_kind in outcomes.values()]
        if any(counts):
            label = kind.sentence.partition(":")[0]
            lines.append(f"| {label} | {' | '.join(map(str, counts))} |")
    return "\n".join(lines)


def law_list() -> str:
    laws = {name: str(law.__doc__).partition("\n")[0] for name, law in LAWS.items()}
    return "\n".join(f"* `{name}`: {summary}" for name, summary in laws.items())


def engines_table(records: Sequence[Mapping[str, Any]]) -> str:
    """Return the errors of all engines as a Markdown table, a row per run and a column per scene.

    records: from `robotball engines`, one per scene; costs are from the first. Bold marks runs on
    a Pareto front. An engine's name links to its script in docs/rolling.
    """
    last = ["relative time", "Python", "added by robotball"]
    head = ["engine, preset", "step or rtol", *(record["scene"] for record in records), *last]
    lines = [f"| {' | '.join(head)} |", "|---|" + "---:|" * (len(head) - 3) + "---|---|"]
    runs_by_title: dict[str, dict[str, Mapping[str, Any]]] = {}
    for record in records:
        for run in record["runs"]:
            if not run["title"].endswith(_LEFT_OUT):
                runs_by_title.setdefault(run["title"], {})[record["scene"]] = run
    for title, runs in runs_by_title.items():
        errors = [_error(runs.get(record["scene"])) for record in records]
        first, some = runs.get(records[0]["scene"], {}), next(iter(runs.values()))
        cost = first.get("relative_cost")
        engine, step = title.rsplit(", ", 1)
        row = [_linked(engine, some["contestant"]), step, *errors]
        row += ["-" if cost is None else f"{cost:.2g}", python_text(first), some["ours"] or "-"]
        lines.append(f"| {' | '.join(row)} |")
    return "\n".join(lines)


def _linked(text: str, contestant: str) -> str:
    """Return the text with a link to the engine's script, if it has one."""
    for script in _DOCS.glob("rolling/*_rolls.py"):
        name = script.stem.removesuffix("_rolls")
        if contestant.endswith(name) or name.endswith(contestant):
            return f"[{text}](rolling/{script.name})"
    return text


def _error(run: Mapping[str, Any] | None) -> str:
    bold = "**" * bool(run and run["on_the_pareto_front"])
    return f"{bold}{run['error']:.1e}{bold}" if run else "-"


def _write_numbers(study: str, numbers: Mapping[str, Any]) -> None:
    known = _read(NUMBERS) if NUMBERS.exists() else {}
    write_text(NUMBERS, json.dumps({**known, study: numbers}, indent=1) + "\n")


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _replace(page: Path, pattern: str, table: str) -> None:
    text = page.read_text(encoding="utf-8")
    write_text(page, re.sub(pattern, lambda _: table, text, flags=re.DOTALL))


def shell_command(command: str) -> str:
    """Return a command as typed: of robotball, of bench, or a script in examples."""
    if command.endswith(".py"):
        return f"python {command}"
    return f"python -m bench.{command}" if is_script(command) else f"robotball {command}"


def is_script(command: str) -> bool:
    return (Path(__file__).parent / f"{command.split()[0]}.py").is_file()


def _run(command: str, *options: str) -> None:
    print(shell_command(command), flush=True)
    module = f"bench.{command}" if is_script(command) else f"validation {command}"
    if subprocess.run([sys.executable, "-m", *module.split(), *options]).returncode > 1:
        sys.exit(f"{shell_command(command)} failed")


def _run_script(script: str) -> None:
    """Run a script in examples/, which writes its pictures into the current folder."""
    print(f"python {script}", flush=True)
    _OUT.mkdir(parents=True, exist_ok=True)
    subprocess.run([sys.executable, _DOCS.parent / script], cwd=_OUT, check=True)


if __name__ == "__main__":
    _main(*sys.argv[1:])
