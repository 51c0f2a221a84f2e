"""All engines on a scene: error against processor time, orders, and the Pareto front."""

import statistics
import sys
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.markup import escape

from robotball import Engine, InputError, Scene, engine_named, engine_names, load_scene
from robotball.engines.engine import DEFAULT
from robotball.engines.environments import call, newer_releases, python_name, said_of, versions_in
from robotball.robot.looks import FAINT, INK

from ..options import AGREES, Sweep, chosen, seconds_of
from ..output import halo, in_picture, writable_folder, write_record
from ..sensitivity import chaotic
from ..study import (
    CANCELLED,
    Column,
    Row,
    Study,
    cost_axes,
    pareto_front,
    scene_cell,
    show,
    table_of,
)
from ..sweeps import Cell, Result, rows_of
from . import engine_runs
from .engine_runs import Contestant, python_of
from .measuring import fit_order

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LIMIT = 300.0  # s, time limit of a run with its compilation
_ROUNDS = 3  # rounds of timing
_SAID = 1e-6  # the title of the picture has the cost at this error
_IDEAL = ":"  # line style of runs in which the engine computes only the dynamics
_LEAST = 1e-15  # relative error; smaller errors are rounding
_SLIP_STEPS = (5e-3, 2e-3, 1e-3)  # s, in scenes whose friction is limited


_Ladder = tuple[str, tuple[float, ...]]
"""A field of an engine's settings and the values to run."""


@dataclass(frozen=True)
class _EngineRow:
    """The runs of an engine in the study.

    Attributes
    ----------
    ladders : mapping of str to Ladder
        For each preset, the field that is varied and its values.
    ours : mapping of str to str
        For each preset, the parts of a run that robotball provides instead of the engine.
    source : str
        The page or example of the engine's documentation that its default preset follows.
    slips : sequence of str
        The presets to run if the friction of the scene is limited.
    """

    ladders: Mapping[str, _Ladder]
    ours: Mapping[str, str] = field(default_factory=dict)
    source: str = ""
    slips: Sequence[str] = ()


def row_of(name: str) -> _EngineRow:
    """Return the row of an engine, by default one run per preset."""
    return _rows().get(name) or _EngineRow(_as_they_are(engine_named(name)))


def _as_they_are(engine: Engine) -> dict[str, _Ladder]:
    """Return a ladder of one value per preset: its timestep, its rtol, or its error tolerance."""
    ladders: dict[str, _Ladder] = {}
    for name, preset in engine.presets.items():
        has = [key for key in ("timestep", "rtol") if isinstance(getattr(preset, key, None), float)]
        key = (*has, "error_tolerance")[0]
        ladders[name] = (key, (getattr(preset, key),))
    return ladders


@cache
def _rows() -> dict[str, _EngineRow]:
    text = Path(__file__).with_name("engine_rows.toml").read_text(encoding="utf-8")
    return {name: _row(**row) for name, row in tomllib.loads(text).items()}


def _row(ladders: Any, **others: Any) -> _EngineRow:
    """Return a row of the TOML file, where ladders are {preset: {field: values}}."""
    pairs = {preset: (key, tuple(row[key])) for preset, row in ladders.items() for key in row}
    return _EngineRow(pairs, **others)


def cells_of(
    scene: str, contestants: Sequence[Contestant], folder: Path, duration: float, rounds: int
) -> list[Cell]:
    """Return a cell for each value of each ladder of each installed engine."""
    loaded = load_scene(scene)
    shared = {**scene_cell(scene, duration), "rounds": rounds, "stretches": chaotic(loaded)}
    cells: list[Cell] = []
    for contestant in contestants:
        if (python := python_of(contestant, folder)) is None:
            continue
        engine = {"contestant": contestant.name, "engine": contestant.engine}
        row = row_of(contestant.engine)
        slips = dict.fromkeys(row.slips, ("timestep", _SLIP_STEPS))
        for preset, (name, values) in (slips if loaded.may_slip else row.ladders).items():
            run = {**shared, **engine, "preset": preset, "field": name}
            cells += [{**run, "value": value, "interpreter": str(python)} for value in values]
    return cells


def measure(cell: Cell) -> dict[str, Any]:
    """Run a cell in a process of its environment. Raises if it ends without a record."""
    return call(cell["interpreter"], engine_runs.run, dict(cell))


