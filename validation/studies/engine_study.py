"""All engines on a scene: error against processor time, orders, the Pareto front."""

import json
import math
import statistics
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

from matplotlib.figure import Figure
from rich.markup import escape
from tyro.conf import Positional, arg

from robotball import InputError, Scene, engine_named, engine_names, load_scene
from robotball.engine import DEFAULT
from robotball.engines.adapter import not_installed
from robotball.engines.environments import ENVIRONMENTS, call, versions_in
from robotball.errors import check_count, check_positive
from robotball.film.looks import INK
from validation.options import (
    AGREES,
    Duration,
    Names,
    Sweep,
    SweepOptions,
    chosen,
    listed,
    seconds_of,
)
from validation.output import in_picture, writable_folder
from validation.results import changed
from validation.sensitivity import chaotic
from validation.studies import engine_runs as process
from validation.studies.engine_runs import Contestant, contestants, install, python_of
from validation.studies.orders import Order, fit_order
from validation.studies.tuning import Changes, search
from validation.study import (
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
from validation.sweeps import Cell, Result, rows_of

_LIMIT = 300.0  # s that a run may take
_ROUNDS = 3  # of timing
_LEAST_BUDGET = 4  # of a search


def cells_of(
    scene: str, contestants: Sequence[Contestant], folder: Path, duration: float, rounds: int
) -> list[Cell]:
    """Return a run for every value of every ladder of every engine that is there."""
    stretches = chaotic(load_scene(scene))
    shared = {**scene_cell(scene, duration), "rounds": rounds, "stretches": stretches}
    return [
        {
            **shared,
            "contestant": each.name,
            "engine": each.engine,
            "preset": preset,
            "field": field,
            "value": value,
            "interpreter": str(python),
        }
        for each in contestants
        if (python := python_of(each, folder)) is not None
        for preset, (field, values) in engine_named(each.engine).ladders.items()
        for value in values
    ]


def measure(cell: Cell) -> dict[str, Any]:
    """Run a cell in a process of its own; raises where that ends without a record."""
    return call(cell["interpreter"], process.run, dict(cell))


@dataclass(frozen=True)
class _EngineStudy:
    """All runs of a scene.

    what          a description of the errors: of the path, or in a chaotic scene the total defects
                  of stretches
    runs          by contestant and preset; a row of plain data each, that of its cell and its
                  record and besides
                    error     as `what` says
                    cost      processor time of a simulated second [s], at the speed of the
                              study's median process; python_share: Python's part of it
                    relative_cost  over that of the default engine by its default settings, if run
                    newcomer  whether the preset is the engine as it comes, by its `source`
                    ours      the parts that are robotball's
                    changes   of the preset, in a search for the best
    orders        by contestant and preset, where the runs lie on a line
    pareto_front  the runs than which none is both cheaper and better, the best first
    failed        a row with its contestant, preset, value and why, for each run without an answer
    """

    scene: Scene
    what: str
    runs: Mapping[tuple[str, str], Sequence[Row]]
    orders: dict[tuple[str, str], Order]
    pareto_front: Sequence[Row]
    failed: list[Row]


def study_of(scene: Scene, results: Sequence[Result]) -> _EngineStudy:
    """Return the study of a scene's results."""
    works = [result.record["fixed_work"] for result in results if result.record]
    speed = statistics.median(works) if works else 1.0
    by_defects = any(result.cell["stretches"] for result in results)
    runs: dict[tuple[str, str], list[dict[str, Any]]] = {}
    broken, failed = [], []
    for cell, record, failure in ((each.cell, each.record, each.failure) for each in results):
        place = {name: cell[name] for name in ("contestant", "preset", "value")}
        if record is None:
            failed.append({**place, "why": failure or ""})
            continue
        error = record["defect"] if by_defects else record["path_error"]
        if error is None or record["momentum_error"] is None:
            why = "; ".join(record["faults"]) or f"broke off at {record['reached']:g} s"
            broken.append({**place, "why": why})
            continue
        seconds, python = record["seconds"], record["python_seconds"]
        share = None if python is None or not seconds else min(1.0, python / seconds)
        runs.setdefault((cell["contestant"], cell["preset"]), []).append(
            {
                **record, **place, "field": cell["field"], "error": error,
                "newcomer": cell["preset"] == engine_named(cell["engine"]).as_it_comes,
                "cost": seconds / cell["duration"] * speed / record["fixed_work"],
                "python_share": share,
                "ours": engine_named(cell["engine"]).ours.get(cell["preset"], ""),
                "source": engine_named(cell["engine"]).source, "changes": cell.get("changes", {}),
            }
        )  # fmt: skip
    preset = engine_named(DEFAULT).presets[engine_named(DEFAULT).default]
    own = runs.get((DEFAULT, preset.name), ())
    units = [each["cost"] for each in own if each["value"] == getattr(preset, each["field"])]
    for each in (each for of in runs.values() for each in of):
        each["relative_cost"] = each["cost"] / units[0] if units else None
    usable = [each for of in runs.values() for each in of if _usable(each)]
    front = pareto_front(*([each[name] for each in usable] for name in ("error", "cost")))
    orders = {key: order for key, of in runs.items() if (order := _order(of)) is not None}
    what = "chaotic, so errors are the sum of defects over short stretches"
    return _EngineStudy(
        scene, what if by_defects else "path errors", runs, orders,
        [usable[i] for i in front][::-1], [*broken, *failed],
    )  # fmt: skip


def _order(runs: Sequence[Row]) -> Order | None:
    """Return the order of a preset's error in the timestep; None where runs lie on no line."""
    mine = [each for each in runs if each["field"] == "timestep" and not each["changes"]]
    return fit_order([each["longest_step"] for each in mine], [each["error"] for each in mine])


def _usable(run: Row) -> bool:
    """Return whether the error says how well it rolls."""
    honest = run["momentum_error"] < CANCELLED * max(run["error"], _LEAST)
    return run["error"] < process.LOOSEST and honest and "diverged" not in " ".join(run["faults"])


def _name(run: Row) -> str:
    return f"{run['label']} {run['version']}"


_MARKERS = "osD^vPX*<>hp"
_IDEAL = ":"  # where the engine gives its dynamics alone
_LEAST = 1e-15  # below it errors cannot be distinguished
_NOTE = (
    "N error, over the weight; cone: friction beyond it; slip work, over the kinetic energy; "
    "energy gained (+) or lost. CPU: processor time of a simulated second, without set-up and "
    "reading; relative to that of {} by default; spread of its rounds; Python: its part "
    "that Python takes at every step. * on the Pareto front: nothing is both cheaper and better."
)


def _engines_study(scene: Scene, results: Sequence[Result], words: Sequence[str]) -> Study:
    """Return every run, those that gave none, and the front; words: of the files' names."""
    study = study_of(scene, results)
    return Study(
        scene.name, None, ["engines", *words], rows_of(results), _record(study),
        shown=(
            f"[bold]{escape(scene.name)} ({scene.rolling}): {study.what}[/]",
            table_of(COLUMNS, _shown(study), lambda row: not row.get("usable")),
            _NOTE.format(engine_named(DEFAULT).label.name),
        ),
        picture=_engines_picture(study),
    )  # fmt: skip


def _shown(study: _EngineStudy) -> list[Row]:
    """Return the rows of the table, those of runs without an answer last."""
    rows = [
        {
            **run,
            "title": f"{_name(run)}, {run['preset']}, {value_of(run)}",
            "front": "*" if run in study.pareto_front else "",
            "order": study.orders[key].order if key in study.orders else None,
            "fault": run["faults"][0] if run["faults"] else "",
            "usable": _usable(run),
        }
        for key, runs in study.runs.items()
        for run in runs
    ]
    failed = [
        {"title": f"{row['contestant']}, {row['preset']}, {row['value']:g}", "fault": row["why"]}
        for row in study.failed
    ]
    return [*rows, *failed]


def value_of(run: Row) -> str:
    """Return the timestep of a run with its unit, or its tolerance."""
    value: float = run["value"]
    return f"{value * 1e3:g} ms" if run["field"] == "timestep" else f"{value:g}"


COLUMNS = (
    Column("", "front", words=True, missing=""),
    Column("engine, preset, step or rtol", "title", words=True),
    Column("error", "error"),
    Column("order", "order", form=".2f"),
    Column("M error", "momentum_error"),
    Column("slip", "slip", "m/s"),
    Column("N error", "normal_force_error"),
    Column("cone", "cone_violation"),
    Column("slip work", "slip_work"),
    Column("energy", "energy_error"),
    Column("CPU", "cost", "ms", form=".3g", scale=1e3),
    Column("relative", "relative_cost", form=".3g"),
    Column("spread", "spread", form=".2f"),
    Column("Python", "python_share", form=".0%"),
    Column("ours", "ours", words=True),
    Column("first fault", "fault", words=True),
)


def _changes(run: Row) -> str:
    """Return what a run of a search changed, in a line."""
    return ", ".join(f"{name} {value}" for name, value in run["changes"].items()) or "as published"


_SHOWN = 5  # of a search
_TUNED = (COLUMNS[2], *COLUMNS[4:7], Column("settings", _changes, words=True))


def _engines_picture(study: _EngineStudy) -> Figure:
    """Draw engines' errors against their costs: as many as there are markers, of least errors."""
    least: dict[str, float] = {}
    for (contestant, _), runs in study.runs.items():
        least[contestant] = min(least.get(contestant, math.inf), *(run["error"] for run in runs))
    names = sorted(least, key=lambda name: least[name])
    left = f"; not drawn: {', '.join(names[len(_MARKERS) :])}" if names[len(_MARKERS) :] else ""
    figure, axes = cost_axes(
        f"{in_picture(study.scene.name)} ({study.scene.rolling}): {study.what}{left}",
        "error, relative to the path's length",
    )
    for name, mark in zip(names, _MARKERS, strict=False):
        label = _name(next(runs[0] for key, runs in study.runs.items() if key[0] == name))
        for runs in (runs for key, runs in study.runs.items() if key[0] == name):
            first, errors = runs[0], [min(max(run["error"], _LEAST), 10.0) for run in runs]
            style = _IDEAL if {"all", "constraints"} & set(first["ours"].split(", ")) else "-"
            axes.plot(errors, [run["cost"] for run in runs], f"{mark}{style}", markersize=6,
                      mfc="none" if first["newcomer"] else first["colour"], color=first["colour"],
                      linewidth=1, zorder=2)  # fmt: skip
        axes.plot([], [], f"{mark}-", color=first["colour"], linewidth=1, label=in_picture(label))
    front = study.pareto_front
    axes.plot(
        [max(run["error"], _LEAST) for run in front], [run["cost"] for run in front],
        color=INK, linewidth=1.8, zorder=1, label="Pareto front",
    )  # fmt: skip
    axes.plot([], [], "o", color=INK, mfc="none", label="as it comes")
    axes.plot([], [], _IDEAL, color=INK, linewidth=1, label="rolling constraints of ours")
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _record(study: _EngineStudy) -> dict[str, Any]:
    """Return the study as plain data: all settings, versions, faults and costs."""
    front = study.pareto_front
    return {
        "scene": study.scene.name,
        "rolling": study.scene.rolling,
        "errors": study.what,
        "runs": [
            {**run, "on_the_pareto_front": run in front}
            for runs in study.runs.values()
            for run in runs
        ],
        "orders": [
            {"contestant": contestant, "preset": preset, **asdict(order)}
            for (contestant, preset), order in study.orders.items()
        ],
        "failed": study.failed,
    }


@dataclass(frozen=True)
class Engines:
    """List the engines and their presets; of scenes, each engine's error against its cost.

    Example: robotball engines fig12 --only mujoco --quick
    """

    scenes: Positional[Annotated[tuple[str, ...], arg(metavar="[SCENE…]")]] = ()
    """Names from the catalog, or paths to TOML files; without any the engines are listed."""
    only: Names = ()
    """Engines to run; all that are there if not given. Several: drake,bullet."""
    install: Names = ()
    """Make environments of their own for these engines first, by pip. Several: drake,bullet."""
    environments: Path = ENVIRONMENTS
    """Folder for the environments."""
    tune: bool = False
    """Search each engine's own knobs for its best settings, by as many runs for every engine."""
    budget: Annotated[int, arg(metavar="N")] = 60
    """Configurations that the search tries."""
    cap: Annotated[float, arg(metavar="MS")] = 100.0
    """Processor time of a simulated second that the best of a search may take, in ms."""
    duration: Duration = None
    """Simulated time; each scene's own if not given."""
    sweep: SweepOptions = field(default_factory=Sweep)

    def run(self) -> int:
        known = contestants()
        for each in chosen("engine", listed(self.install), known) if self.install else ():
            print(install(each, writable_folder(self.environments)))
        some = chosen("engine", listed(self.only), known)
        if not self.scenes:
            if not self.install:
                _list(some, self.environments)
            return AGREES
        writable_folder(self.sweep.out)
        for name in self.scenes:
            for each in some if self.tune else ():
                self._tune(name, each)
            if not self.tune:
                self._study(name, some)
        return AGREES

    def _tune(self, name: str, contestant: Contestant) -> None:
        scene, engine = load_scene(name), engine_named(contestant.engine)
        if engine.knobs is None:
            raise InputError(f"{contestant.name} has no knobs: there is nothing to tune")
        check_count("budget", self.budget, _LEAST_BUDGET)
        check_positive("cap", self.cap, "ms")
        if python_of(contestant, self.environments) is None:
            raise not_installed(engine.label.name, contestant.name)
        seconds = seconds_of(self.duration, self.sweep.quick, scene)
        cells = cells_of(name, [contestant], self.environments, seconds, 1)
        (base, *_) = (cell for cell in cells if cell["preset"] == engine.knobs[0])
        published = getattr(engine.presets[base["preset"]], base["field"])
        tried: list[Result] = []
        best: list[Row] = []

        def errors(configurations: Sequence[Changes]) -> list[float]:
            wanted = [{**base, "value": published, "changes": each} for each in configurations]
            journal = f"{scene.name}-tune-{contestant.name}"
            tried[:] = self.sweep.results(measure, wanted, journal, _LIMIT)
            runs = [run for of in study_of(scene, tried).runs.values() for run in of]
            within = [run for run in runs if _usable(run) and run["cost"] <= self.cap / 1e3]
            best[:] = sorted(within, key=lambda run: run["error"])
            by_changes = {json.dumps(run["changes"]): run["error"] for run in best}
            return [by_changes.get(json.dumps(each), math.inf) for each in configurations]

        search(engine.knobs, self.budget, errors)
        title = f"{scene.name}, {base['preset']} of {contestant.name}, within {self.cap:g} ms"
        shown = (f"[bold]{escape(title)}[/]", table_of(_TUNED, best[:_SHOWN]))
        study = Study(scene.name, engine.label, ["tune"], rows_of(tried), {"best": best}, shown)
        self.sweep.present(study, *changed(self, "duration", "budget", "cap"))

    def _study(self, name: str, chosen: Sequence[Contestant]) -> None:
        for each in chosen if self.only else ():
            if python_of(each, self.environments) is None:
                raise not_installed(engine_named(each.engine).label.name, each.name)
        scene, quick = load_scene(name), self.sweep.quick
        seconds = seconds_of(self.duration, quick, scene)
        cells = cells_of(name, chosen, self.environments, seconds, 1 if quick else _ROUNDS)
        results = self.sweep.results(measure, cells, f"{scene.name}-engines", _LIMIT)
        study = _engines_study(scene, results, listed(self.only))
        self.sweep.present(study, *changed(self, "duration"))


def _list(chosen: Sequence[Contestant], environments: Path) -> None:
    names = ("engine", "name", "version", "presets", "runs in")
    rows = []
    for each in chosen:
        engine, python = engine_named(each.engine), python_of(each, environments)
        place = "nowhere: not installed" if python is None else str(python.parents[1])
        there = versions_in(environments / each.name, (*each.requirements, DEFAULT))
        version = engine.label.version if python == Path(sys.executable) else there or "-"
        cells = (each.name, engine.label.name, version, ", ".join(engine.presets), place)
        rows.append(dict(zip(names, cells, strict=True)))
    others = {each.engine for each in chosen}
    for key in (each for each in engine_names() if each not in others):
        try:
            engine_named(key)
        except InputError as error:
            rows.append({"engine": key, "presets": str(error)})
    show([table_of([Column(name, name, words=True) for name in names], rows)])
