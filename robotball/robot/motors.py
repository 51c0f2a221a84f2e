"""Motors: the torque on a hinge as a function of its command, angle and rate.

For a hinge without a motor, its drive (`drives`) is its rate [rad/s], which the hinge keeps
exactly. For a motor the drive is a command: a rate [rad/s] for a Servo, an angle [rad] for a
PositionServo, a fraction of the nominal voltage for a DCMotor, a torque [N m] for a Torque. The
parent exerts the torque of a hinge on the child. All units are SI units; slides have m and N. An
actuator may have an activation between its command and its law. The activation is a function of
time and is computed before the run.
"""

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from robotball.errors import InputError, check_not_negative, check_positive, check_size
from robotball.robot.drives import Constant, Custom, Drive, Rate, as_drive

_Scalar = Any  # a float, or a column (n,)

# rad/s: dry friction changes sign smoothly within about this rate, because the equations must be
# smooth.
SLOW = 1e-3
NO_LIMITS = (-math.inf, math.inf)  # least and largest command of an actuator without limits
_LAGS = 5.0  # settling times per piece of the integral
_MOST_SETTLINGS = 1e5  # settling times in a run with a changing command; they take 30 s
_LOOKS = 1001  # samples in time of a check against a range
_ROOT = 1e-14  # s, tolerance of the time at which a limit is reached
_ROUNDING = 1e-9  # tolerance of a range, relative to its larger end


