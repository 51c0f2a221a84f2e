"""Measure one engine in all its released versions, to find what changed and when.

`python -m bench.history mujoco --from 3.5` prints a table and writes it, with a picture, to
out/history-mujoco.md and .png; `--help` lists the options. Results are kept in
out/mujoco-history.jsonl, so an interrupted run continues.

Each version has its own environment, with our Python or the newest Python here that has a wheel for
it. MuJoCo versions step the exported MJCF with plain calls (`bare_steps`), so that only the version
differs; other engines run with the current adapter, which an old version may not support. A
version's date is the date of the newest file in its wheel.
"""

import argparse
import platform
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import groupby, pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import ZipFile

import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape

from bench import bare_steps
from robotball import InputError, engine_named, integrate, load_scene, sample_times
from robotball.engines import environments
from robotball.engines.engine import DEFAULT
from robotball.engines.environments import ENVIRONMENTS, call, interpreter_of, make
from robotball.engines.states import motions_of
from robotball.errors import unknown
from robotball.motion import Label
from robotball.robot.looks import INK
from validation.agreement import Agreement
from validation.output import (
    known,
    panels,
    progress_bar,
    writable_folder,
    write_picture,
    write_text,
)
from validation.studies import engine_study
from validation.studies.engine_runs import fixed_work
from validation.studies.engine_study import row_of
from validation.study import Column, Row, scene_cell, show, table_of
from validation.sweeps import Cell, Result, rows_of, sweep

_HOME = ENVIRONMENTS.with_name("history")  # the folder of environments
_SCENE = "fig12"  # steady rates and a constant load, so plain MJCF describes all of it
_LIMIT = 900.0  # s per version, with its installation
_ROUNDS = 5  # of timing
_FACTOR, _ROUNDING = 2.0, 1e-12  # smaller changes, and changes of smaller numbers, do not count
_MOMENTS = (0.5, 0.7, 0.3)  # kg m², of the free body in docs/findings/mujoco_implicitfast.py
_FREE_BODY = """<mujoco><option timestep="1e-3" gravity="0 0 0" integrator="implicitfast"/>
<worldbody><body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="{} {} {}"/></body>
</worldbody><keyframe><key qvel="0 0 0 3 1 5"/></keyframe></mujoco>""".format(*_MOMENTS)
# The measured numbers: their labels, and the word that marks changelog entries about them.
_NUMBERS = {"as_it_comes": "default settings", "recipe": "recipe", "free_body": "free body"}
_WORDS = {"as_it_comes": "Euler", "recipe": "RK4", "free_body": "implicitfast"}


def markdown(columns: Sequence[Column], rows: Sequence[Row]) -> list[str]:
    """Return the lines of a Markdown table."""
    cells = [[column.header for column in columns]]
    cells += [["---:"[: 4 - column.words] for column in columns]]
    cells += [[column.text(row).replace("|", "\\|") for column in columns] for row in rows]
    return [f"| {' | '.join(row)} |" for row in cells]


def last_patches(versions: Sequence[str]) -> list[str]:
    """Return the last version of each major and minor number."""
    return [*{tuple(version.split(".")[:2]): version for version in versions}.values()]


def places_of(versions: Sequence[str], name: str) -> list[int]:
    """Return the indices of a version, or of all versions that a name such as 3.10 covers.

    Raises InputError for an unknown name.
    """
    places = [i for i, version in enumerate(versions) if f"{version}.".startswith(f"{name}.")]
    if not places:
        raise unknown("version", name, versions)
    return places


def differ(before: float, after: float) -> bool:
    """Return whether a number changed by a factor or in sign, apart from rounding."""
    small, large = sorted(max(abs(value), _ROUNDING) for value in (before, after))
    return large > _FACTOR * small or (large > _ROUNDING and before * after < 0)


