"""Failure maps of the contact model: run each cell and compare it with the equations.

The results count the outcomes and the missed failures, and locate the limits. The picture of a map
has one panel per rolling model and integrator. `extreme_maps.py` defines the maps.
"""

import logging
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from enum import Enum
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from rich.table import Table

from robotball import Fault, FaultKind, InputError, Motion, Scene, Settings
from robotball.engines.mujoco import limits, special_limits
from robotball.engines.mujoco.limits import PlannedRun
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import exceeded, limit_checks, run
from robotball.engines.mujoco.settings import Resolved
from robotball.robot.looks import INK
from robotball.rotations import Array

from ..agreement import Agreement
from ..options import AGREES, DISAGREES, Sweep, chosen
from ..output import halo, known, panels, write_record
from ..study import Column, Row, Study, compiled_motion, show, table_of
from ..sweeps import Result, rows_of
from .extreme_maps import (
    ERROR_TOLERANCE,
    MAPS,
    QUICK,
    TIMESTEP,
    WHOLE,
    cell_run,
    cells_of,
)

ACCURATE = 1e-4  # largest relative error of an accurate run; the recipe's coarsest step has 1e-6
WRONG = 0.1  # relative error above which a run is wrong
_DURATION = 3.0  # s, a few turns of the ball, if the map does not vary the duration
_TURNING = 200.0  # rad; a fast ball shows its error within this angle
_LEAST_STEPS = 50  # steps, enough for an instability to grow
_MOST_SAMPLES = 100  # times at which the two motions are compared
_AMPLE = 3.0  # friction divided by the motion's need
# Limits of stability. Beyond these limits the state grows at every step until it overflows.
_STABILITY = ("rotation", "friction_damping", "contact_spring", "servo_gain")
_WIDE, _PANEL, _ABOVE = 9.0, 2.2, 1.5  # inches: picture width, panel height, title and legend
_TICKS = 4  # ticks of an axis at most
_ACROSS = 3  # panels in a row at most
LAWS = {law.__name__: law for law in (*limits.LAWS, *special_limits.LAWS)}


class Outcome(Enum):
    """The outcome of a cell, with its name in tables and a sentence."""

    ACCURATE = ("accurate", f"accurate: error at most {ACCURATE:g}")
    DEGRADED = ("degraded", f"degraded: error at most {WRONG:g}")
    WRONG = ("wrong", f"silently wrong: error above {WRONG:g}, contact and drives sound")
    SLIPPED = ("slipped", "slipped: friction cone saturated, or slip along the path")
    LOST_CONTACT = ("lost contact", "lost contact")
    OFF_RATE = ("off rate", "a drive lost its rate")
    DIVERGED = ("diverged", "diverged and reported")
    REFUSED = ("refused", "refused before the run, with one line")
    UNFINISHED = ("out of time", "stopped at its limit of steps or time")
    FAILED = ("failed", "ended in an unexpected error")

    def __init__(self, word: str, sentence: str) -> None:
        self.word, self.sentence = word, sentence


# All other kinds of fault leave no valid state.
_OF_KIND = {
    FaultKind.CONTACT_LOST: Outcome.LOST_CONTACT,
    FaultKind.CONE_SATURATED: Outcome.SLIPPED,
    FaultKind.SLIPPED: Outcome.SLIPPED,
    FaultKind.RATE_OFF: Outcome.OFF_RATE,
    FaultKind.TORQUE_LIMIT: Outcome.OFF_RATE,
    FaultKind.MOMENTUM_OFF: Outcome.WRONG,
    FaultKind.OFF: Outcome.WRONG,
}
# These outcomes may cost little accuracy, so the error decides.
_BY_ERROR = (Outcome.OFF_RATE, Outcome.WRONG)


def _largest_error(record: Mapping[str, Any]) -> float | None:
    """Return the larger of path error and momentum error; None if one of them is missing."""
    path, momentum = record.get("path_error"), record.get("momentum_error")
    return None if path is None or momentum is None else max(path, momentum)


def classify(faults: Sequence[Fault], error: float | None) -> Outcome:
    """Return the outcome of a run from its faults, the earliest first, and its error.

    The error is None if the run failed. Otherwise the first fault determines the outcome, because
    later faults may follow from it: a ball that slips may lose contact later.
    """
    kinds = [_OF_KIND.get(fault.kind, Outcome.DIVERGED) for fault in faults]
    if Outcome.DIVERGED in kinds or error is None:
        return Outcome.DIVERGED
    grave = [kind for kind in kinds if kind not in _BY_ERROR]
    if error > WRONG:
        # A run is silently wrong only if no other fault explains the error.
        first = [kind for kind in kinds if kind is not Outcome.WRONG]
        return first[0] if first else Outcome.WRONG
    if grave:
        return grave[0]
    return Outcome.ACCURATE if error <= ACCURATE else Outcome.DEGRADED


