"""The atlas: every cell of the maps swept, and what they say together."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robotball.settings import ADAPTIVE
from validation.commands.arguments import Sweep
from validation.extremes.cell import measure
from validation.extremes.maps import INTEGRATORS, PROMISE, Axis, Map
from validation.extremes.outcome import WRONG, Outcome
from validation.runs import Show
from validation.sweeps import Cell, Result, sweep

QUICK_INTEGRATORS = ("Euler", "RK4", ADAPTIVE)
QUICK_COUNT = 3  # values of an axis
QUICK_DURATION = 100.0  # s, at most


@dataclass(frozen=True)
class Cut:
    """How much of the maps to run: all integrators and values, or a few."""

    integrators: tuple[str, ...] = INTEGRATORS
    count: int | None = None

    def values(self, axis: Axis) -> tuple[float, ...]:
        """Those of the axis that are in the cut, its ends among them."""
        values = axis.values
        if self.count is None or self.count >= len(values):
            return values
        if "duration" in axis.label:
            values = tuple(v for v in values if v <= QUICK_DURATION)
        chosen = np.linspace(0, len(values) - 1, self.count).round().astype(int)
        return tuple(values[i] for i in np.unique(chosen))


WHOLE, QUICK = Cut(), Cut(QUICK_INTEGRATORS, QUICK_COUNT)


def cells_of(chosen: Map, cut: Cut = WHOLE) -> list[Cell]:
    """The cells of a map; those of one ball follow each other."""
    return [
        {"map": chosen.name, "rolling": rolling, "integrator": integrator, "x": x, "y": y}
        for rolling in chosen.rollings
        for integrator in cut.integrators
        for y in cut.values(chosen.y)
        for x in cut.values(chosen.x_of(integrator))
    ]


def survey(
    maps: Sequence[Map], cut: Cut, file: Path, options: Sweep, show: Show
) -> dict[str, list[Result]]:
    """The results of the maps' cells by the map's name; `file` keeps them for another time."""
    results: dict[str, list[Result]] = {}
    done = 0
    for each in maps:
        cells = cells_of(each, cut)
        results[each.name] = sweep(
            measure,
            cells,
            file,
            workers=options.workers,
            cluster=options.cluster,
            limit=each.limit,
            show=lambda part, words, done=done, name=each.name: show(  # type: ignore[misc]
                done + part, f"{name}: {words}"
            ),
        )
        done += len(cells)
    return results


def outcome_of(result: Result) -> Outcome:
    """The outcome of a cell, also of one that the sweep had to give up."""
    if result.record is not None:
        return Outcome[result.record["outcome"]]
    assert result.failure is not None
    return Outcome.UNFINISHED if "took longer" in result.failure else Outcome.FAILED


def foretold(result: Result) -> bool:
    """Whether the check before the run warned of it."""
    return bool(result.record and result.record.get("foretold"))


def noticed(result: Result) -> bool:
    """Whether the watch found a fault during the run."""
    return bool(result.record and result.record.get("faults"))


def error_of(result: Result) -> float | None:
    """The larger of path error and drift of M, relative; None where there is none."""
    record = result.record or {}
    path, drift = record.get("path_error"), record.get("momentum_drift")
    return None if path is None or drift is None else max(path, drift)


def missed(result: Result) -> bool:
    """Whether a run is wrong, and neither the check nor the watch said so."""
    error = error_of(result)
    return error is not None and error > WRONG and not (foretold(result) or noticed(result))


def tally(results: Iterable[Result]) -> Counter[Outcome]:
    """How many cells have each outcome."""
    return Counter(map(outcome_of, results))


@dataclass(frozen=True)
class Measured:
    """A predicted edge beside the measured one, both in parts of the predicted limit.

    kept: the farthest that a run went and still kept its promise; broken: the nearest at which one
    did not and no other edge was nearer. A prediction is right where both are 1; 0 for none.
    """

    edge: str
    kept: float
    broken: float | None
    cells: int


def measured_edges(results: Sequence[Result]) -> Iterator[Measured]:
    """The edges that some of the cells are beyond, as those cells tell."""
    known = [each for each in results if each.record and "nearness" in each.record]
    names = dict.fromkeys(name for each in known for name in _nearness(each))
    for name in names:
        beyond = [each for each in known if _nearness(each).get(name, 0.0) > 1]
        if not beyond:
            continue
        kept = [_nearness(each)[name] for each in known if _keeps(each) and name in _nearness(each)]
        broken = [
            near[name]
            for each in known
            if not _keeps(each)
            and name in (near := _nearness(each))
            and near[name] == max(near.values())
        ]
        yield Measured(name, max(kept, default=0.0), min(broken, default=None), len(beyond))


def _nearness(result: Result) -> dict[str, float]:
    assert result.record is not None
    return {
        name: np.inf if value is None else value
        for name, value in result.record["nearness"].items()
    }


def _keeps(result: Result) -> bool:
    """Whether the run has no fault and an error within the promise that it was held to."""
    error = error_of(result)
    return error is not None and error <= PROMISE and not noticed(result)
