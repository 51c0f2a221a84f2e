"""Where the contact model breaks: each cell of the maps is run and held against the equations.

The cells together show which outcomes there are, what was missed and where the limits lie. The
picture of a map has a panel for each rolling model and integrator, or for several of which all
cells are alike; a cell shows its outcome by a grey and a hatch, so that it needs no colour, and a
region has its word where there is room. The maps themselves are data, in `extreme_maps.py`.
"""

import logging
import time
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from enum import Enum
from itertools import compress, cycle, groupby
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from rich.table import Table

from robotball import Fault, FaultKind, InputError, Motion, Scene, Settings
from robotball.engines.mujoco import LABEL, contact_limits, limits, robot_limits
from robotball.engines.mujoco.limits import PlannedRun
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import exceeded, limit_checks, run
from robotball.engines.mujoco.settings import Resolved
from robotball.robot.looks import ACCENT, INK
from robotball.rotations import Array

from ..agreement import Agreement
from ..options import AGREES, DISAGREES, Sweep, chosen
from ..output import halo, known, write_record
from ..study import Column, Row, Study, compiled_motion, show, table_of
from ..sweeps import Result, rows_of
from .extreme_maps import (
    ERROR_TOLERANCE,
    MAPS,
    QUICK,
    TIMESTEP,
    WHOLE,
    Map,
    cell_run,
    cells_of,
)
from .maps import draw_cells, draw_level

ACCURATE = 1e-4  # largest error of an accurate run, relative; the recipe's coarsest keeps 1e-6
WRONG = 0.1  # an error above it is no result at all
LAWS = {law.__name__: law for law in (*limits.LAWS, *robot_limits.LAWS, *contact_limits.LAWS)}


class Outcome(Enum):
    """The outcome of a cell: its word on the map, its grey and hatch there, and its sentence."""

    ACCURATE = ("accurate", 1.0, "", f"accurate: error at most {ACCURATE:g}")
    DEGRADED = ("degraded", 0.9, "", f"degraded: error at most {WRONG:g}")
    WRONG = ("wrong", 0.15, "", f"silently wrong: error above {WRONG:g}, contact and drives sound")
    SLIPPED = ("slipped", 0.9, "////", "slipped: friction cone saturated, or slip along the path")
    LOST_CONTACT = ("lost contact", 0.75, "....", "lost contact")
    OFF_RATE = ("off rate", 0.9, "----", "a drive lost its rate")
    DIVERGED = ("diverged", 0.55, "", "diverged and reported")
    REFUSED = ("refused", 1.0, "xxxx", "refused before the run, with one line")
    UNFINISHED = ("out of time", 1.0, "\\\\\\\\", "stopped at its limit of steps or time")
    FAILED = ("failed", 0.15, "xxxx", "ended in an error that nobody had foreseen")

    def __init__(self, word: str, grey: float, hatch: str, sentence: str) -> None:
        self.word = word
        self.look: dict[str, Any] = {"fc": str(grey), "hatch": hatch, "ec": "0.5", "lw": 0.4}
        self.sentence = sentence


# Any other kind of fault leaves no state.
_OF_KIND = {
    FaultKind.OUT_OF_STEPS: Outcome.UNFINISHED,
    FaultKind.CONTACT_LOST: Outcome.LOST_CONTACT,
    FaultKind.CONE_SATURATED: Outcome.SLIPPED,
    FaultKind.SLIPPED: Outcome.SLIPPED,
    FaultKind.RATE_OFF: Outcome.OFF_RATE,
    FaultKind.TORQUE_LIMIT: Outcome.OFF_RATE,
    FaultKind.MOMENTUM_OFF: Outcome.WRONG,
    FaultKind.OFF: Outcome.WRONG,
}
# What these cost is in the error, and may be little.
_BY_ERROR = (Outcome.OFF_RATE, Outcome.WRONG)


def _largest_error(record: Mapping[str, Any]) -> float | None:
    """Return the larger of path error and momentum error; None where the run has none."""
    errors = [record.get(name) for name in ("path_error", "momentum_error")]
    known = [error for error in errors if error is not None]
    return max(known) if len(known) == len(errors) else None


