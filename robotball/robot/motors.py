"""Motors: what moves a hinge by a torque, as its command, its angle and its rate ask for.

A hinge without a motor keeps its drive (`drives`) as its rate [rad/s] exactly. To a motor the drive
is a command: a rate [rad/s] for a Servo, an angle [rad] for a PositionServo, a share of the nominal
voltage for a DCMotor, a torque [N m] for a Torque. A hinge's torque is that of the parent on the
child [N m]. SI units; a slide's are in m, N.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

import numpy as np

from robotball.errors import InputError, check_not_negative, check_positive, check_size
from robotball.robot.drives import Rate

if TYPE_CHECKING:
    from robotball.robot.activations import Activation

_Scalar = Any  # a float, or a column (n,)

# rad/s: dry friction turns over within so slow a rate, as no smooth equation has a jump.
SLOW = 1e-3


class Law(NamedTuple):
    """Give the torque of any motor by six numbers, which compiled equations take as they are.

    It is per_command · command - per_angle · angle - per_rate · rate + at_rest, less a dry
    friction smoothed to friction · tanh(rate/SLOW), and lies between -limit and limit. SI units.

    Parameters
    ----------
    per_command : float
        Torque per unit of the command.
    per_angle : float
        Against the angle, N m/rad.
    per_rate : float
        Against the rate, N m s/rad.
    at_rest : float, optional
        Torque of the motor at rest, N m.
    limit : float, optional
        Largest torque either way, N m.
    friction : float, optional
        Dry friction, N m.

    Examples
    --------
    >>> import robotball as rb
    >>> law = rb.Law(per_command=2.0, per_angle=0.0, per_rate=2.0, limit=1.0)
    >>> float(law.torque(1.0, 0.0, 0.75)), float(law.torque(1.0, 0.0, 0.0))
    (0.5, 1.0)
    """

    per_command: float
    per_angle: float
    per_rate: float
    at_rest: float = 0.0
    limit: float = math.inf
    friction: float = 0.0

    def torque(self, command: _Scalar, angle: _Scalar, rate: _Scalar) -> Any:
        """Return the torque on the child [N m] at an angle [rad] and a rate [rad/s]."""
        return np.clip(self.unlimited(command, angle, rate), -self.limit, self.limit)

    def unlimited(self, command: _Scalar, angle: _Scalar, rate: _Scalar) -> Any:
        """Return the torque on the child [N m] as it would be without a limit."""
        free = self.per_command * command - self.per_angle * angle - self.per_rate * rate
        return free + self.at_rest - self.friction * np.tanh(rate / SLOW)


class Motor(Protocol):
    """A hinge's motor: its law, and the reflected inertia of its rotor [kg m²]."""

    # Whether the command is a rate, as that of a velocity servo.
    follows_rate: ClassVar[bool] = False

    @property
    def armature(self) -> float: ...

    @property
    def law(self) -> Law: ...

    def torque(self, command: _Scalar, angle: _Scalar, rate: _Scalar) -> Any:
        """Return the law's torque on the child [N m]."""
        return self.law.torque(command, angle, rate)


@dataclass(frozen=True)
class Servo(Motor):
    """Follow a rate: torque = gain (command - rate), at most the limit either way.

    Parameters
    ----------
    gain : float
        N m s/rad.
    torque_limit : float, optional
        N m; if None there is none.
    armature : float, optional
        Reflected inertia of the motor's rotor, kg m².

    Raises
    ------
    InputError
        If the gain or the limit is not positive, or the armature negative.

    Examples
    --------
    >>> import robotball as rb
    >>> float(rb.Servo(gain=0.5, torque_limit=1.0).torque(10.0, 0.0, 9.0))
    0.5
    """

    follows_rate: ClassVar[bool] = True
    gain: float
    torque_limit: float | None = None
    armature: float = 0.0

    def __post_init__(self) -> None:
        check_positive("a servo's gain", self.gain, "N m s/rad")
        _check_common(self)

    @property
    def law(self) -> Law:
        return Law(self.gain, 0.0, self.gain, limit=self.torque_limit or math.inf)


