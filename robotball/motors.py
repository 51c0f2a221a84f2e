"""How a hinge is moved that does not keep its rate exactly: by a motor, or by nothing at all.

A hinge's command is a function of time: a rate [rad/s] for a Servo, an angle [rad] for a
PositionServo, a torque [N m] for a Torque. `torque` is what the parent puts on the child [N m].
"""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from robotball.errors import check_not_negative, check_positive, check_size

Scalar = Any  # a float, or a column (n,)


class Motor(Protocol):
    """A hinge's motor: its torque, and the reflected inertia of its rotor [kg m²]."""

    @property
    def armature(self) -> float: ...

    def torque(self, command: Scalar, angle: Scalar, rate: Scalar) -> Any:
        """The torque on the child [N m] at an angle [rad] and a rate [rad/s]."""
        ...


@dataclass(frozen=True)
class Servo:
    """A velocity servo with a gain [N m s/rad] and, if it has one, a torque limit [N m]."""

    gain: float
    torque_limit: float | None = None
    armature: float = 0.0

    def __post_init__(self) -> None:
        check_positive("a servo's gain", self.gain, "N m s/rad")
        _check_common(self)

    def torque(self, command: Scalar, angle: Scalar, rate: Scalar) -> Any:
        return _limited(self.gain * (command - rate), self.torque_limit)


@dataclass(frozen=True)
class PositionServo:
    """A servo that follows an angle: gain [N m/rad], damping [N m s/rad], torque limit [N m]."""

    gain: float
    damping: float = 0.0
    torque_limit: float | None = None
    armature: float = 0.0

    def __post_init__(self) -> None:
        check_positive("a position servo's gain", self.gain, "N m/rad")
        check_not_negative("a position servo's damping", self.damping, "N m s/rad")
        _check_common(self)

    def torque(self, command: Scalar, angle: Scalar, rate: Scalar) -> Any:
        return _limited(self.gain * (command - angle) - self.damping * rate, self.torque_limit)


@dataclass(frozen=True)
class Torque:
    """A motor that gives the commanded torque, whatever the hinge does."""

    armature: float = 0.0

    def __post_init__(self) -> None:
        check_not_negative("a motor's armature", self.armature, "kg m²")

    def torque(self, command: Scalar, angle: Scalar, rate: Scalar) -> Any:
        return command + 0.0 * rate


@dataclass(frozen=True)
class Free:
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

    def torque(self, command: Scalar, angle: Scalar, rate: Scalar) -> Any:
        return -self.damping * rate - self.stiffness * (angle - self.rest)


def _limited(torque: Scalar, limit: float | None) -> Any:
    return torque if limit is None else np.clip(torque, -limit, limit)


def _check_common(servo: Servo | PositionServo) -> None:
    if servo.torque_limit is not None:
        check_positive("a servo's torque limit", servo.torque_limit, "N m")
    check_not_negative("a servo's armature", servo.armature, "kg m²")
