"""What cells say together: outcomes, what the guard missed, and where the edges are."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from validation.studies.extremes.maps import PROMISE
from validation.studies.extremes.outcome import WRONG, Outcome, largest_error
from validation.sweeps import Result

# Beyond these a step makes the state grow, and a run soon has none.
STABILITY = ("rotation", "friction_damping", "contact_spring", "servo_gain")


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
    return largest_error(result.record or {})


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

    kept: the farthest that a run went without breaking; broken: the nearest at which one broke and
    no other edge was nearer, None where there is none. A prediction is right where both are 1.
    cells: how many are beyond the edge.

    What breaks beyond an edge of stability is the state: the run diverges or the ball jumps off.
    Beyond any other it is the promise that the run was held to.
    """

    edge: str
    kept: float
    broken: float | None
    cells: int


def measured_edges(results: Sequence[Result]) -> Iterator[Measured]:
    """The edges that some of the cells are beyond, as those cells tell."""
    known = [(each, _nearness(each)) for each in results if each.record]
    for name in dict.fromkeys(name for _, nearness in known for name in nearness):
        beyond = sum(nearness.get(name, 0.0) > 1 for _, nearness in known)
        if not beyond:
            continue
        stability = name in STABILITY
        broke = _blew_up if stability else _broke
        mine = [(each, nearness) for each, nearness in known if name in nearness]
        kept = [nearness[name] for each, nearness in mine if not broke(each)]
        broken = [
            nearness[name]
            for each, nearness in mine
            if broke(each) and nearness[name] == _nearest(nearness, stability)
        ]
        yield Measured(name, max(kept, default=0.0), min(broken, default=None), beyond)


def _nearest(nearness: Mapping[str, float], stability: bool) -> float:
    return max(value for name, value in nearness.items() if not stability or name in STABILITY)


def _blew_up(result: Result) -> bool:
    return outcome_of(result) in (Outcome.DIVERGED, Outcome.LOST_CONTACT)


def _broke(result: Result) -> bool:
    error = error_of(result)
    return error is None or error > PROMISE or noticed(result)


def _nearness(result: Result) -> dict[str, float]:
    """How much of each edge is used; of a refused cell none."""
    numbers = (result.record or {}).get("nearness", {})
    return {name: np.inf if value is None else value for name, value in numbers.items()}