class Law(NamedTuple):
    """Describe the torque of any motor with six numbers, which compiled equations use directly.

    The torque is per_command · command - per_angle · angle - per_rate · rate + at_rest -
    friction · tanh(rate/SLOW), clipped to -limit and limit. The last term is smoothed dry friction.
    All units are SI units.

    Attributes
    ----------
    per_command : float
        Torque per unit of the command.
    per_angle : float
        Stiffness, N m/rad.
    per_rate : float
        Damping, N m s/rad.
    at_rest : float, optional
        Torque at zero rate, angle and command, N m.
    limit : float, optional
        Largest torque in either direction, N m.
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
        """Return the torque on the child [N m] before it is clipped to the limit."""
        free = self.per_command * command - self.per_angle * angle - self.per_rate * rate
        return free + self.at_rest + self.dry_friction(rate)

    def dry_friction(self, rate: _Scalar) -> Any:
        """Return the torque of dry friction on the child [N m] at a rate [rad/s]."""
        return -self.friction * np.tanh(rate / SLOW)


class Motor(Protocol):
    """The motor of a hinge: its law, and the reflected inertia of its rotor [kg m²]."""

    # True if the command is a rate.
    follows_rate: ClassVar[bool] = False

    @property
    def armature(self) -> float: ...

    @property
    def law(self) -> Law: ...

    def torque(self, command: _Scalar, angle: _Scalar, rate: _Scalar) -> Any:
        """Return the torque on the child [N m]."""
        return self.law.torque(command, angle, rate)


@dataclass(frozen=True)
class Servo(Motor):
    """Follow a rate: torque = gain (command - rate), clipped to the limit.

    Parameters
    ----------
    gain : float
        Torque per difference of rates, N m s/rad.
    torque_limit : float, optional
        Largest torque, N m; no limit if None.
    armature : float, optional
        Reflected inertia of the motor's rotor, kg m².

    Raises
    ------
    InputError
        If the gain or the limit is not positive, or the armature is negative.

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
    """Follow an angle: torque = gain (command - angle) - damping · rate, clipped to the limit.

    Parameters
    ----------
    gain : float
        Torque per difference of angles, N m/rad.
    damping : float, optional
        Damping coefficient, N m s/rad.
    torque_limit : float, optional
        Largest torque, N m; no limit if None.
    armature : float, optional
        Reflected inertia of the motor's rotor, kg m².

    Raises
    ------
    InputError
        If the gain or the limit is not positive, or another number is negative.

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
    """Drive a hinge with a direct-current motor.

    The command is the voltage as a fraction of the nominal voltage. Without a limit, the torque
    decreases linearly with the rate, even beyond the no-load speed; a motor that is turned
    backwards therefore exceeds its stall torque.

    Parameters
    ----------
    stall_torque : float
        Stall torque of the motor before the gear, N m.
    no_load_speed : float
        No-load speed of the motor before the gear, rad/s.
    gear : float, optional
        Turns of the motor per turn of the hinge.
    rotor_inertia : float, optional
        Inertia of the motor's rotor before the gear, kg m².
    torque_limit : float, optional
        Largest torque on the hinge, set by the electronics or the gear, N m; no limit if None.
    efficiency : float, optional
        Gear efficiency: the fraction of the motor's torque that reaches the hinge.
    no_load_current : float, optional
        Current at the no-load speed, A. With stall torque T, no-load current I₀ and stall current
        I, the motor's dry friction is T I₀/(I - I₀).
    stall_current : float, optional
        Current of the motor at rest at the nominal voltage, A.

    Raises
    ------
    InputError
        If a number is not positive (the rotor's inertia and the no-load current may be 0), if the
        efficiency exceeds 1, if the no-load current is not below the stall current, or if a no-load
        current and a torque limit are both given.

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
            raise InputError("a motor's no-load current needs a stall current and no torque limit")
        if self.stall_current is not None and not self.no_load_current < self.stall_current:
            limit = f"{self.stall_current:g} A, not {self.no_load_current:g} A"
            raise InputError(f"a motor's no-load current must be below its stall current, {limit}")

    @property
    def armature(self) -> float:
        return self.gear**2 * self.rotor_inertia

    @property
    def law(self) -> Law:
        stall = self.efficiency * self.gear * self.stall_torque
        slope = self.gear * stall / self.no_load_speed
        # A data sheet's stall torque is the torque that remains after this friction.
        idle = self.no_load_current
        friction = stall * idle / (self.stall_current - idle) if self.stall_current else 0.0
        limit = self.torque_limit or math.inf
        return Law(stall + friction, 0.0, slope, limit=limit, friction=friction)


@dataclass(frozen=True)
class Torque(Motor):
    """Apply the commanded torque, independent of the hinge's motion.

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
    """Damp a hinge with a viscous damper, a spring and dry friction, without a command.

    Parameters
    ----------
    damping : float, optional
        Damping coefficient, N m s/rad.
    stiffness : float, optional
        Stiffness of the spring, N m/rad.
    rest : float, optional
        Rest angle of the spring, rad.
    armature : float, optional
        Reflected inertia of parts that turn with the hinge, kg m².
    friction : float, optional
        Dry friction, smoothed as in `Law`, N m.

    Raises
    ------
    InputError
        If a number other than the rest angle is negative, or a number is not finite.

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
class Activation:
    """Activation state w of an actuator, which is the input of its law in place of the command u.

    The equation is ẇ = (u - w)/settling, or ẇ = u if settling [s] is None. w starts at `initial`
    and is clipped to low and high.
    """

    initial: float
    settling: float | None = None
    low: float = -math.inf
    high: float = math.inf

    def of(self, u: Drive, end: float) -> Rate:
        """Return w over time, from 0 to `end` [s]; w is clipped if u is constant."""
        if isinstance(u, Constant) and u.value == (self.initial if self.settling else 0.0):
            return self.initial
        value = self._unlimited(u, end)
        last = value(end)
        limit = float(np.clip(last, self.low, self.high))
        if limit == last or not isinstance(u, Constant):
            return Custom(value, u.breakpoints)
        # For a constant command w is monotone, so it stays at its limit once it gets there.
        from scipy.optimize import brentq  # few commands reach a limit

        reached = brentq(lambda t: value(t) - limit, 0.0, end, xtol=_ROOT)
        return Custom(lambda t: limit if t >= reached else value(t), (reached,))

    def _unlimited(self, u: Drive, end: float) -> Callable[[float], float]:
        settling, w = self.settling, self.initial
        if settling is None:
            return lambda t: w + float(u.angle(t))
        if isinstance(u, Constant):
            to = u.value
            return lambda t: to + (w - to) * math.exp(-t / settling)
        if end > _MOST_SETTLINGS * settling:
            limit = f"a run of at most {_MOST_SETTLINGS * settling:g} s, not {end:g} s"
            line = f"a filter with the time constant {settling:g} s allows {limit}"
            raise InputError(f"{line}; leave the filter out, or give a constant control")
        # w = exp(-(t - T)/τ)(w_T + ∫ u exp((s - T)/τ)/τ ds), with T near t against overflow.
        from robotball.robot.function_drives import polynomials_of  # few actuators need it

        begins = np.arange(0.0, end, _LAGS * settling).tolist()
        pieces = []
        for begin, stop in pairwise([*begins, end]):
            inside = [t for t in u.breakpoints if begin < t < stop]

            def grown(s: float, begin: float = begin) -> float:
                return float(u.rate(s)) * math.exp((s - begin) / settling) / settling

            area = polynomials_of(grown, [begin, *inside, stop]).area
            pieces.append((begin, w, area))
            w = (w + area(stop)) * math.exp((begin - stop) / settling)

        def value(t: float) -> float:
            begin, before, area = pieces[max(bisect_right(begins, t) - 1, 0)]
            return (before + area(t)) * math.exp((begin - t) / settling)

        return value


@dataclass(frozen=True)
class Actuator:
    """Move hinges through gears, in addition to the motors of the hinges.

    Parameters
    ----------
    name : str
        Name of the actuator.
    gears : tuple of (str, float)
        Names of hinges, each with its gear ratio. The motor's angle is the sum of ratio · angle
        over the hinges, and each hinge gets the motor's torque times its ratio.
    law : Law
        Torque of the motor, N m.
    command : float, Drive, Custom or callable, optional
        Input as a function of time: of the activation if there is one, else of the law.
    activation : Activation, optional
        State between the command and the law.
    within : tuple of 2 floats, optional
        Least and largest command. A constant command is clipped to this range.

    Raises
    ------
    InputError
        If the gears name a hinge twice.

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
    activation: Activation | None = None
    within: tuple[float, float] = NO_LIMITS

    def __post_init__(self) -> None:
        if len({name for name, _ in self.gears}) < len(self.gears):
            raise InputError(f"{self.name} must have only one gear per hinge; it has {self.gears}")

    def control(self, end: float) -> Rate:
        """Return the input of the law in a run from 0 to `end` [s].

        Raises InputError if a command that changes with time leaves its range, or if it makes the
        activation leave its range.
        """
        if self.activation is None and self.within == NO_LIMITS:
            return self.command
        return _filtered(self.name, self.command, self.within, self.activation, end)


def _filtered(
    name: str, command: Rate, within: tuple[float, float], activation: Activation | None, end: float
) -> Rate:
    """Return an actuator's command after its range and activation, in a run to `end` [s].

    A constant command is clipped to its range. Raises InputError if a command that changes with
    time leaves its range, or if it makes the activation leave its range.
    """
    drive = as_drive(command, end)
    if isinstance(drive, Constant):
        drive = Constant(float(np.clip(drive.value, *within)))
    else:
        _check_within(f"{name}: its control", drive.rate, *within, end)
    if activation is None:
        return drive.value if isinstance(drive, Constant) else command
    state = activation.of(drive, end)
    if isinstance(state, Custom):
        low, high = activation.low, activation.high
        _check_within(f"{name}: its activation", state.function, low, high, end)
    return state


def _check_within(
    name: str, value: Callable[[float], float], low: float, high: float, end: float
) -> None:
    sizes = [abs(limit) for limit in (low, high) if math.isfinite(limit)]
    off = _ROUNDING * max(sizes, default=0.0)
    for t in np.linspace(0.0, end, _LOOKS).tolist():
        if not low - off <= value(t) <= high + off:
            line = f"{value(t):g} at t = {t:g} s, outside its range of {low:g} to {high:g}"
            raise InputError(f"{name} is {line}; keep it in this range: only constants are clipped")
