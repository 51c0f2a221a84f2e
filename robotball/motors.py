"""How a hinge is moved that does not keep its rate exactly: by a motor, or by nothing at all.

A hinge's command is a function of time: a rate [rad/s] for a Servo, an angle [rad] for a
PositionServo, a torque [N m] for a Torque. Its torque is what the parent puts on the child [N m].
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from robotball.errors import check_not_negative, check_positive, check_size

Scalar = Any  # a float, or a column (n,)


class Law(NamedTuple):
    """What every motor's torque is, between -limit and limit [N m].

    per_command · command - per_angle · angle - per_rate · rate + at_rest.
    """

    per_command: float
    per_angle: float
    per_rate: float
    at_rest: float = 0.0
    limit: float = math.inf

    def torque(self, command: Scalar, angle: Scalar, rate: Scalar) -> Any:
        """The torque on the child [N m] at an angle [rad] and a rate [rad/s]."""
        free = (
            self.per_command * command
            - self.per_angle * angle
            - self.per_rate * rate
            + self.at_rest
        )
        return np.clip(free, -self.limit, self.limit)


class Motor(Protocol):
    """A hinge's motor: its law, and the reflected inertia of its rotor [kg m²]."""

    @property
    def armature(self) -> float: ...

    @property
    def law(self) -> Law: ...

    def torque(self, command: Scalar, angle: Scalar, rate: Scalar) -> Any:
        """The law's torque on the child [N m]."""
        return self.law.torque(command, angle, rate)


@dataclass(frozen=True)
class Servo(Motor):
    """A velocity servo with a gain [N m s/rad] and, if it has one, a torque limit [N m]."""

    gain: float
    torque_limit: float | None = None
    armature: float = 0.0

    def __post_init__(self) -> None:
        check_positive("a servo's gain", self.gain, "N m s/rad")
        _check_common(self)

    @property
    def law(self) -> Law:
        return Law(self.gain, 0.0, self.gain, limit=_limit(self))


@dataclass(frozen=True)
class PositionServo(Motor):
    """A servo that follows an angle: gain [N m/rad], damping [N m s/rad], torque limit [N m]."""

    gain: float
    damping: float = 0.0
    torque_limit: float | None = None
    armature: float = 0.0

    def __post_init__(self) -> None:
        check_positive("a position servo's gain", self.gain, "N m/rad")
        check_not_negative("a position servo's damping", self.damping, "N m s/rad")
        _check_common(self)

    @property
    def law(self) -> Law:
        return Law(self.gain, self.gain, self.damping, limit=_limit(self))


@dataclass(frozen=True)
class Torque(Motor):
    """A motor that gives the commanded torque, whatever the hinge does."""

    armature: float = 0.0

    def __post_init__(self) -> None:
        check_not_negative("a motor's armature", self.armature, "kg m²")

    @property
    def law(self) -> Law:
        return Law(1.0, 0.0, 0.0)


@dataclass(frozen=True)
class Free(Motor):
    """No motor: damping [N m s/rad] and a spring [N m/rad] that rests at an angle [rad].

    The hinge's command is not used, and is 0.
    """

    damping: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    armature: float = 0.0

    def __post_init__(self) -> None:
        check_not_negative("a free hinge's damping", self.damping, "N m s/rad")
        check_not_negative("a free hinge's stiffness", self.stiffness, "N m/rad")
        check_not_negative("a free hinge's armature", self.armature, "kg m²")
        check_size("a free hinge's rest angle", self.rest, "rad")

    @property
    def law(self) -> Law:
        return Law(0.0, self.stiffness, self.damping, at_rest=self.stiffness * self.rest)


def _limit(servo: Servo | PositionServo) -> float:
    return math.inf if servo.torque_limit is None else servo.torque_limit


def _check_common(servo: Servo | PositionServo) -> None:
    if servo.torque_limit is not None:
        check_positive("a servo's torque limit", servo.torque_limit, "N m")
    check_not_negative("a servo's armature", servo.armature, "kg m²")
