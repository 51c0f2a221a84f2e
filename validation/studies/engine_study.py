"""All engines on a scene: error against processor time, orders, the Pareto front."""

import statistics
import sys
from collections.abc import Sequence
from dataclasses import asdict
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape

from robotball import InputError, Scene, engine_named, engine_names, load_scene
from robotball.engines.engine import DEFAULT
from robotball.engines.environments import call, python_name, said_of, versions_in
from robotball.robot.looks import INK

from ..options import AGREES, Sweep, chosen, seconds_of
from ..output import in_picture, writable_folder, write_record
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
from .engine_rows import row_of
from .engine_runs import Contestant, python_of
from .orders import fit_order

_LIMIT = 300.0  # s that a run may take, compilation included
_ROUNDS = 3  # of timing


def cells_of(
    scene: str, contestants: Sequence[Contestant], folder: Path, duration: float, rounds: int
) -> list[Cell]:
    """Return a run for every value of every ladder of every engine that is there."""
    stretches = chaotic(load_scene(scene))
    shared = {**scene_cell(scene, duration), "rounds": rounds, "stretches": stretches}
    return [
        {**shared, "contestant": each.name, "engine": each.engine, "preset": preset,
         "field": field, "value": value, "interpreter": str(python)}
        for each in contestants
        if (python := python_of(each, folder)) is not None
        for preset, (field, values) in row_of(each.engine).ladders.items()
        for value in values
    ]  # fmt: skip


def measure(cell: Cell) -> dict[str, Any]:
    """Run a cell in a process of its own; raises where that ends without a record."""
    return call(cell["interpreter"], engine_runs.run, dict(cell))


def study_of(scene: Scene, results: Sequence[Result]) -> dict[str, Any]:
    """Return the study of a scene's results, as plain data.

    errors  a description of them: of the path, or in a chaotic scene the total defects of stretches
    runs    a row each, that of its cell and its record and besides
              error     as `errors` says
              cost      processor time of a simulated second [s], at the speed of the study's median
                        process; python_share: Python's part of it
              relative_cost  over that of the default engine by its default settings, if run
              order     of the preset's errors, where they lie on a line
              newcomer  whether the preset is the engine as it comes, by its `source`
              ours      the parts that are robotball's
              usable    whether the error says how well it rolls
              on_the_pareto_front  whether no usable run is both cheaper and better
    orders  the lines, with their contestants and presets
    failed  a row with its contestant, preset, value and fault, for each run without an answer
    """
    speed = statistics.median([each.record["fixed_work"] for each in results if each.record] or [1])
    by_defects = any(result.cell["stretches"] for result in results)
    runs: list[dict[str, Any]] = []
    orders, failed = [], []
    for cell, record, failure in ((each.cell, each.record, each.failure) for each in results):
        place = {name: cell[name] for name in ("contestant", "preset", "field", "value")}
        if record is None:
            failed.append({**place, "title": _title(place), "fault": failure})
            continue
        error, faults = record["defect" if by_defects else "path_error"], record["faults"]
        if error is None or record["momentum_error"] is None:
            fault = "; ".join(faults) or f"broke off at {record['reached']:g} s"
            failed.append({**place, "title": _title(place), "fault": fault})
            continue
        engine, row = engine_named(cell["engine"]), row_of(cell["engine"])
        python = record["python_seconds"]
        of, seconds = {**record, **place, "error": error}, record["seconds"]
        runs.append({
            **of, "title": _title(of), "fault": "".join(faults[:1]), "usable": _usable(of),
            "newcomer": cell["preset"] == engine.as_it_comes,
            "cost": seconds / cell["duration"] * speed / record["fixed_work"],
            "python_share": min(1.0, python / seconds) if python is not None and seconds else None,
            "ours": row.ours.get(cell["preset"], ""), "source": row.source,
        })  # fmt: skip
    default = engine_named(DEFAULT)
    published = getattr(
        default.presets[default.default], row_of(DEFAULT).ladders[default.default][0]
    )
    own = (DEFAULT, default.default, published)
    unit = next((run["cost"] for run in runs if (*_key(run), run["value"]) == own), None)
    usable = [run for run in runs if run["usable"]]
    front = pareto_front(*([run[name] for run in usable] for name in ("error", "cost")))
    best = [usable[i] for i in front]
    for run in runs:
        run |= {"relative_cost": run["cost"] / unit if unit else None, "order": None}
        run["on_the_pareto_front"] = any(run is each for each in best)
    for (contestant, preset), some in groupby(runs, _key):
        mine = [run for run in some if run["field"] == "timestep"]
        steps, errors = ([run[name] for run in mine] for name in ("longest_step", "error"))
        if order := fit_order(steps, errors):
            orders.append({"contestant": contestant, "preset": preset, **asdict(order)})
            for run in mine:
                run["order"] = order.order
    what = "chaotic, so errors are the sum of defects over short stretches"
    return {
        "scene": scene.name, "rolling": scene.rolling,
        "errors": what if by_defects else "path errors",
        "runs": runs, "orders": orders, "failed": failed,
    }  # fmt: skip