def measure_cell(cell: Mapping[str, Any]) -> dict[str, Any]:
    """Run a cell {map, rolling, integrator, x, y} and return its record; never raises.

    Keys of the record: `outcome`, the name of an Outcome; `path_error` and `momentum_error`,
    relative, and `gamma_error` [rad], None if the run failed; `faults`, the faults of the run;
    `foretold`, the limits that the precheck finds exceeded; `nearness`, each limited quantity
    divided by its limit, None if infinite; `seconds`, the processor time.
    """
    began = time.process_time()
    # The record contains the faults, so the worker process need not log MuJoCo's warnings.
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
    if ample:  # otherwise slip would hide the effect of the map's axes
        settings = _ample(settings, theory)
    motion = run(build(scene, settings), times)
    agreement = Agreement(theory, motion)
    # Use the loads of the whole motion, to test the limits and not an estimate of the loads.
    plan = PlannedRun(scene, settings, float(times[-1]), theory.loads)
    names = ("path_error", "momentum_error", "gamma_error")
    errors = {name: known(getattr(agreement, name)) for name in names}
    return {
        "outcome": classify(motion.report.faults, _largest_error(errors)).name,
        **errors,
        "faults": [str(fault) for fault in motion.report.faults],
        # The check that a user gets before a run, without the loads of the motion.
        "foretold": [*exceeded(scene, settings, times)],
        "nearness": {name: known(check.nearness) for name, check in limit_checks(plan).items()},
        "steps": motion.report.steps,
    }


def _speed_scale(scene: Scene) -> float:
    """Estimate the ball's angular velocity: A(|M| + |K|) + |Ω| [rad/s]."""
    numbers = scene.parameters
    size = np.linalg.norm(scene.start.momentum) + np.linalg.norm(numbers.K)
    return float(max(numbers.A) * size + np.linalg.norm(numbers.Omega))


def _sample_times(scene: Scene, settings: Settings, duration: float | None) -> Array:
    """Return the sample times (n,) of a cell, at multiples of its timestep [s].

    Without a duration, the times cover a few turns of the ball and at least _LEAST_STEPS steps.
    """
    step = settings.timestep or TIMESTEP
    if duration is None:
        duration = _TURNING / max(_speed_scale(scene), _TURNING / _DURATION)
        duration = max(duration, _LEAST_STEPS * step)
    interval = step * max(1.0, np.ceil(duration / step / _MOST_SAMPLES))
    return interval * np.arange(max(2, round(duration / interval) + 1))


def _ample(settings: Settings, theory: Motion) -> Settings:
    """Raise the friction to at least _AMPLE times the friction that the motion needs."""
    chosen, loads = Resolved(theory.scene, settings), theory.loads
    slide, spin, _ = chosen.friction
    return replace(
        chosen.settings,
        sliding_friction=max(slide, _AMPLE * loads.sliding_friction.max()),
        torsional_friction=max(spin, _AMPLE * loads.torsional_friction.max()),
    )


def _outcome_of(result: Result) -> Outcome:
    """Return the outcome of a cell, including cells without a record."""
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
    return _largest_error(result.record or {})


def missed(result: Result) -> bool:
    """Return whether a run is wrong without a warning from the precheck or a fault."""
    error = _error_of(result)
    return error is not None and error > WRONG and not (_foretold(result) or _noticed(result))


def measured_limits(results: Sequence[Result]) -> Iterator[dict[str, Any]]:
    """Yield each limit that some cells exceed: where it is predicted, and where runs break.

    `name` is the name of the limit. `kept` is the largest value of an unbroken run. `broken` is the
    smallest value of a broken run for which no other limit was nearer, or None. `cells` is the
    number of cells beyond the limit. Values are relative to the predicted limit; they are 1 if the
    prediction is exact.

    A run beyond a limit of stability is broken if it diverges or loses contact. A run beyond
    another limit is broken if its error exceeds the tolerance.
    """
    known = [(result, _nearness(result)) for result in results if result.record]
    for name in dict.fromkeys(name for _, nearness in known for name in nearness):
        limited = [(result, nearness) for result, nearness in known if name in nearness]
        beyond = sum(nearness[name] > 1 for _, nearness in limited)
        if not beyond:
            continue
        stability = name in _STABILITY
        broke = _blew_up if stability else _broke
        kept, broken = [0.0], []
        for result, nearness in limited:
            rivals = [it for law, it in nearness.items() if not stability or law in _STABILITY]
            if not broke(result):
                kept.append(nearness[name])
            elif nearness[name] == max(rivals):
                broken.append(nearness[name])
        least = min(broken, default=None)
        yield {"name": name, "kept": max(kept), "broken": least, "cells": beyond}


