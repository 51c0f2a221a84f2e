"""Faults: what makes a run no result, each kind with the sentence that a user reads."""

from dataclasses import dataclass
from enum import Enum

# What every engine's run is held to.
DIVERGED = 1e10  # a state beyond it is none; MuJoCo's own limit (mjMAXVAL)
RATE_ERROR = 1e-3  # relative; a prescribed hinge keeps 1e-13, a servo this good passes
SHORTEST_PATH = 1e-9  # of the radius: a shorter path is none to slip on


class FaultKind(Enum):
    """The kinds of fault; {subject} says of what a fault is, {limit} what it has passed."""

    DIVERGED = "the state diverged"
    RESET = "time went back: the engine reset the state"
    CONTACT_LOST = "contact lost"
    CONE_SATURATED = "friction cone saturated"
    RATE_OFF = "hinge rate off by over {limit:g}"
    TORQUE_LIMIT = "{subject}'s motor at its torque limit"
    SLIPPED = "slipped over {limit:g} of the path"
    MOMENTUM_OFF = "M off by over {limit:g}"
    ENGINE_WARNED = "the engine warned of {subject}"
    STEP_TOO_SHORT = "the steps became too short ({subject})"
    OUT_OF_STEPS = "max_steps = {limit:.0f} are taken"

    @property
    def sentence(self) -> str:
        return self.value


@dataclass(frozen=True)
class Fault:
    """A fault of a run: its kind, and from when it is there [s].

    subject, limit: what its kind's sentence names; fatal: whether it ended the run; note: whether
    it is no fault but belongs to the motion, as a scene's own motor at its limit.
    """

    kind: FaultKind
    time: float
    subject: str = ""
    limit: float = 0.0
    fatal: bool = False
    note: bool = False

    @property
    def text(self) -> str:
        """The sentence, without the time."""
        return self.kind.sentence.format(subject=self.subject, limit=self.limit)

    def __str__(self) -> str:
        return f"{self.text} at t = {self.time:.6g} s"