def classify(faults: Sequence[Fault], error: float | None) -> Outcome:
    """Return the outcome of a run with these faults, the earliest first, and this error.

    The error is None where the run broke off. One that goes on is called by its first fault, from
    which the others follow: a ball that slips may well lose its contact later.
    """
    kinds = [_OF_KIND.get(fault.kind, Outcome.DIVERGED) for fault in faults]
    if Outcome.DIVERGED in kinds or (error is None and Outcome.UNFINISHED not in kinds):
        return Outcome.DIVERGED
    if error is None:
        return Outcome.UNFINISHED
    grave = [kind for kind in kinds if kind not in _BY_ERROR]
    if error > WRONG:
        # Silently wrong is what has no other name: a run that slipped or lost a rate says so.
        first = [kind for kind in kinds if kind is not Outcome.WRONG]
        return first[0] if first else Outcome.WRONG
    if grave:
        return grave[0]
    return Outcome.ACCURATE if error <= ACCURATE else Outcome.DEGRADED


_DURATION = 3.0  # s, on maps that do not vary it: a few turns of the ball
_TURNING = 200.0  # rad: no cell that turns fast needs more to show its error
_LEAST_STEPS = 50  # at least, for an instability to grow in
_MOST_SAMPLES = 100  # at most, at which the two motions are compared
_AMPLE = 3.0  # times the motion's demand


def measure_cell(cell: Mapping[str, Any]) -> dict[str, Any]:
    """Return the record of a cell {map, rolling, integrator, x, y}; no input makes it raise.

    outcome: an Outcome's name; path_error, momentum_error: relative, gamma_error: rad, None where
    the run broke off; faults: of the run; foretold: the limits that the precheck finds exceeded;
    nearness: how much of each limit is used, None without end; seconds: CPU time.
    """
    began = time.process_time()
    # In a process of its own nothing else keeps MuJoCo and NumPy quiet about what is recorded.
    logging.getLogger("absl").setLevel(logging.ERROR)
    chosen, place = MAPS[cell["map"]], (cell[key] for key in ("rolling", "integrator", "x", "y"))
    with warnings.catch_warnings(action="ignore"), np.errstate(all="ignore"):
        try:
            scene, settings = cell_run(chosen, *place)
            times = _sample_times(scene, settings, cell["y"] if chosen.lasting else None)
            record = _measured(scene, settings, times, chosen.ample)
        except InputError as error:
            record = {"outcome": Outcome.REFUSED.name, "refusal": str(error)}
    return {**record, "seconds": time.process_time() - began}


def _measured(scene: Scene, settings: Settings, times: Array, ample: bool) -> dict[str, Any]:
    theory = compiled_motion(scene, times)
    if ample:  # on a map that does not vary friction, slip would hide what its axes do
        settings = _ample(settings, theory)
    motion = run(build(scene, settings), times)
    agreement = Agreement(theory, motion)
    # By the loads of the whole motion, so that a law is judged and not the loads it was given.
    plan = PlannedRun(scene, settings, float(times[-1]), theory.loads)
    names = ("path_error", "momentum_error", "gamma_error")
    errors = {name: known(getattr(agreement, name)) for name in names}
    return {
        "outcome": classify(motion.report.faults, _largest_error(errors)).name,
        **errors,
        "faults": [str(fault) for fault in motion.report.faults],
        # What a user reads before the run, who does not know the motion yet.
        "foretold": [*exceeded(scene, settings, times)],
        "nearness": {name: known(check.nearness) for name, check in limit_checks(plan).items()},
        "steps": motion.report.steps,
    }


def _speed_scale(scene: Scene) -> float:
    """Estimate how fast the ball turns: A(|M| + |K|) + |Ω| [rad/s]."""
    numbers = scene.parameters
    size = np.linalg.norm(scene.start.momentum) + np.linalg.norm(numbers.K)
    return float(max(numbers.A) * size + np.linalg.norm(numbers.Omega))


def _sample_times(scene: Scene, settings: Settings, duration: float | None) -> Array:
    """Return the times (n,) of a cell, whole timesteps apart [s].

    They cover a few turns of the ball, unless the cell has a duration, and enough steps of a fixed
    length.
    """
    step = settings.timestep or TIMESTEP
    if duration is None:
        duration = _TURNING / max(_speed_scale(scene), _TURNING / _DURATION)
        if not settings.adaptive:
            duration = max(duration, _LEAST_STEPS * step)
    interval = step * max(1.0, np.ceil(duration / step / _MOST_SAMPLES))
    if settings.adaptive:
        interval = duration / _MOST_SAMPLES
    return interval * np.arange(max(2, round(duration / interval) + 1))


