"""All engines on a scene: error against processor time, orders, the Pareto front."""

import json
import math
import os
import signal
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from subprocess import PIPE
from typing import Annotated, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from tyro.conf import Positional, arg

from robotball import InputError, Scene, engine_named, engine_names, load_scene
from robotball.errors import unknown
from robotball.film.looks import INK
from validation.options import AGREES, Duration, Names, Sweep, SweepOptions, listed, seconds_of
from validation.output import in_picture, print_whole, writable_folder
from validation.results import changed
from validation.sensitivity import chaotic
from validation.studies import engine_runs as process
from validation.studies.convergence import Order, fit_order
from validation.studies.engine_runs import Contestant, contestants, install, python_of
from validation.study import Column, Row, Study, scene_cell, table_of
from validation.sweeps import Cell, Result, rows_of

LIMIT = 300.0  # s that a run may take
ROUNDS = 3  # of timing
CANCELLED = 100.0  # a path so much better than M is one whose errors cancelled


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
    ours, theirs = os.pipe()
    command = [cell["interpreter"], "-m", process.__name__, str(ours)]
    text = json.dumps(dict(cell)).encode() + b"\n"
    with tempfile.TemporaryFile() as said:
        try:
            # The pipe's other end is ours alone: the run ends where we do.
            running = subprocess.Popen(
                command, stdin=PIPE, stdout=PIPE, stderr=said, pass_fds=(ours,)
            )
            answer, _ = running.communicate(text)
        finally:
            os.close(ours)
            os.close(theirs)
        said.seek(0)
        spoken = said.read().decode(errors="replace")
        words = [line for line in spoken.split("\n") if line.strip()]
    if running.returncode < 0:
        raise RuntimeError(f"its process was ended by {signal.Signals(-running.returncode).name}")
    if not answer:
        raise RuntimeError(words[-1] if words else "it ended without a word")
    record: dict[str, Any] = json.loads(answer)
    if "refused" in record:
        raise InputError(record["refused"])
    return record


@dataclass(frozen=True)
class Run:
    """A run that came to an answer.

    error: of the path, or in a chaotic scene the total defect of stretches; cost: processor time
    of a simulated second [s], at the speed of the study's median process.
    """

    contestant: str
    label: str
    version: str
    colour: str
    preset: str
    newcomer: bool
    field: str
    value: float
    error: float
    momentum_error: float
    cost: float
    python_share: float | None
    faults: tuple[str, ...]
    record: dict[str, Any]

    @property
    def title(self) -> str:
        value = f"{self.value * 1e3:g} ms" if self.field == "timestep" else f"{self.value:g}"
        return f"{self.name}, {self.preset}, {value}"

    @property
    def name(self) -> str:
        return f"{self.label} {self.version}"

    @property
    def usable(self) -> bool:
        """Whether the error says how well it rolls."""
        honest = self.momentum_error < CANCELLED * max(self.error, 1e-15)
        return self.error < process.LOOSEST and honest and "diverged" not in " ".join(self.faults)


@dataclass(frozen=True)
class EngineStudy:
    """All runs of a scene; failed: (contestant, preset, value, why) of those without an answer."""

    scene: Scene
    by_defects: bool
    runs: tuple[Run, ...]
    failed: tuple[tuple[str, str, float, str], ...]

    @cached_property
    def pareto_front(self) -> list[Run]:
        """Return the runs than which none is both cheaper and better, the best first."""
        front: list[Run] = []
        for run in sorted(
            (each for each in self.runs if each.usable), key=lambda r: (r.cost, r.error)
        ):
            if not front or run.error < front[-1].error:
                front.append(run)
        return front[::-1]

    @cached_property
    def orders(self) -> dict[tuple[str, str], Order]:
        """Return the orders by contestant and preset, where the runs lie on a line."""
        found = {}
        for key in dict.fromkeys((run.contestant, run.preset) for run in self.runs):
            mine = [
                r for r in self.runs if (r.contestant, r.preset) == key and r.field == "timestep"
            ]
            steps = [r.record["longest_step"] for r in mine]
            if len(mine) > 2 and (order := fit_order(steps, [r.error for r in mine])) is not None:
                found[key] = order
        return found