def _key(run: Row) -> tuple[str, str]:
    return run["contestant"], run["preset"]


def _title(run: Row) -> str:
    """Return an engine with its version, the preset, and the step or rtol that it has."""
    engine = f"{run['label']} {run['version']}" if "label" in run else run["contestant"]
    value = run["value"] or 0.0  # a release that cannot be run has none
    said = {"timestep": f", {value * 1e3:g} ms", "rtol": f", {value:g}"}
    return f"{engine}, {run['preset']}{said.get(run['field'], '')}"


def _usable(run: Row) -> bool:
    """Return whether the error says how well it rolls."""
    honest = run["momentum_error"] < CANCELLED * max(run["error"], _LEAST)
    return (
        run["error"] < engine_runs.LOOSEST and honest and "diverged" not in " ".join(run["faults"])
    )


_SAID = 1e-6  # error of which the picture's title says what it costs
_IDEAL = ":"  # where the engine gives its dynamics alone
_LEAST = 1e-15  # below it errors cannot be distinguished
_NOTE = (
    "N error, over the weight; cone: friction beyond it; slip work, over the kinetic energy; "
    "energy gained (+) or lost. CPU: processor time of a simulated second, without set-up and "
    "reading; relative to that of {} by default; spread of its rounds; Python: its part that "
    "Python takes at every step. ours: the parts that robotball brings. * on the Pareto front: "
    "nothing is both cheaper and better."
)


def _engines_study(scene: Scene, results: Sequence[Result], words: Sequence[str]) -> Study:
    """Return every run, those that gave none, and the front; words: of the files' names."""
    study = study_of(scene, results)
    name, errors = f"{scene.name} ({scene.rolling})", study["errors"]
    rows = [*study["runs"], *study["failed"]]
    table = table_of(COLUMNS, rows, lambda row: not row.get("usable"))
    heading = f"[bold]{escape(name)}: {errors}[/]"
    shown = (heading, table, _NOTE.format(engine_named(DEFAULT).label.name))
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
    Column("Python", "python_share", form=".0%"), Column("by Python", "python", words=True),
    Column("ours", "ours", words=True),
    Column("first fault", "fault", words=True),
)  # fmt: skip