def study_of(scene: Scene, results: Sequence[Result]) -> dict[str, Any]:
    """Return the study of a scene's results, as plain data.

    Returns
    -------
    dict
        `errors` describes the errors: path errors, or the total defects of a chaotic scene. `runs`
        has a row for each run with its cell, its record, and these keys: `error`; `cost`, the
        processor time of a simulated second [s] at the median speed of the machine; `python_share`,
        Python's fraction of the cost; `launching`, whether the engine spends more than half of the
        cost in Python to launch its steps; `relative_cost`, relative to the default engine with its
        default settings; `order` of the preset's errors; `newcomer`, whether the preset is the
        engine's default; `ours`, robotball's parts of the run; `usable`, whether the error is
        meaningful; `on_the_pareto_front`. `orders` has the fitted lines, and `failed` the runs
        without a result.
    """
    speed = statistics.median([run.record["fixed_work"] for run in results if run.record] or [1])
    by_defects = any(result.cell["stretches"] for result in results)
    runs: list[dict[str, Any]] = []
    orders, failed = [], []
    for result in results:
        cell, record, failure = result.cell, result.record, result.failure
        place = {name: cell[name] for name in ("contestant", "preset", "field", "value")}
        if record is not None:
            error, faults = record["defect" if by_defects else "path_error"], record["faults"]
            if error is None or record["momentum_error"] is None:
                failure = "; ".join(faults) or f"broke off at {record['reached']:g} s"
        if record is None or failure:
            failed.append({**place, "title": _title(place), "fault": failure})
            continue
        engine, row = engine_named(cell["engine"]), row_of(cell["engine"])
        python, seconds = record["python_seconds"], record["seconds"]
        run = {**record, **place, "error": error, "fault": "".join(faults[:1])}
        run |= {"title": _title(run), "usable": _usable(run)}
        run["newcomer"] = cell["preset"] == engine.as_it_comes
        run["cost"] = seconds / cell["duration"] * speed / record["fixed_work"]
        known = python is not None and seconds
        share = run["python_share"] = min(1.0, python / seconds) if known else None
        run |= {"ours": row.ours.get(cell["preset"], ""), "source": row.source, "order": None}
        run["launching"] = share is not None and share > 0.5 and not run["ours"]
        runs.append(run)
    default = engine_named(DEFAULT)
    field = row_of(DEFAULT).ladders[default.default][0]
    baseline = (DEFAULT, default.default, getattr(default.presets[default.default], field))
    unit = next((run["cost"] for run in runs if (*_key(run), run["value"]) == baseline), None)
    usable = [run for run in runs if run["usable"]]
    front = {*pareto_front(*([run[name] for run in usable] for name in ("error", "cost")))}
    for run in runs:
        run["relative_cost"] = run["cost"] / unit if unit else None
        run["on_the_pareto_front"] = False
    for i, run in enumerate(usable):
        run["on_the_pareto_front"] = i in front
    for (contestant, preset), group in groupby(runs, _key):
        stepped = [run for run in group if run["field"] == "timestep"]
        steps, errors = ([run[name] for run in stepped] for name in ("longest_step", "error"))
        if order := fit_order(steps, errors):
            orders.append({"contestant": contestant, "preset": preset, **asdict(order)})
            for run in stepped:
                run["order"] = order.order
    defects = "chaotic: errors are the sum of defects over short stretches"
    study = {"scene": scene.name, "rolling": scene.rolling}
    study["errors"] = defects if by_defects else "path errors"
    return {**study, "runs": runs, "orders": orders, "failed": failed}


def _key(run: Row) -> tuple[str, str]:
    return run["contestant"], run["preset"]


def _title(run: Row) -> str:
    """Return the engine with its version, the preset, and its step or rtol."""
    engine = f"{run['label']} {run['version']}" if "label" in run else run["contestant"]
    value = run["value"] or 0.0  # a release that cannot be installed has no value
    values = {"timestep": f", {value * 1e3:g} ms", "rtol": f", {value:g}"}
    return f"{engine}, {run['preset']}{values.get(run['field'], '')}"


def _usable(run: Row) -> bool:
    """Return whether the error is meaningful: the run did not diverge, and no errors cancelled."""
    consistent = run["momentum_error"] < CANCELLED * max(run["error"], _LEAST)
    diverged = "diverged" in " ".join(run["faults"])
    return run["error"] < engine_runs.LOOSEST and consistent and not diverged