def _blew_up(result: Result) -> bool:
    return _outcome_of(result) in (Outcome.DIVERGED, Outcome.LOST_CONTACT)


def _broke(result: Result) -> bool:
    error = _error_of(result)
    return error is None or error > ERROR_TOLERANCE or _noticed(result)


def _nearness(result: Result) -> dict[str, float]:
    """Return each limited quantity divided by its limit; empty for a refused cell."""
    numbers = (result.record or {}).get("nearness", {})
    return {name: np.inf if value is None else value for name, value in numbers.items()}


def summary(maps: Mapping[str, Sequence[Result]]) -> list[dict[str, Any]]:
    """Return a record for each map and integrator: outcomes, missed runs, and limits."""
    groups: dict[tuple[str, str], list[Result]] = {}
    for name, results in maps.items():
        for result in results:
            groups.setdefault((name, result.cell["integrator"]), []).append(result)
    return [
        {
            "map": name,
            "integrator": integrator,
            "cells": len(results),
            "outcomes": {kind.name: [*map(_outcome_of, results)].count(kind) for kind in Outcome},
            "missed": sum(map(missed, results)),
            "limits": list(measured_limits(results)),
        }
        for (name, integrator), results in groups.items()
    ]


def totals(results: Sequence[Result]) -> dict[str, int]:
    """Count the wrong runs, by who reported them, and the accurate runs with a false alarm.

    A run is wrong if its error is above WRONG or if it failed. The engine itself reports a run that
    ended in a state that is not a number.
    """
    ran = [result for result in results if _outcome_of(result) is not Outcome.REFUSED]
    errors = [np.inf if (error := _error_of(result)) is None else error for result in ran]
    wrong = [result for result, error in zip(ran, errors, strict=True) if error > WRONG]
    accurate = [result for result, error in zip(ran, errors, strict=True) if error <= ACCURATE]
    return {
        "runs": len(results),
        "wrong": len(wrong),
        "reported_by_engine": sum(_outcome_of(result) is Outcome.DIVERGED for result in wrong),
        "foretold": sum(map(_foretold, wrong)),
        "noticed": sum(map(_noticed, wrong)),
        "missed": sum(not (_foretold(result) or _noticed(result)) for result in wrong),
        "accurate": len(accurate),
        "alarms": sum(_foretold(result) or _noticed(result) for result in accurate),
    }


def _shown(records: Sequence[Row]) -> Iterator[Table | str]:
    """Yield the table of outcomes and the table of limits, predicted and measured."""
    yield table_of(_OUTCOME_COLUMNS, records)
    yield from (f"  {kind.word[:3]}  {kind.sentence}" for kind in Outcome)
    yield "  missed: wrong without a warning before the run or a fault during it\n"
    limits = [{**record, **limit} for record in records for limit in record["limits"]]
    yield table_of(_LIMIT_COLUMNS, limits)
    yield "kept up to, broken from: relative to the predicted limit; beyond: cells past the limit"


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


# Colours that are distinct for colour-blind readers, and in grey.
_COLOURS = {
    f"right: error at most {ERROR_TOLERANCE:g}": "#A6D0EA",
    "wrong, with a fault": "#F0B040",
    "wrong, without a fault": "#9E1B1B",
}