def study_of(scene: Scene, results: Sequence[Result]) -> EngineStudy:
    """Return the study of a scene's results."""
    answers = [(result.cell, result.record) for result in results if result.record]
    speed = statistics.median(record["fixed_work"] for _, record in answers) if answers else 1.0
    by_defects = any(result.cell["stretches"] for result in results)
    runs, failed = [], []
    for cell, record in answers:
        error = record["defect"] if by_defects else record["path_error"]
        if error is None or record["momentum_error"] is None:
            why = "; ".join(record["faults"]) or f"broke off at {record['reached']:g} s"
            failed.append((cell["contestant"], cell["preset"], cell["value"], why))
            continue
        seconds, python = record["seconds"], record["python_seconds"]
        runs.append(
            Run(
                cell["contestant"], record["label"], record["version"], record["colour"],
                cell["preset"], cell["preset"] == engine_named(cell["engine"]).as_it_comes,
                cell["field"], cell["value"], error, record["momentum_error"],
                seconds / cell["duration"] * speed / record["fixed_work"],
                None if python is None or not seconds else min(1.0, python / seconds),
                tuple(record["faults"]), record,
            )
        )  # fmt: skip
    failed += [
        (r.cell["contestant"], r.cell["preset"], r.cell["value"], r.failure or "")
        for r in results
        if r.record is None
    ]
    assert all(math.isfinite(run.cost) for run in runs)
    return EngineStudy(scene, by_defects, tuple(runs), tuple(failed))


INCHES = (10.0, 7.2)
MARKERS = "osD^vPX*<>hp"
STYLES = ("-", "--", ":", "-.")  # of an engine's presets, in their order
LEAST = 1e-15  # below it errors cannot be distinguished
NOTE = (
    "CPU: processor time of a simulated second, set-up excluded. Python: the part of it\n"
    "that Python takes at every step. * on the Pareto front: nothing is both cheaper and better."
)


def engines_study(scene: Scene, results: Sequence[Result], words: Sequence[str]) -> Study:
    """Return every run, those that gave none, and the front; words: of the files' names."""
    study = study_of(scene, results)
    data = record(study)
    return Study(
        scene.name, None, ["engines", *words], rows_of(results), data,
        shown=(
            f"[bold]{escape(scene.name)} ({scene.rolling}): {what(study)}[/]",
            table_of(COLUMNS, _shown(study, data["runs"]), lambda row: not row["usable"]),
            NOTE,
        ),
        picture=engines_picture(study),
    )  # fmt: skip


def _shown(study: EngineStudy, runs: Sequence[Row]) -> list[Row]:
    """Return the rows of the table, those of runs without an answer last; runs: as recorded."""
    rows = [
        {
            **row,
            "title": run.title,
            "front": "*" if row["on_the_pareto_front"] else "",
            "order": study.orders.get((run.contestant, run.preset)),
            "fault": run.faults[0] if run.faults else "",
            "usable": run.usable,
        }
        for run, row in zip(study.runs, runs, strict=True)
    ]
    failed = [
        {"title": f"{contestant}, {preset}, {value:g}", "front": "", "fault": why, "usable": False}
        for contestant, preset, value, why in study.failed
    ]
    return [*rows, *failed]


def _text(key: str, form: str, scale: float = 1.0) -> Callable[[Row], str]:
    """Return a function that formats a number of a row; a missing one is a dash."""
    return lambda row: "-" if row.get(key) is None else f"{row[key] * scale:{form}}"


def _order(row: Row) -> str:
    return "-" if row.get("order") is None else f"{row['order'].order:.2f}"


COLUMNS = (
    Column("", itemgetter("front"), words=True),
    Column("engine, preset, step or rtol", itemgetter("title"), words=True),
    Column("error", "error"),
    Column("order", _order),
    Column("M error", "momentum_error"),
    Column("slip", "slip", "m/s"),
    Column("CPU", _text("cost", ".3g", 1e3), "ms"),
    Column("Python", _text("python_share", ".0%")),
    Column("first fault", itemgetter("fault"), words=True),
)


def what(study: EngineStudy) -> str:
    """Return a description of the errors."""
    if study.by_defects:
        return "chaotic, so errors are the sum of defects over short stretches"
    return "path errors"


def engines_picture(study: EngineStudy) -> Figure:
    """Draw every engine's error against its cost: filled at its best, hollow as it comes."""
    figure = Figure(figsize=INCHES, layout="constrained")
    name = in_picture(study.scene.name)
    figure.suptitle(f"{name} ({study.scene.rolling}): {what(study)}")
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", xlabel="error, relative to the path's length")
    axes.set_ylabel("processor time of a simulated second [s]")
    axes.grid(alpha=0.3)
    _draw(axes, study)
    front = study.pareto_front
    axes.plot(
        [max(run.error, LEAST) for run in front], [run.cost for run in front],
        color=INK, linewidth=1.4, zorder=1, label="Pareto front",
    )  # fmt: skip
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure


def _draw(axes: Axes, study: EngineStudy) -> None:
    keys = list(dict.fromkeys((run.contestant, run.preset) for run in study.runs))
    of_engine: dict[str, int] = {}
    for contestant, preset in keys:
        mine = [r for r in study.runs if (r.contestant, r.preset) == (contestant, preset)]
        marker = MARKERS[of_engine.setdefault(contestant, len(of_engine)) % len(MARKERS)]
        first = mine[0]
        nth = [key for key in keys if key[0] == contestant].index((contestant, preset))
        order = study.orders.get((contestant, preset))
        label = f"{first.name}, {preset}" + (f" (order {order.order:.1f})" if order else "")
        axes.plot(
            [min(max(r.error, LEAST), 10.0) for r in mine],
            [r.cost for r in mine],
            marker=marker,
            linestyle=STYLES[nth % len(STYLES)],
            color=first.colour,
            markerfacecolor="none" if first.newcomer else first.colour,
            markersize=6,
            linewidth=1,
            zorder=2,
            label=in_picture(label),
        )


def record(study: EngineStudy) -> dict[str, Any]:
    """Return the study as plain data: all settings, versions, faults and costs."""
    front = {id(run) for run in study.pareto_front}
    return {
        "scene": study.scene.name,
        "rolling": study.scene.rolling,
        "errors": what(study),
        "runs": [_plain(run) | {"on_the_pareto_front": id(run) in front} for run in study.runs],
        "orders": [
            {"contestant": contestant, "preset": preset, **asdict(order)}
            for (contestant, preset), order in study.orders.items()
        ],
        "failed": [
            dict(zip(("contestant", "preset", "value", "why"), each, strict=True))
            for each in study.failed
        ],
    }


def _plain(run: Run) -> dict[str, Any]:
    plain = asdict(run)
    record = plain.pop("record")
    own = {name: value for name, value in plain.items() if not _is_nan(value)}
    return {**record, **own}


def _is_nan(value: Any) -> bool:
    return isinstance(value, float) and math.isnan(value)


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
    environments: Path = Path("out/engines")
    """Folder for the environments."""
    duration: Duration = None
    """Simulated time; each scene's own if not given."""
    sweep: SweepOptions = field(default_factory=Sweep)

    def run(self) -> int:
        known = contestants()
        for each in _chosen(known, listed(self.install)) if self.install else ():
            print(install(each, writable_folder(self.environments)))
        chosen = _chosen(known, listed(self.only) or tuple(known))
        if not self.scenes:
            if not self.install:
                _list(chosen, self.environments)
            return AGREES
        writable_folder(self.sweep.out)
        for name in self.scenes:
            self._study(name, chosen)
        return AGREES

    def _study(self, name: str, chosen: Sequence[Contestant]) -> None:
        scene, quick = load_scene(name), self.sweep.quick
        seconds = seconds_of(self.duration, quick, scene)
        cells = cells_of(name, chosen, self.environments, seconds, 1 if quick else ROUNDS)
        results = self.sweep.results(measure, cells, f"{scene.name}-engines", LIMIT)
        study = engines_study(scene, results, listed(self.only))
        self.sweep.present(study, *changed(self, "duration"))


def _chosen(known: dict[str, Contestant], names: tuple[str, ...]) -> list[Contestant]:
    for name in names:
        if name not in known:
            raise unknown("engine", name, known)
    return [known[name] for name in names]


def _list(chosen: Sequence[Contestant], environments: Path) -> None:
    table = Table("engine", "name", "version", "presets", "runs in", box=box.SIMPLE_HEAD)
    there = {each.engine for each in chosen}
    for each in chosen:
        engine, python = engine_named(each.engine), python_of(each, environments)
        place = "nowhere: not installed" if python is None else str(python.parents[1])
        here = each.name == each.engine and python == Path(sys.executable)
        version = engine.label.version if here else "-"
        presets = ", ".join(engine.presets)
        table.add_row(*map(escape, (each.name, engine.label.name, version, presets, place)))
    for key in engine_names():
        if key not in there:
            try:
                engine_named(key)
            except InputError as error:
                table.add_row(escape(key), "-", "-", escape(str(error)), "-")
    print_whole(table, Console())