@dataclass(frozen=True)
class PositionServo(Motor):
    """Follow an angle: torque = gain (command - angle) - damping · rate, at most the limit.

    Parameters
    ----------
    gain : float
        N m/rad.
    damping : float, optional
        N m s/rad.
    torque_limit : float, optional
        N m; if None there is none.
    armature : float, optional
        Reflected inertia of the motor's rotor, kg m².

    Raises
    ------
    InputError
        If the gain or the limit is not positive, or another number negative.

    Examples
    --------
    >>> import robotball as rb
    >>> float(rb.PositionServo(gain=4.0, damping=0.5).torque(1.0, 0.5, 1.0))
    1.5
    """

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
        return Law(self.gain, self.gain, self.damping, limit=self.torque_limit or math.inf)


def _check_common(servo: Servo | PositionServo) -> None:
    if servo.torque_limit is not None:
        check_positive("a servo's torque limit", servo.torque_limit, "N m")
    check_not_negative("a servo's armature", servo.armature, "kg m²")


@dataclass(frozen=True)
class DCMotor(Motor):
    """Drive a hinge by a direct-current motor.

    The command is the share of the nominal voltage.

    Without a limit the torque falls linearly with the rate, also beyond the no-load speed, and a
    motor that is turned backwards exceeds its stall torque.

    Parameters
    ----------
    stall_torque : float
        Before the gear, N m.
    no_load_speed : float
        Before the gear, rad/s.
    gear : float, optional
        Turns of the motor in one of the hinge.
    rotor_inertia : float, optional
        Before the gear, kg m².
    torque_limit : float, optional
        Of the hinge, as electronics or the gear set it, N m; if None there is none.
    efficiency : float, optional
        Of the gear: the part of the motor's torque that reaches the hinge, either way.
    no_load_current : float, optional
        At the no-load speed, A. The motor's dry friction is that part of the stall torque which
        this current is of the rest of the stall current.
    stall_current : float, optional
        At rest and the nominal voltage, A.

    Raises
    ------
    InputError
        If a number is not positive, but the rotor's inertia and the no-load current may be 0; for
        a no-load current of at least the stall current, or with a torque limit.

    Examples
    --------
    >>> import robotball as rb
    >>> motor = rb.DCMotor(stall_torque=0.25, no_load_speed=100.0, gear=4.0)
    >>> float(motor.torque(1.0, 0.0, 0.0)), float(motor.torque(1.0, 0.0, 25.0))
    (1.0, 0.0)
    """

    stall_torque: float
    no_load_speed: float
    gear: float = 1.0
    rotor_inertia: float = 0.0
    torque_limit: float | None = None
    efficiency: float = 1.0
    no_load_current: float = 0.0
    stall_current: float | None = None

    def __post_init__(self) -> None:
        check_positive("a motor's stall torque", self.stall_torque, "N m")
        check_positive("a motor's no-load speed", self.no_load_speed, "rad/s")
        check_positive("a motor's gear", self.gear, "turns to 1")
        check_not_negative("a motor's rotor inertia", self.rotor_inertia, "kg m²")
        if self.torque_limit is not None:
            check_positive("a motor's torque limit", self.torque_limit, "N m")
        if not 0 < self.efficiency <= 1:
            raise InputError(f"a gear's efficiency must be in (0, 1], not {self.efficiency:g}")
        check_not_negative("a motor's no-load current", self.no_load_current, "A")
        if self.no_load_current and (self.torque_limit or not self.stall_current):
            raise InputError("a motor's no-load current takes a stall current and no torque limit")
        if self.stall_current is not None and not self.no_load_current < self.stall_current:
            raise InputError(
                f"a motor's no-load current must be below its stall current of "
                f"{self.stall_current:g} A, not {self.no_load_current:g} A"
            )

    @property
    def armature(self) -> float:
        return self.gear**2 * self.rotor_inertia

    @property
    def law(self) -> Law:
        stall = self.efficiency * self.gear * self.stall_torque
        slope = self.gear * stall / self.no_load_speed
        # The sheet's torque is less this friction already, also at rest.
        idle = self.no_load_current
        friction = stall * idle / (self.stall_current - idle) if self.stall_current else 0.0
        limit = self.torque_limit or math.inf
        return Law(stall + friction, 0.0, slope, limit=limit, friction=friction)