def _ample(settings: Settings, theory: Motion) -> Settings:
    """Return the settings with friction _AMPLE times the motion's demand, where it is less."""
    chosen, loads = Resolved(theory.scene, settings), theory.loads
    slide, spin, _ = chosen.friction
    return replace(
        chosen.settings,
        sliding_friction=max(slide, _AMPLE * loads.sliding_friction.max()),
        torsional_friction=max(spin, _AMPLE * loads.torsional_friction.max()),
    )


# Beyond these a step makes the state grow, and a run soon has none.
_STABILITY = ("rotation", "friction_damping", "contact_spring", "servo_gain")


def _outcome_of(result: Result) -> Outcome:
    """Return the outcome of a cell, also of one that the sweep had to give up."""
    if result.record is not None:
        return Outcome[result.record["outcome"]]
    return Outcome.UNFINISHED if result.outlasted else Outcome.FAILED


def _foretold(result: Result) -> bool:
    """Return whether the precheck warned of the run."""
    return bool(result.record and result.record.get("foretold"))


def _noticed(result: Result) -> bool:
    """Return whether the monitor found a fault during the run."""
    return bool(result.record and result.record.get("faults"))


def _error_of(result: Result) -> float | None:
    """Return the larger of path error and momentum error; None where there is none."""
    return _largest_error(result.record or {})


def missed(result: Result) -> bool:
    """Return whether a run is wrong, and neither the precheck nor the monitor said so."""
    error = _error_of(result)
    return error is not None and error > WRONG and not (_foretold(result) or _noticed(result))


def _is_wrong(error: float | None) -> bool:
    """Return whether a run is off by more than a tenth, or has no error, as it broke off."""
    return error is None or error > WRONG


def _is_accurate(error: float | None) -> bool:
    return error is not None and error <= ACCURATE


def measured_limits(results: Sequence[Result]) -> Iterator[dict[str, Any]]:
    """Yield the limits that some of the cells are beyond, predicted and as those cells show them.

    kept: the farthest that a run went without breaking; broken: the nearest at which one broke and
    no other limit was nearer, None where there is none; both in parts of the predicted limit, which
    is right where both are 1. cells: how many are beyond it.

    What breaks beyond a limit of stability is the state: the run diverges or the ball jumps off.
    Beyond any other it is the tolerance that the run was held to.
    """
    known = [(each, _nearness(each)) for each in results if each.record]
    for name in dict.fromkeys(name for _, nearness in known for name in nearness):
        mine = [(each, nearness) for each, nearness in known if name in nearness]
        beyond = sum(nearness[name] > 1 for _, nearness in mine)
        if not beyond:
            continue
        stability = name in _STABILITY
        broke = _blew_up if stability else _broke
        kept, broken = [0.0], []
        for each, nearness in mine:
            if not broke(each):
                kept.append(nearness[name])
            elif nearness[name] == _nearest(nearness, stability):
                broken.append(nearness[name])
        least = min(broken, default=None)
        yield {"name": name, "kept": max(kept), "broken": least, "cells": beyond}


def _nearest(nearness: Mapping[str, float], stability: bool) -> float:
    return max(value for name, value in nearness.items() if not stability or name in _STABILITY)


def _blew_up(result: Result) -> bool:
    return _outcome_of(result) in (Outcome.DIVERGED, Outcome.LOST_CONTACT)


def _broke(result: Result) -> bool:
    error = _error_of(result)
    return error is None or error > ERROR_TOLERANCE or _noticed(result)


def _nearness(result: Result) -> dict[str, float]:
    """Return how much of each limit is used; of a refused cell none."""
    numbers = (result.record or {}).get("nearness", {})
    return {name: np.inf if value is None else value for name, value in numbers.items()}


def summary(found: Mapping[str, Sequence[Result]]) -> list[dict[str, Any]]:
    """Return a record for each map and integrator: outcomes, missed runs, and limits."""
    records = []
    for name, results in found.items():
        for integrator in dict.fromkeys(each.cell["integrator"] for each in results):
            mine = [each for each in results if each.cell["integrator"] == integrator]
            counts = Counter(map(_outcome_of, mine))
            records.append(
                {
                    "map": name,
                    "integrator": integrator,
                    "cells": len(mine),
                    "outcomes": {kind.name: counts[kind] for kind in Outcome},
                    "missed": sum(map(missed, mine)),
                    "limits": list(measured_limits(mine)),
                }
            )
    return records