def _engines_picture(name: str, errors: str, runs: Sequence[Row]) -> Figure:
    """Draw engines' errors against their costs; of one in two versions the second is pale."""
    order = dict.fromkeys(run["contestant"] for run in sorted(runs, key=itemgetter("error")))
    within = [run for run in runs if run["usable"] and run["error"] <= _SAID]
    within.sort(key=itemgetter("cost"), reverse=True)
    costs = {run["label"]: run["cost"] for run in within}  # the least of each
    cheapest = sorted(costs.items(), key=itemgetter(1))[:2]
    words = ", ".join(f"{cost * 1e3:.2g} ms by {label}" for label, cost in cheapest) or "no engine"
    heading = f"{name}: a second right to {_SAID:g} takes {words}"
    figure, axes = cost_axes(heading, f"{errors}, relative to the path's length")
    drawn = set[str]()
    for each in order:
        first = next(run for run in runs if run["contestant"] == each)
        label, colour = in_picture(f"{first['label']} {first['version']}"), first["colour"]
        mark, pale = first["marker"], 0.4 if first["label"] in drawn else 1.0
        drawn.add(first["label"])
        axes.plot([], [], f"{mark}-", color=colour, linewidth=1, alpha=pale, label=label)
        for _, some in groupby([run for run in runs if run["contestant"] == each], _key):
            mine = [*some]
            style = _IDEAL if {"all", "constraints"} & {*mine[0]["ours"].split(", ")} else "-"
            axes.plot(
                [min(max(run["error"], _LEAST), 10.0) for run in mine],
                [run["cost"] for run in mine], f"{mark}{style}", color=colour, markersize=6,
                mfc="none" if mine[0]["newcomer"] else colour, linewidth=1, alpha=pale, zorder=2,
            )  # fmt: skip
    best = sorted(
        (max(run["error"], _LEAST), run["cost"]) for run in runs if run["on_the_pareto_front"]
    )
    front = np.reshape(best, (-1, 2)).T
    axes.plot(*front, color=INK, linewidth=1.8, zorder=1, label="Pareto front")
    axes.plot([], [], "o", color=INK, mfc="none", label="as it comes")
    axes.plot([], [], _IDEAL, color=INK, linewidth=1, label="rolling constraints of ours")
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def run_engines(
    scenes: Sequence[str],
    only: Sequence[str],
    install: Sequence[str],
    python: str,
    environments: Path,
    duration: float | None,
    sweep: Sweep,
    words: Sequence[str],
) -> int:
    """Install engines; list them, or compare them on scenes. Return the exit status.

    words: of the options, for the files' names.
    """
    known = engine_runs.contestants()
    for each in chosen("engine", install, known) if install else ():
        print(f"{each.name}: uv makes its environment, in minutes", file=sys.stderr)
        home = engine_runs.install(each, writable_folder(environments), python)
        print(home, *said_of(home), sep="\n  ")
    some = chosen("engine", only, known)
    if not scenes:
        if not install:
            write_record(sweep.json, {"engines": _list(some, environments)})
        return AGREES
    if sweep.json and len(scenes) > 1:
        raise InputError("--json takes one study: name one scene")
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
    """Return a cell without a record for each newer release, as seen at an installation."""
    cell = {"preset": "any", "field": "", "value": None, "stretches": False}
    return [
        Result({**cell, "contestant": each}, None, f"no wheel for {python_name(home)}")
        for home in (environments / each.name for each in chosen)
        for each in said_of(home)[1:]
    ]


def _list(chosen: Sequence[Contestant], environments: Path) -> list[Row]:
    """Print the engines and where they run, and return them."""
    rows: list[Row] = []
    for each in chosen:
        engine, python = engine_named(each.engine), python_of(each, environments)
        there = versions_in(environments / each.name, (*each.requirements, DEFAULT))
        version = engine.label.version if python == Path(sys.executable) else there or "-"
        rows.append({
            "engine": each.name, "name": engine.label.name, "version": version,
            "presets": ", ".join(engine.presets),
            "by": python_name(python.parents[1]) if python else "-",
            "runs in": str(python.parents[1]) if python else "nowhere: not installed",
        })  # fmt: skip
    rows += [
        {"version": each.cell["contestant"], "runs in": f"nowhere: {each.failure}"}
        for each in _missed(chosen, environments)
    ]
    others = {each.engine for each in chosen}
    for key in (each for each in engine_names() if each not in others):
        try:
            engine_named(key)
        except InputError as error:
            rows.append({"engine": key, "presets": str(error)})
    show([table_of([Column(name, name, words=True) for name in rows[0]], rows)])
    return rows
