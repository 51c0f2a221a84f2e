"""What became of a cell's run: one of a few outcomes, by the faults and the true error."""

from collections.abc import Sequence
from enum import Enum

from robotball import Fault

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

    @property
    def sound(self) -> bool:
        """Whether the run is a result."""
        return self in (Outcome.ACCURATE, Outcome.DEGRADED)


# The worst first: a run that lost its contact has mostly slipped before.
BY_FAULT = (
    ("max_steps", Outcome.UNFINISHED),
    ("contact lost", Outcome.LOST_CONTACT),
    ("friction cone saturated", Outcome.SLIPPED),
    ("slipped over", Outcome.SLIPPED),
)
# What these cost is in the error.
BY_ERROR = ("hinge rate off", "torque limit", "M off")


def classify(faults: Sequence[Fault], error: float | None) -> Outcome:
    """The outcome of a run with these faults and this error; None where it broke off."""
    causes = [fault.cause for fault in faults]
    by_fault = [outcome for words, outcome in BY_FAULT if any(words in cause for cause in causes)]
    known = (*BY_ERROR, *(words for words, _ in BY_FAULT))
    unknown = [cause for cause in causes if not any(words in cause for words in known)]
    if unknown or (error is None and Outcome.UNFINISHED not in by_fault):
        return Outcome.DIVERGED
    if by_fault:
        return by_fault[0]
    assert error is not None
    if error <= ACCURATE:
        return Outcome.ACCURATE
    if error <= WRONG:
        return Outcome.DEGRADED
    off_rate = any(not cause.startswith("M off") for cause in causes)
    return Outcome.OFF_RATE if off_rate else Outcome.WRONG