@dataclass(frozen=True)
class Torque(Motor):
    """Give the commanded torque, whatever the hinge does.

    Parameters
    ----------
    armature : float, optional
        Reflected inertia of the motor's rotor, kg m².

    Raises
    ------
    InputError
        If the armature is negative.

    Examples
    --------
    >>> import robotball as rb
    >>> float(rb.Torque().torque(0.3, 1.0, 2.0))
    0.3
    """

    armature: float = 0.0

    def __post_init__(self) -> None:
        check_not_negative("a motor's armature", self.armature, "kg m²")

    @property
    def law(self) -> Law:
        return Law(1.0, 0.0, 0.0)


@dataclass(frozen=True)
class Free(Motor):
    """Let a hinge turn freely against damping, a spring and dry friction, without a command.

    Parameters
    ----------
    damping : float, optional
        N m s/rad.
    stiffness : float, optional
        Of the spring, N m/rad.
    rest : float, optional
        Angle at which the spring rests, rad.
    armature : float, optional
        Reflected inertia of what turns with the hinge, kg m².
    friction : float, optional
        Dry friction, smoothed as in `Law`, N m.

    Raises
    ------
    InputError
        If a number other than the rest angle is negative, or one is not finite.

    Examples
    --------
    >>> import robotball as rb
    >>> float(rb.Free(damping=0.5).torque(0.0, 0.0, 2.0))
    -1.0
    """

    damping: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    armature: float = 0.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        check_not_negative("a free hinge's friction", self.friction, "N m")
        check_not_negative("a free hinge's damping", self.damping, "N m s/rad")
        check_not_negative("a free hinge's stiffness", self.stiffness, "N m/rad")
        check_not_negative("a free hinge's armature", self.armature, "kg m²")
        check_size("a free hinge's rest angle", self.rest, "rad")

    @property
    def law(self) -> Law:
        at_rest = self.stiffness * self.rest
        return Law(0.0, self.stiffness, self.damping, at_rest, friction=self.friction)


@dataclass(frozen=True)
class Actuator:
    """Move hinges through gears, besides what each hinge has of its own.

    Parameters
    ----------
    name : str
        The actuator's own.
    gears : tuple of (str, float)
        Hinges by name, with the ratio of each: the motor's angle is Σ ratio · angle, and a hinge
        gets ratio times its torque.
    law : Law
        Torque of the motor, N m.
    command : float, Drive, Custom or callable, optional
        What the law takes, as a function of time; with an activation, what that takes.
    activation : Activation, optional
        State of the actuator's own between the command and the law.
    within : tuple of 2 floats, optional
        Least and largest command, to which a constant one is clipped.

    Raises
    ------
    InputError
        Where the gears name a hinge twice.

    Examples
    --------
    >>> import robotball as rb
    >>> pull = rb.Actuator("pull", (("arm", 2.0), ("wrist", -1.0)), rb.Torque().law, command=0.1)
    >>> pull.control(10.0)
    0.1
    """

    name: str
    gears: tuple[tuple[str, float], ...]
    law: Law
    command: Rate = 0.0
    activation: "Activation | None" = None
    within: tuple[float, float] = (-math.inf, math.inf)

    def __post_init__(self) -> None:
        if len({name for name, _ in self.gears}) < len(self.gears):
            raise InputError(f"{self.name} must have one gear a hinge, not {self.gears}")

    def control(self, end: float) -> Rate:
        """Return what the law takes in a run from 0 to `end` [s].

        Raises InputError for a command or an activation that changes in time and leaves its range.
        """
        if self.activation is None and self.within == (-math.inf, math.inf):
            return self.command
        from robotball.robot.activations import passed  # few actuators have either

        return passed(self.name, self.command, self.within, self.activation, end)