_NOTE = (
    "N error: of the normal force, over the weight; cone: friction beyond its cone; slip work and "
    "energy: lost to slip, and gained (+) or lost in total, over the kinetic energy. CPU: "
    "processor time of a simulated second, without set-up and readings; relative: to {} with its "
    "default settings; spread: of the rounds; Python: Python's share at the steps, the engine's "
    "own included; launching: the engine spends most of its time in Python. ours: parts of the run "
    "that robotball provides. * on the Pareto front: no run is cheaper and more accurate."
)

_SLIP_NOTE = (
    "late: by how much longer the first slip takes; askew: mean angle of the friction to the "
    "direction against the slip; N max: largest normal force over the right one; hop: largest "
    "height above the plane. * on the Pareto front: no run is cheaper and more accurate."
)


def _engines_study(scene: Scene, results: Sequence[Result], words: Sequence[str]) -> Study:
    """Return the study with all runs and failures; `words` are parts of the file names."""
    study = study_of(scene, results)
    name, errors = f"{scene.name} ({scene.rolling})", study["errors"]
    rows = [*study["runs"], *study["failed"]]
    columns, note = (SLIP_COLUMNS, _SLIP_NOTE) if scene.may_slip else (COLUMNS, _NOTE)
    table = table_of(columns, rows, lambda row: not row.get("usable"))
    heading = f"[bold]{escape(name)}: {errors}[/]"
    shown = (heading, table, note.format(engine_named(DEFAULT).label.name))
    picture = _engines_picture(name, errors, study["runs"])
    return Study(scene.name, None, ["engines", *words], rows_of(results), study, shown, picture)


COLUMNS = (
    Column("", lambda run: "*" * bool(run.get("on_the_pareto_front")), words=True),
    Column("engine, preset, step or rtol", "title", words=True),
    Column("error", "error"), Column("order", "order", form=".2f"),
    Column("M error", "momentum_error"), Column("slip", "slip", "m/s"),
    Column("N error", "normal_force_error"), Column("cone", "cone_violation"),
    Column("slip work", "slip_work"), Column("energy", "energy_error"),
    Column("CPU", "cost", "ms", form=".3g", scale=1e3),
    Column("relative", "relative_cost", form=".3g"), Column("spread", "spread", form=".2f"),
    Column("Python", lambda run: python_text(run)), Column("by Python", "python", words=True),
    Column("ours", "ours", words=True),
    Column("first fault", "fault", words=True),
)  # fmt: skip
SLIP_COLUMNS = (
    *COLUMNS[:4],
    Column("late", "late", "%", form=".2g", scale=100), Column("askew", "askew", "°", form=".2g"),
    Column("N max", "most_force", form=".4g"), Column("hop", "hop", "mm", form=".2g", scale=1e3),
    *COLUMNS[-2:],
)  # fmt: skip


def python_text(run: Row) -> str:
    """Return Python's share of a run's cost, and whether most of the cost is launching steps."""
    share = run.get("python_share")
    return "-" if share is None else f"{share:.0%}" + ", launching" * run["launching"]


def _engines_picture(name: str, errors: str, runs: Sequence[Row]) -> "Figure":
    """Draw engines' costs against their errors, and label each engine at its smallest error.

    Engines that are not on the Pareto front are grey.
    """
    from ..plots import note, separate  # a list of engines needs no picture

    within = [run for run in runs if run["usable"] and run["error"] <= _SAID]
    within.sort(key=itemgetter("cost"), reverse=True)
    costs = {run["label"]: run["cost"] for run in within}  # the lowest cost of each engine
    cheapest = sorted(costs.items(), key=itemgetter(1))[:2]
    times = ", ".join(f"{cost * 1e3:.2g} ms with {label}" for label, cost in cheapest)
    finding = f"costs {times}" if times else "is reached by no engine"
    heading = f"{name}: error {_SAID:g} {finding}"
    figure, axes = cost_axes(heading, f"{errors}, relative to the path's length")
    ahead = {run["contestant"]: run["colour"] for run in runs if run["on_the_pareto_front"]}
    for contestant in dict.fromkeys(run["contestant"] for run in runs):
        own_runs = [run for run in runs if run["contestant"] == contestant]
        engine, version, mark = (own_runs[0][key] for key in ("label", "version", "marker"))
        colour, smallest = ahead.get(contestant, FAINT), list[tuple[float, float]]()
        style: Any = {"color": colour, "linewidth": 1, "zorder": 2 + (contestant in ahead)}
        for _, group in groupby(own_runs, _key):
            line = [*group]
            dashes = _IDEAL if {"all", "constraints"} & {*line[0]["ours"].split(", ")} else "-"
            points = [(min(max(run["error"], _LEAST), 10.0), run["cost"]) for run in line]
            fill = "none" if line[0]["newcomer"] else colour
            axes.plot(*zip(*points, strict=True), mark + dashes, mfc=fill, **style)
            smallest.append(min(points))
        words: Any = {"color": "dimgray" if colour == FAINT else colour, "path_effects": halo()}
        label = in_picture(f"{engine} {version.partition(' on ')[0]}")
        note(axes, label, min(smallest), (0, 7), ha="center", fontsize=9, zorder=5, **words)
    best = [(max(run["error"], _LEAST), run["cost"]) for run in runs if run["on_the_pareto_front"]]
    front = np.reshape(sorted(best), (-1, 2)).T
    axes.plot(*front, color=INK, linewidth=1.8, zorder=1, label="Pareto front")
    axes.plot([], [], "o", color=INK, mfc="none", label="default settings of the engine")
    axes.plot([], [], _IDEAL, color=INK, linewidth=1, label="robotball's rolling constraints")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    axes.margins(x=0.1)
    separate(figure, axes.texts)
    return figure


