"""What became of a cell's run: one of a few outcomes, by the faults and the true error."""

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any

from robotball import Fault, FaultKind

ACCURATE = 1e-4  # largest error of an accurate run, relative; the recipe's coarsest keeps 1e-6
WRONG = 0.1  # an error above it is no result at all


class Outcome(Enum):
    """What a reader sees of a cell: its sign on the map, and the sentence that explains it."""

    ACCURATE = ("", f"accurate: error at most {ACCURATE:g}")
    DEGRADED = ("·", f"degraded: error at most {WRONG:g}")
    WRONG = ("X", f"silently wrong: error above {WRONG:g}, contact and drives as they should be")
    SLIPPED = ("s", "slipped: friction cone saturated, or slip along the path")
    LOST_CONTACT = ("c", "lost contact")
    OFF_RATE = ("r", "a drive lost its rate")
    DIVERGED = ("D", "diverged and reported")
    REFUSED = ("–", "refused before the run, with one line")
    UNFINISHED = ("?", "stopped at its limit of steps or time")
    FAILED = ("!", "ended in an error that nobody had foreseen")

    def __init__(self, sign: str, sentence: str) -> None:
        self.sign = sign
        self.sentence = sentence


# Any other kind of fault leaves no state.
OF_KIND = {
    FaultKind.OUT_OF_STEPS: Outcome.UNFINISHED,
    FaultKind.CONTACT_LOST: Outcome.LOST_CONTACT,
    FaultKind.CONE_SATURATED: Outcome.SLIPPED,
    FaultKind.SLIPPED: Outcome.SLIPPED,
    FaultKind.RATE_OFF: Outcome.OFF_RATE,
    FaultKind.TORQUE_LIMIT: Outcome.OFF_RATE,
    FaultKind.MOMENTUM_OFF: Outcome.WRONG,
}
# What these cost is in the error, and may be little.
BY_ERROR = (Outcome.OFF_RATE, Outcome.WRONG)


def largest_error(record: Mapping[str, Any]) -> float | None:
    """The larger of path error and momentum error; None where the run has none."""
    errors = [record.get(name) for name in ("path_error", "momentum_error")]
    known = [error for error in errors if error is not None]
    return max(known) if len(known) == len(errors) else None


def classify(faults: Sequence[Fault], error: float | None) -> Outcome:
    """The outcome of a run with these faults, the earliest first, and this error.

    The error is None where the run broke off. One that goes on is called by its first fault, from
    which the others follow: a ball that slips may well lose its contact later.
    """
    kinds = [OF_KIND.get(fault.kind, Outcome.DIVERGED) for fault in faults]
    if Outcome.DIVERGED in kinds or (error is None and Outcome.UNFINISHED not in kinds):
        return Outcome.DIVERGED
    if error is None:
        return Outcome.UNFINISHED
    grave = [kind for kind in kinds if kind not in BY_ERROR]
    if error > WRONG:
        first = [kind for kind in kinds if kind is not Outcome.WRONG]
        return first[0] if first else Outcome.WRONG
    if grave:
        return grave[0]
    return Outcome.ACCURATE if error <= ACCURATE else Outcome.DEGRADED