def totals(results: Sequence[Result]) -> dict[str, int]:
    """Count the wrong runs, by who reported them, and the accurate ones that raised an alarm.

    wrong: off by more than a tenth, or broken off, if by a limit of steps; reported_by_engine:
    those of them that ended in a state which is no number; alarms: accurate, but warned of or
    noticed.
    """
    ran = [(each, _error_of(each)) for each in results if _outcome_of(each) is not Outcome.REFUSED]
    wrong = [each for each, error in ran if _is_wrong(error)]
    accurate = [each for each, error in ran if _is_accurate(error)]
    return {
        "runs": len(results),
        "wrong": len(wrong),
        "reported_by_engine": sum(_outcome_of(each) is Outcome.DIVERGED for each in wrong),
        "foretold": sum(map(_foretold, wrong)),
        "noticed": sum(map(_noticed, wrong)),
        "missed": sum(not (_foretold(each) or _noticed(each)) for each in wrong),
        "accurate": len(accurate),
        "alarms": sum(_foretold(each) or _noticed(each) for each in accurate),
    }


def _shown(records: Sequence[Row]) -> Iterator[Table | str]:
    """Yield how many cells have which outcome, then the limits as predicted and as measured."""
    yield table_of(_OUTCOME_COLUMNS, records)
    yield from (f"  {kind.word[:3]}  {kind.sentence}" for kind in Outcome)
    yield "  missed: wrong, with neither a warning before the run nor a fault in it\n"
    limits = [{**each, **limit} for each in records for limit in each["limits"]]
    yield table_of(_LIMIT_COLUMNS, limits)
    yield "kept up to, broken from: in parts of the predicted limit; beyond: cells past it"


def _count(kind: Outcome) -> Column:
    return Column(kind.word[:3], lambda row: str(row["outcomes"][kind.name] or ""))


def _part_column(header: str, key: str) -> Column:
    return Column(header, lambda row: f"{row[key]:.2g}" if row[key] else "-")


_PLACE = tuple(Column(name, name, words=True) for name in ("map", "integrator"))
_OUTCOME_COLUMNS = (
    *_PLACE,
    *map(_count, Outcome),
    Column("missed", lambda row: str(row["missed"] or "")),
)
_LIMIT_COLUMNS = (
    *_PLACE,
    Column("predicted limit", "name", words=True),
    _part_column("kept up to", "kept"),
    _part_column("broken from", "broken"),
    Column("beyond", "cells", form="d"),
)


_WIDE, _PANEL, _LINE = 7.6, 3.0, 0.19  # inches: the picture; a panel's height; a legend's line
_TICKS = 4  # at most, on an axis
_ACROSS, _FEW = 3, 4  # panels side by side at most, and two of as few: letters are to be read
_LIMIT_LINES = [
    (colour, dashes)
    for dashes in ("-", (0, (5, 2)), (0, (1.2, 1.2)), (0, (5, 1.5, 1, 1.5)))
    for colour in (ACCENT, LABEL.colour, INK)
]
_LETTER = 0.03  # of a panel's width
_WORD: dict[str, Any] = {
    "size": 8, "color": INK, "ha": "center", "va": "center", "path_effects": halo(2.5), "zorder": 5,
}  # fmt: skip
_MARKS = {
    "wrong, neither warned of nor noticed": ("o", 10, "none"),
    "wrong, noticed only during the run": (".", 7, INK),
    "accurate, yet warned of or reported": ("+", 6, INK),
}


def _map_picture(name: str, results: Sequence[Result]) -> Figure:
    """Draw the panels of a map, rolling models below each other, and equal panels once."""
    of = MAPS[name]
    runs: dict[tuple[str, str], list[Result]] = {}
    for each in results:
        runs.setdefault((each.cell["rolling"], each.cell["integrator"]), []).append(each)
    exceeded = _exceeded(runs.values())
    # A map may have more limits than there are lines, which then begin again.
    styles = dict(zip(exceeded, cycle(_LIMIT_LINES), strict=False))
    panels: dict[str, dict[Any, list[list[Result]]]] = {}
    for (rolling, _), some in runs.items():
        panels.setdefault(rolling, {}).setdefault(_seen(some, exceeded), []).append(some)
    most = max(map(len, panels.values()))
    across = min(most, _ACROSS if most > _FEW else 2)
    # Each rolling model begins a row.
    places = [
        place for alike in panels.values()
        for place in [*alike.values(), *[[]] * (-len(alike) % across)]
    ]  # fmt: skip
    rows = len(places) // across
    height = _PANEL * rows + _LINE * (len(exceeded) + len(Outcome))
    figure = Figure(figsize=(_WIDE, height), layout="constrained")
    for i, (axes, alike) in enumerate(
        zip(figure.subplots(rows, across, squeeze=False).flat, places, strict=True)
    ):
        if not alike:
            axes.set_axis_off()
            continue
        _panel(axes, alike[0], styles)
        cells = [some[0].cell for some in alike]
        names = ", ".join(cell["integrator"] for cell in cells)
        axes.set_title(f"{names}: {cells[0]['rolling']}", size=9.5)
        axes.set_xlabel(of.x_of(cells[0]["integrator"]).label, size=9)
        if i % across == 0:
            axes.set_ylabel(of.y.label, size=9)
        else:
            axes.set_yticklabels([])
    _legends(figure, of, styles, results)
    return figure


