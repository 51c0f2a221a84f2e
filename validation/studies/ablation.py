"""Ablation: the effect of each choice of settings, from the naive model to the recipe and back.

Errors hide one another. While the model is built up choice by choice, the worst naive value that is
left dominates the error. A variant can even look worse than the previous variant, if two errors had
cancelled. To measure the effect of a single choice, only this choice is undone in the recipe.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from rich.markup import escape
from rich.table import Table

from robotball import Scene, Settings, integrate, preset
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.mujoco_engine import MUJOCO
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import NAIVE
from robotball.errors import unknown
from robotball.robot.looks import INK
from robotball.rotations import Array

from ..agreement import Agreement
from ..output import Show, known, panels, progress_bar, scientific
from ..plots import beside
from ..results import record
from ..study import Column, Row, Study, table_of
from .measuring import Cost, measure_costs, simulated_second

_TIMED = 2.0  # s of the motion over which the cost is measured
_ROUNDS = 5  # rounds of timing
_BUILT_UP, _UNDONE = "built up", "undone"  # directions
_SEPARATOR = "; "  # between faults
_INCHES = (11.0, 6.2)
_ERROR_AT, _COST_AT = 6, 58  # points; positions of the numbers to the right of a panel


@dataclass(frozen=True)
class _Choice:
    """A modelling choice: its fields of Settings and its description."""

    name: str
    fields: tuple[str, ...]
    words: str


# The choices with the largest effect come first because they hide the smaller ones.
CHOICES = (
    # The solver's tolerances are relative to the inertia: a huge inertia would stop it at once.
    _Choice("drive", ("drive", "tolerance", "ls_tolerance"), "huge inertias, not servos"),
    _Choice("friction", ("sliding_friction", "torsional_friction"), "more than the motion needs"),
    _Choice("cone", ("cone",), "elliptic, not a pyramid"),
    _Choice("root", ("root",), "the shell has the free joint, not the frame"),
    _Choice("integrator", ("integrator",), "RK4, not Euler"),
    _Choice("start", ("start_in_equilibrium",), "at the depth that carries the weight"),
    _Choice("softness", ("solref", "solimp", "solreffriction", "softness"), "a stiff contact"),
    _Choice("noslip", ("noslip_iterations", "noslip_tolerance"), "the noslip solver removes slip"),
    _Choice(
        "solver",
        ("solver", "jacobian", "iterations", "warmstart", "island"),
        "PGS and few iterations",
    ),
    _Choice("timestep", ("timestep",), "shorter than the engine's default"),
)
# The naive model makes the frame the root body. The naive model and the recipe continue after a
# fault, so that an error can be reported, and they report slip above the same tolerance.
BOTTOM = replace(NAIVE, root="frame", stop_at_fault=False)
TOP = replace(preset("accurate"), error_tolerance=NAIVE.error_tolerance, stop_at_fault=False)


def _adopt(settings: Settings, choice: _Choice, of: Settings) -> Settings:
    """Return `settings` with the choice as in the settings `of`."""
    return replace(settings, **{name: getattr(of, name) for name in choice.fields})


def without(settings: Settings, names: Iterable[str]) -> Settings:
    """Return `settings` with the named choices undone and appended to its name.

    Raises InputError for an unknown choice.
    """
    known = {choice.name: choice for choice in CHOICES}
    for name in names:
        if name not in known:
            raise unknown("choice", name, known)
        settings = replace(_adopt(settings, known[name], BOTTOM), name=f"{settings.name} - {name}")
    return settings


def built_up() -> tuple[Settings, ...]:
    """Return the naive model, then settings that each add one choice and have its name."""
    variants = [BOTTOM]
    for choice in CHOICES:
        variants.append(replace(_adopt(variants[-1], choice, TOP), name=choice.name))
    return tuple(variants)


def each_undone() -> tuple[Settings, ...]:
    """Return the recipe, then settings that each undo one choice and have its name."""
    return TOP, *(replace(_adopt(TOP, choice, BOTTOM), name=choice.name) for choice in CHOICES)


_SIGNS = {_BUILT_UP: "+ ", _UNDONE: "- "}
_HEADINGS = {
    _BUILT_UP: "From naive to the recipe, one more choice per row: later choices hide its effect.",
    _UNDONE: "The recipe without one choice: the effect of this choice alone.",
}
_NOTE = (
    "slip: root mean square of the sliding velocity over the rolling speed. CPU: processor time\n"
    "of a simulated second. × naive: relative to naive, median of rounds ± largest deviation.\n"
    "A run with a fault did not roll correctly, however small its errors are."
)
_SMALL: dict[str, Any] = {"fontsize": 9, "annotation_clip": False}
_DOT: dict[str, Any] = {"marker": "o", "color": LABEL.colour, "ls": "", "ms": 9}
_FAULTY: dict[str, Any] = {**_DOT, "mfc": "w", "mew": 2}
_DIAMOND: dict[str, Any] = {"marker": "D", "color": INK, "mfc": "w", "ls": "", "ms": 5}


def ablation_study(scene: Scene, times: Array, quick: bool) -> Study:
    """Run and time all variants of a scene over `times` (n,) [s] from 0, with progress shown."""
    with progress_bar(1) as show:
        return _measure_ablation(scene, times, 2 if quick else _ROUNDS, show)


def _measure_ablation(scene: Scene, times: Array, rounds: int, show: Show) -> Study:
    # Once for all variants, because the equations do not depend on the variant.
    theory = integrate(scene, times)
    directions = [(_BUILT_UP, settings) for settings in built_up()]
    directions += [(_UNDONE, settings) for settings in each_undone()]
    if not scene.ball.has_frame:  # then the shell is the only possible root
        directions = [
            (direction, replace(settings, root="shell"))
            for direction, settings in directions
            if settings.name != "root"
        ]
    models = [build(scene, settings) for _, settings in directions]
    agreements = []
    total = len(models) * (rounds + 2)
    for i, model in enumerate(models):
        show(i / total, f"{scene.name}: {model.settings.name}")
        # The error needs the whole time. The cost hardly changes in time, so it needs a part.
        agreements.append(Agreement(theory, run(model, theory.times), MUJOCO))
    timed = theory.times[: max(2, int(np.searchsorted(theory.times, _TIMED)))]
    costs = measure_costs(
        [simulated_second(model, timed) for model in models],
        rounds,
        lambda done: show((len(models) + done) / total, f"{scene.name}: timing"),
    )
    rows = [
        _part_row(direction, agreement, cost, costs[0])
        for (direction, _), agreement, cost in zip(directions, agreements, costs, strict=True)
    ]
    variants = [{**record(run), **row} for run, row in zip(agreements, rows, strict=True)]
    choices = [asdict(choice) for choice in CHOICES]
    data = {"scene": scene.name, "choices": choices, "variants": variants}
    shown = (f"[bold]{escape(f'{scene.name}: {scene.title}')}[/]", *_shown(rows))
    picture = _ablation_picture(scene.name, rows)
    return Study(scene.name, LABEL, ["ablation"], rows, data, shown, picture)


def _part_row(direction: str, agreement: Agreement, cost: Cost, naive: Cost) -> dict[str, Any]:
    """Return the numbers of a variant; errors are None if the run failed."""
    theory, ratio = agreement.theory, cost.over(naive)
    speed = theory.path_scale / float(theory.times[-1])
    return {
        "direction": direction,
        "choice": agreement.settings.name,
        "path_error": known(agreement.path_error),
        "momentum_error": known(agreement.momentum_error),
        "slip": float(np.sqrt(np.mean(agreement.report.slip**2))) / speed,
        "cpu_seconds": cost.seconds,
        "times_naive": ratio.ratio,
        "times_naive_least": ratio.spread[0],
        "times_naive_most": ratio.spread[1],
        "faults": _SEPARATOR.join(map(str, agreement.faults)),
    }


def _in(rows: Sequence[Row], direction: str) -> list[Row]:
    return [row for row in rows if row["direction"] == direction]


def _shown(rows: Sequence[Row]) -> Iterator[Table | str]:
    for direction, heading in _HEADINGS.items():
        yield heading
        yield table_of(_COLUMNS, _in(rows, direction), lambda row: row["faults"])
    yield _NOTE


def _name(row: Row) -> str:
    """Return the choice and its sign; the naive model and the recipe have no sign."""
    ends = BOTTOM.name, TOP.name
    return row["choice"] if row["choice"] in ends else f"{_SIGNS[row['direction']]}{row['choice']}"


def _times_naive(row: Row) -> str:
    ratio, ends = row["times_naive"], (row["times_naive_least"], row["times_naive_most"])
    return f"{ratio:.1f} ±{max(abs(end - ratio) for end in ends):.1f}"


def _first_fault(row: Row) -> str:
    """Return the first fault of a variant and the number of further faults."""
    first, *others = row["faults"].split(_SEPARATOR)
    return f"{first} (+{len(others)})" if others else first


_COLUMNS = (
    Column("choice", _name, words=True),
    Column("path\nerror", "path_error"),
    Column("M error", "momentum_error"),
    Column("slip", "slip"),
    Column("CPU", "cpu_seconds", "ms", form=".1f", scale=1e3),
    Column("× naive", _times_naive),
    Column("first fault", _first_fault, words=True),
)


def _ablation_picture(name: str, rows: Sequence[Row]) -> Figure:
    """Draw path error (dots), momentum error (diamonds) and cost of every variant."""
    up, undone = _in(rows, _BUILT_UP), _in(rows, _UNDONE)
    first, best = up[0]["path_error"], undone[0]["path_error"]
    finding = f"the recipe reduces the path error from {scientific(first)} to {scientific(best)}"
    figure, (left, right) = panels(f"{name}: {finding}", _INCHES, 1, 2, sharex=True)
    _panel(left, up)
    _panel(right, undone)
    if best is not None:
        for axes in (left, right):
            axes.axvline(best, color=INK, linestyle=":")
    left.set_title("from the naive model: one choice more", loc="left", fontsize=10.5)
    right.set_title("the recipe with one choice undone", loc="left", fontsize=10.5)
    drawn = [row[error] for row in rows for error in ("path_error", "momentum_error") if row[error]]
    if drawn:
        left.set_xlim(min(drawn) / 20, max(drawn) * 20)
    handles: list[Artist] = [
        Line2D([], [], **_DOT, label="path error"),
        Line2D([], [], **_FAULTY, label="path error, faulty run"),
        Line2D([], [], **_DIAMOND, label="momentum error"),
        Line2D([], [], color=INK, linestyle=":", label="path error of the recipe"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _panel(axes: Axes, rows: Sequence[Row]) -> None:
    axes.set_yticks(range(len(rows)), [_name(row).replace("- ", "− ") for row in rows])
    axes.set(xscale="log", xlabel="path error and momentum error, relative")
    # The first variant is at the top, like in the table.
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_axisbelow(True)
    for i, row in enumerate(rows):
        error, off, faulty = row["path_error"], row["momentum_error"], bool(row["faults"])
        if error is not None:
            axes.plot([error], [i], **(_FAULTY if faulty else _DOT))
        if off is not None:
            axes.plot([off], [i], **_DIAMOND)
        beside(axes, "broke off" if error is None else scientific(error), i, _ERROR_AT, **_SMALL)
        beside(axes, f"{row['times_naive']:.1f}", i, _COST_AT, **_SMALL)
    beside(axes, "path\nerror", -1, _ERROR_AT, **_SMALL)
    beside(axes, "CPU,\n× naive", -1, _COST_AT, **_SMALL)