def bisect(row: Callable[[int], Row], number: str, low: int, high: int) -> list[tuple[int, int]]:
    """Return the pairs of adjacent versions between which a number changed, by bisection.

    An interval with the same number at both ends counts as unchanged. Versions without the number
    are skipped, so a pair may enclose some.
    """
    # Bisection, because a version costs an installation and a run, and most change nothing.
    before, after = row(low).get(number), row(high).get(number)
    if before is None or after is None or not differ(before, after):
        return []
    # From the middle outwards, because the middle version may lack the number.
    inner = sorted(range(low + 1, high), key=lambda i: abs(2 * i - low - high))
    middle = next((i for i in inner if row(i).get(number) is not None), None)
    if middle is None:
        return [(low, high)]
    halves = (bisect(row, number, low, middle), bisect(row, number, middle, high))
    return [*halves[0], *halves[1]] or [(low, high)]  # each half changed by less than the factor


def package_of(engine: str) -> str:
    """Return the name of an engine's package, its first requirement."""
    required = (
        (DEFAULT,) if engine == DEFAULT else getattr(engine_named(engine), "requirements", ())
    )
    if not required:
        raise InputError(f"{engine} is part of robotball: it has no released versions")
    return environments.name_of(required[0])


def _pip(folder: Path, failure: str, *arguments: str) -> str:
    """Return the output of pip, which, unlike uv, lists versions and wheels of other Pythons.

    Raises InputError with pip's reason if it fails.
    """
    home = folder / "pip"
    python = interpreter_of(home) or make(home, ["pip"], Path(sys.executable)) / "bin" / "python"
    command = [str(python), "-P", "-m", "pip", "--disable-pip-version-check", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError(f"{failure}: {(done.stderr or done.stdout).strip().splitlines()[-1]}")
    return done.stdout


def releases(listing: str, package: str) -> list[str]:
    """Return the releases with wheels for any Python from pip's listing, oldest first."""
    name = re.sub(r"[-_.]+", "[-_.]+", package)
    pattern = rf"/{name}-(\d+(?:\.\d+|\.post\d+)*)-[^/\s]*\.whl"
    versions = set(re.findall(pattern, listing, re.IGNORECASE))
    return sorted(versions, key=lambda text: [int(number) for number in re.findall(r"\d+", text)])


def _download(folder: Path, engine: str, version: str, fetched: str) -> Path:
    """Download a version's wheel and return a Python that has one: ours, or else the newest."""
    failure, errors = f"{engine}-{version} has no wheel for a Python here", list[str]()
    # Wheels only: a build needs a compiler and may take an hour.
    asked = ("download", "--quiet", "--no-deps", "--only-binary=:all:", "--dest", fetched)
    for python in (Path(sys.executable), *environments.pythons().values()):
        try:
            by = ("--python", str(python), *asked, f"{package_of(engine)}=={version}")
            _pip(folder, failure, *by)
        except InputError as error:
            errors.append(str(error))
        else:
            return python
    raise InputError(errors[0])


def _environment(engine: str, version: str, folder: Path) -> tuple[str, str | None]:
    home = folder / f"{engine}-{version}"
    with TemporaryDirectory() as fetched:
        python = _download(folder, engine, version, fetched)
        (wheel,) = Path(fetched).iterdir()
        if interpreter_of(home) is None:
            make(home, [str(wheel)], python)
        year, month, day, *_ = max(file.date_time for file in ZipFile(wheel).infolist())
    # Some packages date all files 1980, the earliest year in a zip file.
    return str(interpreter_of(home)), f"{year}-{month:02}-{day:02}" if year > 1980 else None


def measure_version(cell: Cell) -> dict[str, Any]:
    """Measure a version, installing it if necessary; ours if the cell names no environments."""
    name, python, date = cell["engine"], sys.executable, None
    engine, ours = engine_named(name), name == DEFAULT
    if folder := cell["environments"]:
        python, date = _environment(name, cell["version"], Path(folder))
    python_version, body = (
        call(python, platform.python_version),
        _free_body(python) if ours else None,
    )
    record: dict[str, Any] = {"date": date, "python": python_version, "free_body": body}
    for number, preset in (("as_it_comes", engine.as_it_comes), ("recipe", engine.default)):
        if preset in engine.presets:
            try:
                result = (_bare if ours else _adapted)(cell, python, preset)
            except InputError as error:  # an old version may still run the other preset
                why = str(error).removeprefix(f"{python}: ")
                # Recorded as a result: a failure of the cell would hide the other number.
                result = {"error": None, "fault": re.sub(r"^\w+Error: ", "", why)}
            record |= {number: result.pop("error"), **{f"{number}_{x}": result[x] for x in result}}
    return record


def _bare(cell: Cell, python: str, preset: str) -> dict[str, Any]:
    """Run a preset's MJCF with a version's plain calls, and judge its states with our code."""
    from robotball.engines.mujoco import LABEL
    from robotball.engines.mujoco.model import build
    from robotball.engines.mujoco.ports import shell_state
    from robotball.engines.mujoco.settings import PRESETS

    scene, times = load_scene(cell["scene"]), sample_times(cell["duration"])
    # The machine's speed before and after, because versions are timed hours apart.
    settings, before = replace(PRESETS[preset], stop_at_fault=False), fixed_work()
    model = build(scene, settings)
    # Sensors do not affect the motion, and old versions lack some.
    xml = re.sub("<sensor>.*</sensor>", "", model.xml, flags=re.DOTALL)
    result = _stepped(python, xml, times[1], len(times))
    seconds, step = result["seconds"], result["timestep"]
    cost = 2 * seconds / (before + fixed_work())
    state = shell_state(model, np.array(result["qpos"]), np.array(result["qvel"]))
    run = {"timestep": step, "steps": round(times[-1] / step), "seconds": seconds}
    (motion,) = motions_of([scene], times, state.row[None], LABEL, settings, **run)
    error = known(Agreement(integrate(scene, times), motion).path_error)
    fault, without = "; ".join(map(str, motion.report.faults[:1])), ", ".join(result["left_out"])
    return {"error": error, "fault": fault, "cost": cost, "without": without}


def _stepped(python: str, xml: str, interval: float, samples: int) -> dict[str, Any]:
    task = {"xml": xml, "interval": interval, "samples": samples, "rounds": _ROUNDS}
    return bare_steps.run(task) if python == sys.executable else call(python, bare_steps.run, task)


def _free_body(python: str) -> float | None:
    """Return the relative change of a free body's |M| in 10 s, or None if the run fails."""
    try:
        # Without contact the angular momentum is constant, so the integrator causes any change.
        omega = [row[3:] for row in _stepped(python, _FREE_BODY, 10.0, 2)["qvel"]]
    except InputError:
        return None
    before, after = np.linalg.norm(np.array(omega) * _MOMENTS, axis=1)
    return float(after / before - 1)


def _adapted(cell: Cell, python: str, preset: str) -> dict[str, Any]:
    engine = engine_named(cell["engine"])
    name = row_of(cell["engine"]).ladders[preset][0]
    run = {**cell, "contestant": "", "preset": preset, "field": name, "interpreter": python}
    value = getattr(engine.presets[preset], name)
    result = engine_study.measure({**run, "value": value, "rounds": _ROUNDS, "stretches": False})
    cost, fault = result["seconds"] / result["fixed_work"], "; ".join(result["faults"][:1])
    return {"error": result["path_error"], "fault": fault, "cost": cost}


def changes_of(rows: Sequence[Row]) -> list[tuple[str, Row, Row]]:
    return [
        (number, before, after)
        for number in _NUMBERS
        for before, after in pairwise(row for row in rows if row.get(number) is not None)
        if differ(before[number], after[number])
    ]


def version_rows(results: Sequence[Result]) -> list[Row]:
    """Return a row per version, with its speed relative to the newest and its changes."""
    rows = rows_of(results)
    newest = next((row["recipe_cost"] for row in rows[::-1] if row.get("recipe_cost")), None)
    changes = changes_of(rows)
    for row in rows:
        row["speed"] = newest / row["recipe_cost"] if row.get("recipe_cost") else None
        fault = row["failure"] or row.get("as_it_comes_fault") or ""
        row["fault"] = re.sub(r"^\w+Error: ", "", fault)
        row["changed"] = ", ".join(_NUMBERS[number] for number, _, after in changes if after is row)
    return [*rows]


def changelog_line(changelog: str, version: str, word: str) -> str:
    """Return the first sentence of a version's first entry with the word, else ""."""
    heading = rf"^Version {re.escape(version)} .*?(?=^Version |\Z)"
    section = re.search(heading, changelog, re.MULTILINE | re.DOTALL)
    entries = re.split(r"^ *\d+\. ", section[0] if section else "", flags=re.MULTILINE)[1:]
    entry = " ".join(next((text for text in entries if word in text), "").split())
    plain = re.sub(r":commit:`\w+` |``", "", entry)
    plain = re.sub(r":[\w-]+:`([^`<]*?)(?: *<[^`]*>)?`", r"\1", plain)
    return re.split(r"(?<=\.) (?=[A-Z])", plain)[0]


def _lines_of(changes: Sequence[tuple[str, Row, Row]], package: str) -> list[str]:
    """Return each change in a line, with the changelog entry from the installed package."""
    changelogs = Path(sys.prefix).glob(f"lib/*/site-packages/{package}/doc/changelog.rst")
    log = "".join(file.read_text(encoding="utf-8") for file in changelogs)
    return [
        f"{_NUMBERS[number]}: {before[number]:.1e} in {before['version']}, {after[number]:.1e} in "
        f"{after['version']}: {changelog_line(log, after['version'], _WORDS[number]) or 'no entry'}"
        for number, before, after in changes
    ]


_NUMBER_COLUMNS = tuple(Column(label, number) for number, label in _NUMBERS.items())
_DATED = (Column("version", "version", words=True), Column("date", "date", words=True))
_COLUMNS = (
    *_DATED,
    Column("Python", "python", words=True),
    *_NUMBER_COLUMNS,
    Column("speed", "speed", form=".2f"),
    Column("recipe without", "recipe_without", words=True),
    Column("changed", "changed", words=True),
    Column("first fault", "fault", words=True),
    Column("recipe: first fault", "recipe_fault", words=True),
)


def spans_of(rows: Sequence[Row]) -> list[Row]:
    """Return a row for each span of versions with the same printed numbers."""
    spans = groupby(rows, lambda row: [column.text(row) for column in _NUMBER_COLUMNS])
    return [
        {
            **first,
            "version": " to ".join([first["version"], *(row["version"] for row in rest[-1:])]),
        }
        for first, *rest in (group for _, group in spans)
    ]


def _history_picture(label: Label, title: str, rows: Sequence[Row]) -> Figure:
    """Draw errors and speed over release dates, or over version numbers if a date is missing."""
    news = [row["version"] for row in rows if row["changed"]]
    heading = f"{title}: numbers changed in {', '.join(news) or 'none'}"
    figure, (axes, below) = panels(heading, (10.0, 6.6), 2, sharex=True, height_ratios=(3, 1))
    dated = all(row["date"] for row in rows)
    at: list[Any] = [np.datetime64(row["date"]) if dated else row["version"] for row in rows]
    # Hollow markers for default settings, like in the pictures of engines.
    mark, colour = label.marker, label.colour
    looks = (f"{mark}:", colour, "none"), (f"{mark}-", colour, colour), ("d--", INK, INK)
    for (number, name), (style, line, face) in zip(_NUMBERS.items(), looks, strict=True):
        sizes = [abs(row.get(number) or np.nan) for row in rows]
        axes.semilogy(at, sizes, style, c=line, mfc=face, drawstyle="steps-post", label=name)
    below.plot(at, [row["speed"] or np.nan for row in rows], ".-", color=INK, clip_on=False)
    inside = axes.get_xaxis_transform()
    for place, row in zip(at, rows, strict=True):
        if row["changed"]:
            axes.text(place, 0.5, f"{row['version']} ", rotation=90, ha="right", transform=inside)
    axes.set(ylabel="path error; |gain| of the free body")
    below.set(xlabel="release", ylabel="speed, newest = 1", ylim=(0, None))
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def cell_of(engine: str, version: str, duration: float, home: Path | None) -> Cell:
    run = {"engine": engine, "version": version, "environments": home and str(home)}
    return {**scene_cell(_SCENE, duration), **run}


def _write_table(engine: str, rows: Sequence[Row], out: Path) -> None:
    label, lines = engine_named(engine).label, _lines_of(changes_of(rows), package_of(engine))
    title = f"{label.name} on {_SCENE}, version after version"
    page = [
        *markdown((*_DATED, *_NUMBER_COLUMNS), spans_of(rows)),
        "",
        *(f"* {line}" for line in lines),
        "",
    ]
    write_text(out / f"history-{engine}.md", "\n".join(page))
    measured = [row for row in rows if not row["failure"]]
    write_picture(out / f"history-{engine}.png", _history_picture(label, title, measured))
    show([title, table_of(_COLUMNS, rows, lambda row: row["failure"]), *map(escape, lines)])


def changes_between(row: Callable[[int], Row], count: int) -> list[tuple[str, Row, Row]]:
    """Return the numbers that changed, as `changes_of` does, measuring few versions."""
    return [
        (number, row(before), row(after))
        for number in _NUMBERS
        for before, after in bisect(row, number, 0, count - 1)
    ]


def chosen(versions: Sequence[str], first: str, last: str, *, every: bool) -> Sequence[str]:
    """Return the versions from `first` to `last`; "" means no limit.

    3.10 as `first` means its first patch, as `last` its last patch.
    """
    start = places_of(versions, first)[0] if first else 0
    end = places_of(versions, last)[-1] if last else len(versions) - 1
    return versions[start : end + 1] if every else last_patches(versions[start : end + 1])


def searched(versions: Sequence[str], first: str, last: str) -> Sequence[str]:
    """Return the versions between the last patches of two, given in either order."""
    start, end = sorted(places_of(versions, name)[-1] for name in (first, last))
    return versions[start : end + 1]


def _main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.history")
    parser.add_argument("engine", help="its name, as `robotball engines` lists it")
    parser.add_argument("--from", dest="first", default="", help="first version; 3.10: any patch")
    parser.add_argument("--to", dest="last", default="", help="last version")
    parser.add_argument("--every", action="store_true", help="all versions, not last patches only")
    parser.add_argument("--bisect", nargs=2, metavar=("A", "B"), help="only find what changed")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of results")
    options = parser.parse_args()
    package, journal = (
        package_of(options.engine),
        options.out / f"{options.engine}-history.jsonl",
    )
    duration = load_scene(_SCENE).duration
    writable_folder(options.out)

    def rows(some: Sequence[str]) -> list[Row]:
        cells = [cell_of(options.engine, version, duration, _HOME) for version in some]
        with progress_bar(len(cells)) as progress:
            return version_rows(sweep(measure_version, cells, journal, limit=_LIMIT, show=progress))

    # pip's verbose output also lists versions that this Python cannot install.
    talk = _pip(_HOME, f"{package} has no list", "index", "versions", "-vv", package)
    versions = releases(talk, package)
    if options.bisect:
        some = searched(versions, *options.bisect)
        changes = changes_between(cache(lambda i: rows([some[i]])[0]), len(some))
        none = f"no number changed between {some[0]} and {some[-1]}"
        show(map(escape, _lines_of(changes, package) or [none]))
    else:
        some = chosen(versions, options.first, options.last, every=options.every)
        _write_table(options.engine, rows(some), options.out)


if __name__ == "__main__":
    _main()