def _seen(results: Sequence[Result], exceeded: Sequence[str]) -> Any:
    """Return all that a panel shows of its cells: outcomes, marks and the sides of the limits."""
    sides = [tuple(_nearness(each).get(name, np.nan) > 1 for name in exceeded) for each in results]
    places = [(each.cell["x"], each.cell["y"]) for each in results]
    return tuple(zip(places, map(_outcome_of, results), map(_marks, results), sides, strict=True))


def _exceeded(panels: Iterable[Sequence[Result]]) -> list[str]:
    """Return the limits with cells on both sides in some panel, so that a line can be drawn."""
    numbers = [list(map(_nearness, panel)) for panel in panels]

    def drawn(name: str) -> bool:
        return any(len({of[name] > 1 for of in panel if name in of}) == 2 for panel in numbers)

    return list(filter(drawn, LAWS))


def _panel(axes: Axes, results: Sequence[Result], styles: Mapping[str, Any]) -> None:
    xs, ys = (sorted({each.cell[key] for each in results}) for key in ("x", "y"))
    # Cells come row by row, in the order of the axes.
    shape, outcomes = (len(ys), len(xs)), [*map(_outcome_of, results)]
    # Even steps for values that are decades apart, so that each cell is seen.
    draw_cells(axes, range(len(xs)), range(len(ys)), [each.look for each in outcomes])
    for (j, i), each in zip(np.ndindex(shape), results, strict=True):
        for words in _marks(each):
            axes.add_line(_mark(words, i, j))
    numbers = [*map(_nearness, results)]
    for name, style in styles.items():
        # Where a law does not apply, and where a cell has no result, there is no line.
        grid = np.reshape([each.get(name, np.nan) for each in numbers], shape)
        # No contour passes beside an infinite value; far off only the side counts.
        _draw_limit(axes, np.log10(np.clip(grid, 1e-6, 1e6)), *style)
    _name_regions(axes, np.array(outcomes).reshape(shape))
    axes.set(xlim=(-0.5, len(xs) - 0.5), ylim=(-0.5, len(ys) - 0.5))
    for axis, values in ((axes.xaxis, xs), (axes.yaxis, ys)):
        axis.set_ticks(*round_ticks(values), size=8.5)


def _marks(result: Result) -> tuple[str, ...]:
    """Return the words of the marks on a cell."""
    error, warned, noticed = _error_of(result), _foretold(result), _noticed(result)
    shown = (
        missed(result),
        _is_wrong(error) and noticed and not warned,
        _is_accurate(error) and (noticed or warned),
    )
    return tuple(compress(_MARKS, shown))


def _mark(words: str, x: float = np.nan, y: float = np.nan) -> Line2D:
    marker, size, fill = _MARKS[words]
    style: dict[str, Any] = {"marker": marker, "ms": size, "mfc": fill, "color": INK, "ls": ""}
    return Line2D([x], [y], label=words, path_effects=halo(1.5), **style)


def _name_regions(axes: Axes, outcomes: Array) -> None:
    """Write the word of each outcome (y, x) into the longest row of its cells, if it has room."""
    longest: dict[Outcome, tuple[int, int, float]] = {}
    for j, row in enumerate(outcomes):
        for kind, cells in groupby(range(len(row)), row.__getitem__):
            run = [*cells]
            longest[kind] = max(longest.get(kind, (0, 0, 0.0)), (len(run), -j, sum(run) / len(run)))
    for kind, (size, j, i) in longest.items():
        if size > _LETTER * len(kind.word) * outcomes.shape[1]:
            axes.text(i, -j, kind.word, **_WORD)


