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
    WRONG = ("X", f"silently wrong: error above {WRONG:g}, with no fault reported")
    SLIPPED = ("s", "slipped: the friction cone saturated")
    LOST_CONTACT = ("c", "lost contact")
    OFF_RATE = ("r", "a drive lost its rate")
    DIVERGED = ("D", "diverged and reported")
    REFUSED = ("–", "refused before the run, with one line")
    UNFINISHED = ("?", "stopped at its limit of time")

    def __init__(self, sign: str, sentence: str) -> None:
        self.sign = sign
        self.sentence = sentence

    @property
    def sound(self) -> bool:
        """Whether the run is a result."""
        return self in (Outcome.ACCURATE, Outcome.DEGRADED)


# The worst first: a run that diverged has mostly slipped and lost its contact before.
BY_FAULT = (
    ("contact lost", Outcome.LOST_CONTACT),
    ("friction cone saturated", Outcome.SLIPPED),
    ("hinge rate off", Outcome.OFF_RATE),
    ("torque limit", Outcome.OFF_RATE),
)


def classify(faults: Sequence[Fault], error: float | None) -> Outcome:
    """The outcome of a run with these faults and this error; None where it broke off."""
    known = [
        next((outcome for words, outcome in BY_FAULT if words in fault.cause), Outcome.DIVERGED)
        for fault in faults
    ]
    if error is None or Outcome.DIVERGED in known:
        return Outcome.DIVERGED
    for _, outcome in BY_FAULT:
        if outcome in known:
            return outcome
    if error <= ACCURATE:
        return Outcome.ACCURATE
    return Outcome.DEGRADED if error <= WRONG else Outcome.WRONG