def run_engines(
    scenes: Sequence[str],
    only: Sequence[str],
    install: Sequence[str],
    python: str,
    environments: Path,
    newest: bool,
    duration: float | None,
    sweep: Sweep,
    words: Sequence[str],
) -> int:
    """Install engines; list them, or compare them on scenes. Return the exit status.

    words: parts of the file names for the options.
    """
    known = engine_runs.contestants()
    for each in chosen("engine", install, known) if install else ():
        print(f"{each.name}: uv makes its environment, in minutes", file=sys.stderr)
        home = engine_runs.install(each, writable_folder(environments), python)
        print(home, *said_of(home), sep="\n  ")
    some = chosen("engine", only, known)
    if scenes and newest:
        raise InputError("--newest changes only the list of engines: leave out the scenes")
    if not scenes:
        if not install:
            write_record(sweep.json, {"engines": _list(some, environments, newest)})
        return AGREES
    if sweep.json and len(scenes) > 1:
        raise InputError("--json takes only one study: name only one scene")
    if only:
        engine_runs.check_installed(some, environments)
    for name in scenes:
        scene, quick = load_scene(name), sweep.quick
        seconds = seconds_of(duration, quick, scene)
        cells = cells_of(name, some, environments, seconds, 1 if quick else _ROUNDS)
        results = sweep.results(measure, cells, f"{scene.name}-engines", _LIMIT)
        study = _engines_study(scene, [*results, *_missed(some, environments)], only)
        sweep.present(study, *words)
    return AGREES


def _missed(chosen: Sequence[Contestant], environments: Path) -> list[Result]:
    """Return a failed result for each newer release that could not be installed."""
    cell = {"preset": "any", "field": "", "value": None, "stretches": False}
    return [
        Result({**cell, "contestant": release}, None, f"no wheel for {python_name(home)}")
        for home in (environments / contestant.name for contestant in chosen)
        for release in said_of(home)[1:]
    ]


def _list(chosen: Sequence[Contestant], environments: Path, newest: bool) -> list[Row]:
    """Print the engines and where they run, and return their rows; `newest`: ask the index."""
    rows: list[Row] = []
    for contestant in chosen:
        engine, folder = engine_named(contestant.engine), environments / contestant.name
        asked = contestant.requirements
        packages = (*asked, DEFAULT) if asked else (contestant.engine,)
        row = {"engine": contestant.name, "name": engine.label.name}
        row["version"] = versions_in(folder, packages) or "-"
        row |= {"presets": ", ".join(engine.presets), "by": "-", "runs in": "not installed"}
        if newest:
            row["newer"] = "-"
        rows.append(row)
        try:
            python = python_of(contestant, environments)
        except InputError as error:  # the environment is broken or too old
            row["runs in"] = str(error)
            continue
        if python == Path(sys.executable):
            row["version"] = engine.label.version
        if python:
            row |= {"by": python_name(python.parents[1]), "runs in": str(python.parents[1])}
            if newest:
                row["newer"] = ", ".join(newer_releases(python, packages)) or "-"
    rows += [
        {"version": missed.cell["contestant"], "runs in": f"not installed: {missed.failure}"}
        for missed in _missed(chosen, environments)
    ]
    for name in engine_names():
        try:
            engine_named(name)
        except InputError as error:
            rows.append({"engine": name, "presets": str(error)})
    show([table_of([Column(name, name, words=True) for name in rows[0]], rows)])
    return rows