def _draw_limit(axes: Axes, nearness: Array, colour: str, dashes: Any) -> None:
    inside = nearness[np.isfinite(nearness)]
    if not len(inside) or not inside.min() < 0 < inside.max():
        return
    # Half a cell on, to the borders, by the slope between the last two cells, if that makes no line
    # which no two cells show.
    edge = np.pad(nearness, 1, mode="edge")
    onward = (np.pad(nearness, 1, mode="reflect", reflect_type="odd") + edge) / 2
    grid = np.ma.masked_invalid(np.where(onward * edge > 0, onward, edge))
    rows, columns = (np.array([-0.5, *range(n), n - 0.5]) for n in nearness.shape)
    draw_level(axes, columns, rows, grid, colour, dashes=dashes, rim=3.2)


def round_ticks(values: Sequence[float]) -> tuple[list[float], list[str]]:
    """Return places among the cells of these values, and labels, at powers of ten: _TICKS at most.

    A power need be no cell's own value. Where fewer than two lie in the range, some cells' values.
    """
    least = values[0]
    if least > 0:
        logs = np.log10(values)
        decades = np.arange(np.ceil(logs[0] - 1e-9), np.floor(logs[-1] + 1e-9) + 1)
        decades = decades[:: max(1, -(-len(decades) // _TICKS))]
        if len(decades) > 1:
            places = np.interp(decades, logs, np.arange(len(values))).tolist()
            return places, [f"$10^{{{decade:.0f}}}$" for decade in decades]
    cells = range(0, len(values), max(1, -(-(len(values) - 1) // (_TICKS - 1))))
    return [float(cell) for cell in cells], [f"{values[cell]:.2g}" for cell in cells]


def _finding(results: Sequence[Result]) -> str:
    """Return who is accurate in how many of a map's runs, and how many wrong ones are missed."""
    runs, good = Counter[str](), Counter[str]()
    for each in results:
        runs[each.cell["integrator"]] += 1
        good[each.cell["integrator"]] += _outcome_of(each) is Outcome.ACCURATE
    parts = [f"{name} {n / runs[name]:.0%}" for name, n in good.most_common() if n]
    parts += ["others none" if parts else "none"] * (len(parts) < len(runs))
    unseen = sum(map(missed, results)) or "none"
    return f"Accurate runs: {', '.join(parts)}; wrong without a warning or a fault: {unseen}"


def _sentence(limit: Row) -> str:
    """Return the law, and what was measured of it."""
    law = (LAWS[limit["name"]].__doc__ or "").partition("\n")[0].rstrip(".")
    words = f"{law}: runs hold to {limit['kept']:.2g} times it"
    return words if limit["broken"] is None else f"{words}, break from {limit['broken']:.2g}"


def _legends(figure: Figure, of: Map, styles: Mapping[str, Any], results: Sequence[Result]) -> None:
    """Write the title and the meaning of the lines above, that of cells and dots below."""
    measured = {each["name"]: each for each in measured_limits(results)}
    limits = [
        Line2D([], [], color=colour, linestyle=dashes, label=_sentence(measured[name]))
        for name, (colour, dashes) in styles.items()
    ]
    found = [*map(_outcome_of, results)]
    outcomes = [Patch(label=each.sentence, **each.look) for each in Outcome if each in found]
    heading = f"{_finding(results)}\n{of.title}\nheld: {of.held}"
    if limits:
        heading += f"\nlines: limits predicted for an error of {ERROR_TOLERANCE:g}, and as measured"
    shared: dict[str, Any] = {"frameon": False, "fontsize": 8}
    # Its title is the picture's: a legend outside the panels would lie on a title of the figure.
    figure.legend(
        handles=limits, loc="outside upper left", title=heading, alignment="left", **shared,
    )  # fmt: skip
    meaning = [*outcomes, *map(_mark, _MARKS)]
    figure.legend(handles=meaning, loc="outside lower left", ncols=2, **shared)


def map_extremes(names: Sequence[str], sweep: Sweep) -> int:
    """Run the named maps, all without names, and present them; return the exit status."""
    maps = chosen("map", names, MAPS)
    cut = QUICK if sweep.quick else WHOLE
    found = {
        each.name: sweep.results(measure_cell, cells_of(each, cut), "extremes", each.limit)
        for each in maps
    }
    records = summary(found)
    show(_shown(records))
    for name, results in found.items():
        picture = _map_picture(name, results)
        sweep.present(Study("extremes", None, [name], rows_of(results), picture=picture))
    all_maps = totals([each for results in found.values() for each in results])
    record = {"quick": sweep.quick, "totals": all_maps, "summary": records}
    write_record(sweep.json, record)
    return DISAGREES if any(each["missed"] for each in records) else AGREES