def _map_picture(name: str, results: Sequence[Result]) -> Figure:
    """Draw a panel for each integrator and rolling model: which runs are right, and the limits."""
    chosen, codes = MAPS[name], np.array([*map(_colour_of, results)])
    integrators = [*dict.fromkeys(result.cell["integrator"] for result in results)]
    cells = codes.reshape(len({result.cell["rolling"] for result in results}), len(integrators), -1)
    right = dict(zip(integrators, (cells == 0).mean(axis=(0, 2)), strict=True))
    best, worst = max(right, key=right.__getitem__), min(right, key=right.__getitem__)
    silent, wrong = np.count_nonzero(codes == 2), np.count_nonzero(codes > 0)
    heading = (
        f"{name}: {best} is right in {right[best]:.0%} of runs, {worst} in {right[worst]:.0%}; "
        f"{silent} of {wrong} errors without a fault"
    )
    panels_of = np.array(results, dtype=object).reshape(-1, cells.shape[2])
    across = len(integrators) if len(integrators) % _ACROSS else _ACROSS
    rows = len(panels_of) // across
    size = _WIDE, _PANEL * rows + _ABOVE
    figure, grid = panels(heading, size, rows, across, squeeze=False, sharex=True, sharey=True)
    for axes, runs in zip(grid.flat, panels_of, strict=True):
        _panel(axes, runs.tolist())
    grid[-1, across // 2].set_xlabel(chosen.x.label, size="large")
    figure.supylabel(chosen.y.label)
    handles: list[Any] = [Patch(color=colour, label=label) for label, colour in _COLOURS.items()]
    handles.append(Patch(fc="white", ec=INK, label="refused or out of time"))
    handles.append(Line2D([], [], color=INK, lw=2, label="limit predicted by the laws"))
    legend: Any = {"title": f"held: {chosen.held}", "alignment": "left", "frameon": False}
    figure.legend(handles=handles, loc="outside lower left", ncols=3, **legend)
    return figure


def _colour_of(result: Result) -> float:
    """Return the number of a cell's colour, or NaN without a run."""
    if _outcome_of(result) in (Outcome.REFUSED, Outcome.UNFINISHED, Outcome.FAILED):
        return np.nan
    error = _error_of(result)
    wrong = error is None or error > ERROR_TOLERANCE
    return float(wrong + (wrong and not _noticed(result)))


def _panel(axes: Axes, results: Sequence[Result]) -> None:
    xs, ys = (sorted({result.cell[key] for result in results}) for key in ("x", "y"))
    shape, first = (len(ys), len(xs)), results[0].cell
    axes.grid(visible=False)
    codes = np.reshape([*map(_colour_of, results)], shape)
    colours: Any = {"cmap": ListedColormap([*_COLOURS.values()]), "vmin": -0.5, "vmax": 2.5}
    # Cells are in row order. Cells have equal sizes, although their values may be decades apart.
    axes.pcolormesh(codes, edgecolors="white", linewidth=0.5, **colours)
    nearest = [max(_nearness(result).values(), default=np.nan) for result in results]
    # Contours need finite values; far from a limit only the side matters.
    sides = np.pad(np.log10(np.clip(nearest, 1e-6, 1e6)).reshape(shape), 1, mode="edge")
    if np.nanmin(sides, initial=0.0) < 0 < np.nanmax(sides, initial=0.0):
        columns, rows = ([0, *(np.arange(n) + 0.5), n] for n in shape[::-1])
        lines = axes.contour(columns, rows, np.ma.masked_invalid(sides), [0.0], colors=[INK])
        lines.set(linewidth=2, path_effects=halo(3.5))
    axes.set_title(f"{first['integrator']}, {first['rolling']}", size=10.5)
    for axis, values in ((axes.xaxis, xs), (axes.yaxis, ys)):
        places, labels = round_ticks(values)
        axis.set_ticks(np.array(places) + 0.5, labels)


def round_ticks(values: Sequence[float]) -> tuple[list[float], list[str]]:
    """Return positions along a row of cells and labels: powers of ten, or values of some cells.

    Values of cells are used if fewer than two powers lie in their range. At most _TICKS ticks.
    """
    if values[0] > 0:
        logs = np.log10(values)
        decades = np.arange(np.ceil(logs[0] - 1e-9), np.floor(logs[-1] + 1e-9) + 1)
        decades = decades[:: max(1, -(-len(decades) // _TICKS))]
        if len(decades) > 1:
            places = np.interp(decades, logs, np.arange(len(values))).tolist()
            return places, [f"$10^{{{decade:.0f}}}$" for decade in decades]
    cells = range(0, len(values), max(1, -(-(len(values) - 1) // (_TICKS - 1))))
    return [float(cell) for cell in cells], [f"{values[cell]:.2g}" for cell in cells]


def map_extremes(names: Sequence[str], sweep: Sweep) -> int:
    """Run and present the named maps, or all if no name is given; return the exit status."""
    maps = chosen("map", names, MAPS)
    cut = QUICK if sweep.quick else WHOLE
    found = {
        failure_map.name: sweep.results(
            measure_cell, cells_of(failure_map, cut), "extremes", failure_map.limit
        )
        for failure_map in maps
    }
    records = summary(found)
    show(_shown(records))
    for name, results in found.items():
        picture = _map_picture(name, results)
        sweep.present(Study("extremes", None, [name], rows_of(results), picture=picture))
    all_maps = totals([result for results in found.values() for result in results])
    record = {"quick": sweep.quick, "totals": all_maps, "summary": records}
    write_record(sweep.json, record)
    return DISAGREES if any(record["missed"] for record in records) else AGREES
