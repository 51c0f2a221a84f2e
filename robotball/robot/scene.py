"""Scene: a ball with its drives, a rolling model, a plane and a start.

When a scene is created, it is checked and rounding errors of its start are removed, so that every
engine starts from the same state.
"""

import math
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from robotball.errors import (
    LARGEST,
    InputError,
    check_not_negative,
    check_positive,
    check_size,
    counted,
    named,
)
from robotball.robot.ball import ROUNDING, Ball, Link, UserValue, Value, cached_array, imbalance
from robotball.robot.drives import (
    SIMPSON,
    Constant,
    Drive,
    Rate,
    Rule,
    as_drive,
    sampling_error,
    turns,
)
from robotball.robot.formulas import (
    ROLLING_MODELS,
    Parameters,
    Rolling,
    as_vector,
    parameters_of,
    turntable_velocity,
)
from robotball.rotations import Array, as_floats, from_matrix, normalised, rotation_matrix, uneven

if TYPE_CHECKING:
    from robotball.robot.controllers import Controller
    from robotball.robot.mechanics import Robot, States
    from robotball.robot.motors import Actuator, Motor

GRAVITY = 9.81  # m/s², MuJoCo's default
DOWN = (0.0, 0.0, -1.0)
SAMPLE_INTERVAL = 0.02  # s, default interval between samples
_LONG, _LONG_INTERVAL = 1e4, 0.1  # s: a motion longer than the first has the second as interval
_MOST_SAMPLES = 1e7  # of a motion; a sample takes some 200 bytes in a file and 120 in memory
# Largest error of a given unit vector, right angle or horizontal momentum. Numbers with the six
# digits of a figure's caption pass, wrong numbers do not. A value that passes is made exact.
_CAPTION = 1e-5
_START_ROUNDING = 1e-12  # largest rounding error of M, relative to the terms of the sum M
_AT_REST = 1e-6  # times the rate of a ball that fell by its radius: slower hinges are at rest
_RATE_SAMPLES = 501  # times over a scene at which the largest rate of a hinge is sampled
_SMALL = 0.3  # times |K| + d|Ω|: if |M| is smaller, K and dΩ turn the ball rather than M


def sample_times(duration: float, interval: float | None = None) -> Array:
    """Return equally spaced times.

    Parameters
    ----------
    duration : float
        Last time, s.
    interval : float, optional
        Largest interval, s. If None, 0.02 s for motions up to 1e4 s, and 0.1 s for longer ones.

    Returns
    -------
    array (n,)
        Times from 0 to the duration, s.

    Raises
    ------
    InputError
        If the duration is not positive and finite, or needs more than ten million times.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.sample_times(1.0, 0.25).tolist()
    [0.0, 0.25, 0.5, 0.75, 1.0]
    """
    check_positive("duration", duration, "s")
    if interval is not None:
        check_positive("interval", interval, "s")
    else:
        interval = _LONG_INTERVAL if duration > _LONG else SAMPLE_INTERVAL
    if not duration / interval < _MOST_SAMPLES:
        count = f"{duration / interval:.3g} samples in {duration:g} s (limit {_MOST_SAMPLES:g})"
        raise InputError(f"interval {interval:g} s gives {count}: choose a longer interval")
    # The factor absorbs rounding: 10/0.02 may be slightly more than 500.
    return np.linspace(0.0, duration, int(np.ceil(duration / interval * (1 - 1e-12))) + 1)


Times = ArrayLike | None
"""Times as a user gives them: a duration [s], times (n,) [s], or None for those of the scene."""


def times_of(times: Times, scene: "Scene | None" = None) -> Array:
    """Return the sample times (n,) that a user requested, as floats.

    Raises InputError unless the user gave a positive duration, or times that are finite, increase
    and start at 0.
    """
    if times is None and scene is not None:
        return scene.times
    if isinstance(times, str):
        line = f"times must be a duration [s] or an array, not {times!r}"
        raise InputError(f"{line}; if it is a preset, write settings={times!r}")
    times = as_floats("times", times)
    if times.ndim == 0:
        return sample_times(float(times))
    if times.ndim != 1 or len(times) < 2:
        line = "times must be a duration [s], or an array (n,) of two or more times"
        raise InputError(f"{line}; this has shape {times.shape}")
    if not np.all(np.isfinite(times)):
        raise InputError("times must be finite")
    check_size("the last of the times", float(times[-1]), "s")
    if times[0] != 0:
        raise InputError(f"times must start at 0 s, not at {times[0]:g} s")
    late = np.flatnonzero(np.diff(times) <= 0)
    if len(late):
        i = int(late[0])
        raise InputError(f"times must increase, but {times[i + 1]:g} s follows {times[i]:g} s")
    return times


@dataclass(frozen=True)
class Friction:
    """Set the coefficients of friction between shell and plane.

    Parameters
    ----------
    sliding : float, optional
        Largest friction force divided by the normal force. None means as much as rolling needs.
    torsional : float, m, optional
        For the rubber model: largest torque about the vertical divided by the normal force. None
        means as much as rolling needs.
    rolling : float, m, default 0
        Torque that resists rolling, divided by the normal force.

    Raises
    ------
    InputError
        If a coefficient is not positive, or `rolling` is negative.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.Friction(sliding=0.3).sliding
    0.3
    """

    sliding: float | None = None
    torsional: float | None = None
    rolling: float = 0.0

    def __post_init__(self) -> None:
        if self.sliding is not None:
            check_positive("the sliding friction", self.sliding, "")
        if self.torsional is not None:
            check_positive("the torsional friction", self.torsional, "m")
        check_not_negative("the rolling friction", self.rolling, "m")


@dataclass(frozen=True)
class Start(UserValue):
    """Set the initial attitude and momentum of the ball.

    Parameters
    ----------
    attitude : array (4,)
        Quaternion (w, x, y, z) of the frame, frame to world.
    momentum : array (3,)
        M that the ball would have if it did not slip, in world axes, kg m²/s.
    slip : array (3,), optional
        Velocity of the shell's point at the contact along the world's X and Y, m/s; third, for the
        rubber model, the spin of the shell about the vertical, rad/s.

    Examples
    --------
    >>> import robotball as rb
    >>> start = rb.Start(attitude=(1, 0, 0, 0), momentum=(0.0, 0.5, 0.0))
    >>> start.momentum.tolist()
    [0.0, 0.5, 0.0]
    """

    attitude: Array
    momentum: Array
    slip: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def slips(self) -> bool:
        """Whether the shell slips at the start."""
        return bool(np.any(self.slip))

    @cached_array
    def to_world(self) -> Array:
        """The attitude as a matrix (3, 3), frame to world. The rows of the matrix are α, β, γ."""
        return rotation_matrix(self.attitude)


def section_state(
    L: ArrayLike, l: ArrayLike, g: float, f: float, c: float = 0.0
) -> tuple[Array, Array]:
    """Return γ (..., 3) and M (..., 3), in principal axes, at section coordinates (5.5).

    L (...) [kg m²/s] and l (...) [rad] give the direction of M; f = M² [(kg m²/s)²]; g [rad]
    rotates γ about M; c = (M, γ) [kg m²/s]. Raises InputError unless f > 0, L² <= f and c² < f.
    """
    if not f > 0:
        raise InputError(f"f = M² must be positive, not {f:g}")
    G = np.sqrt(f)
    L, l = np.broadcast_arrays(L, l)
    if not np.all(np.abs(L) <= G):
        raise InputError(f"|L| = {np.abs(L).max():g} must be at most sqrt(f) = {G:g}")
    if not abs(c) < G:
        raise InputError(f"|c| = {abs(c):g} must be less than sqrt(f) = {G:g}")
    across = np.sqrt(1 - (L / G) ** 2)
    M = G * np.stack([across * np.sin(l), across * np.cos(l), L / G], axis=-1)
    node = np.stack([np.cos(l), -np.sin(l), np.zeros(l.shape)], axis=-1)
    level = np.stack([L / G * np.sin(l), L / G * np.cos(l), -across], axis=-1)
    gamma = np.sin(g) * node + np.cos(g) * level
    return c / f * M + np.sqrt(1 - c * c / f) * gamma, M


def along_momentum(gamma: Array, M: Array) -> Start:
    """Return the start of one ball, as in `aligned`."""
    return Start(*aligned(gamma, M))


def aligned(gamma: Array, M: Array) -> tuple[Array, Array]:
    """Return attitudes (..., 4) and M (..., 3) in the world axes of section 3.3.

    OX is opposite to the horizontal part of M: α = -(M - cγ)/√(f - c²), β = M×γ/√(f - c²), with
    unit vectors gamma (..., 3) and M (..., 3), both in frame axes. Raises InputError if an M is
    vertical or zero, because α and β then do not follow from M and must be given.
    """
    c = (M * gamma).sum(axis=-1, keepdims=True)
    level = M - c * gamma
    size = np.linalg.norm(level, axis=-1, keepdims=True)
    # The rounding error of a vertical M has no meaningful direction.
    if not np.all(size > 1e-12 * np.linalg.norm(M, axis=-1, keepdims=True)):
        line = "M is vertical and does not give the direction of OX; give alpha or a quaternion too"
        raise InputError(line)
    momenta = np.concatenate([-size, np.zeros(size.shape), c], axis=-1)
    return attitude_of_axes(gamma, -level / size), momenta


def attitude_of_axes(gamma: Array, alpha: Array) -> Array:
    """Return the quaternions (..., 4) for γ and α (..., 3), the unit vectors of world Z and X.

    γ and α are in frame axes. Raises InputError unless γ and α are orthogonal.
    """
    cosine = (gamma * alpha).sum(axis=-1, keepdims=True)
    if not np.all(np.abs(cosine) <= _CAPTION):
        worst = cosine.flat[np.abs(cosine).argmax()]
        raise InputError(f"gamma and alpha must be orthogonal, but (gamma, alpha) = {worst:.6g}")
    # Make α orthogonal to γ to rounding. γ is kept, because the dynamics depend on γ, while α is
    # only the heading.
    alpha = alpha - cosine * gamma
    alpha = alpha / np.linalg.norm(alpha, axis=-1, keepdims=True)
    return from_matrix(np.stack([alpha, np.cross(gamma, alpha), gamma], axis=-2))


def unit(name: str, v: Array) -> Array:
    """Return `v` (n,) normalised. Raises InputError if it is not a unit vector."""
    length = math.hypot(*v.tolist())  # does not overflow
    if not abs(length - 1) <= _CAPTION:
        raise InputError(f"{name} must have unit length, but |{name}| = {length:.6g}")
    return normalised(v)


def horizontal(M: Array, scale: float) -> Array:
    """Return M (3,) in world axes without its vertical part, which is 0 in the rubber model (3.1).

    scale: size of the terms whose sum is M [kg m²/s], from which the rounding error of M follows.
    Raises InputError if the vertical part exceeds the rounding of a figure's caption.
    """
    size, vertical = math.hypot(*M.tolist()), float(M[2])
    if not abs(vertical) <= max(_CAPTION * size, _START_ROUNDING * scale):
        fault = f"but (M, gamma) = {vertical:.6g} and |M| = {size:.6g} kg m²/s"
        raise InputError(f"M must be horizontal in the rubber model (equation (3.1)), {fault}")
    return M * [1.0, 1.0, 0.0]


def check_no_spin(shell: Array, gamma: Array) -> None:
    """Raise InputError if the shell's ω - Ω (3,) has a component along γ, against (2.2)."""
    spin = float(shell @ gamma)
    if not abs(spin) <= _CAPTION * float(np.linalg.norm(shell)):
        spins = f"the shell's spin (ω - Ω, γ) is {spin:.6g} rad/s"
        raise InputError(f"angular_velocity: {spins}, but must be 0 for rubber (equation (2.2))")


@dataclass(frozen=True)
class MovedHinge:
    """A hinge of the ball as engines use it.

    Attributes
    ----------
    body : Link
        The body with its name, axis and pivot, at hinge angles 0.
    command : Drive
        Command of the motor as a function of time; `rate(t)` is the command in the motor's unit.
    motor : Motor or None
        The motor. If None, the hinge keeps the commanded rate exactly.
    angle : float, rad; m for a slide
        Initial angle.
    rate : float, rad/s; m/s for a slide
        Initial rate.
    """

    body: Link
    command: Drive
    motor: "Motor | None"
    angle: float
    rate: float

    @property
    def name(self) -> str:
        """The name of the body: frame, rotor1, …, pendulum1, … or the name of a link."""
        return self.body.name


@dataclass(frozen=True, repr=False)
class Scene(Value):
    """Set up one experiment, which is the same for every engine.

    Parameters
    ----------
    name : str
        A word that names the scene in tables and file names.
    title : str
        A line that describes the scene in plots.
    source : str
        Source of the numbers.
    ball : Ball
        Bodies and hinges, with motors, commands and initial hinge states.
    rolling : {"rubber", "classical"}
        Rolling model. The rubber model forbids slipping and spinning about the vertical; the
        classical model forbids only slipping.
    start : Start
        Attitude and momentum. Rounding errors of the start are corrected: the attitude becomes a
        unit quaternion, and M of a rubber ball becomes horizontal.
    duration : float
        Duration of the motion, s.
    gravity : float, optional
        Gravitational acceleration, m/s².
    gravity_direction : tuple of 3 floats, optional
        Direction of gravity in world axes, with Z normal to the plane. If the plane is inclined,
        this direction has components along X and Y.
    friction : Friction, optional
        Friction of the plane.
    actuators : tuple of Actuator, optional
        Motors that move several hinges through gears, in addition to the motors of the hinges.
    controller : Controller, optional
        Controller that commands the motors from sensor readings. Its commands replace those of the
        hinges and actuators.
    plane_motion : tuple of 3 rates, optional
        Acceleration of the plane along world X, Y and Z, m/s². The plane is at rest at time 0.
        Contact points and velocities are relative to the plane; `in_space` returns the position of
        the ball in space.
    plane_rotation : rate, optional
        Rate at which the plane turns about the world's Z axis, rad/s. Contact points and velocities
        are given in axes that do not turn.

    Raises
    ------
    InputError
        If a number is out of range, if the start violates the rolling model, if a command is not
        defined over the duration, if an actuator has a hinge that it cannot move, or if there is no
        motor that the controller could command.

    Examples
    --------
    >>> import robotball as rb
    >>> scene = rb.load_scene("fig12")
    >>> scene.rolling, [hinge.name for hinge in scene.hinges]
    ('rubber', ['frame', 'rotor1'])
    >>> faster = scene.with_hinges(command={"frame": 3.0})
    >>> faster.hinges[0].rate
    3.0
    """

    name: str
    title: str
    source: str
    ball: Ball
    rolling: Rolling
    start: Start
    duration: float
    gravity: float = GRAVITY
    gravity_direction: tuple[float, float, float] = DOWN
    friction: Friction = field(default_factory=Friction)
    actuators: "tuple[Actuator, ...]" = ()
    controller: "Controller | None" = None
    plane_motion: tuple[Rate, Rate, Rate] = (0.0, 0.0, 0.0)
    plane_rotation: Rate = 0.0

    def __post_init__(self) -> None:
        if self.rolling not in ROLLING_MODELS:
            raise InputError(f"rolling must be one of {ROLLING_MODELS}, not {self.rolling!r}")
        check_positive("duration", self.duration, "s")
        check_positive("gravity", self.gravity, "m/s²")
        _ = self.hinges  # converts and checks the commands
        name = "gravity_direction"
        down = unit(name, as_floats(name, self.gravity_direction, (3,)))
        if not down[2] < 0:
            line = f"its component Z must be negative, not {down[2]:.6g}"
            raise InputError(f"gravity_direction must press the ball on the plane: {line}")
        self._set(gravity_direction=tuple(down.tolist()))
        self._set(start=self._exact(self.start))
        self._check_motors()

    def _exact(self, start: Start) -> Start:
        """Return a start without rounding errors; InputError if it violates the rolling model."""
        if not isinstance(start, Start):
            raise InputError(f"a scene's start must be Start(attitude, momentum), not {start!r}")
        for component in start.momentum.tolist():
            check_size("the start's momentum", component, "kg m²/s", LARGEST**3)
        attitude, momentum = unit("attitude", start.attitude), start.momentum
        if self.rolling == "rubber":
            momentum = horizontal(momentum, self._scale_of(momentum))
        self._check_slip(start.slip)
        # Engines that each normalised the start would begin from different states.
        return Start(attitude, momentum, start.slip)

    def _check_slip(self, slip: Array) -> None:
        """Raise InputError unless the scene's friction permits the start's slip (3,)."""
        kinds = ("sliding", "sliding", "torsional")
        for value, kind, limit in zip(slip.tolist(), kinds, self.slip_limits, strict=True):
            check_size("the start's slip", value)
            if not value or np.isfinite(limit):
                continue
            if kind == "torsional" and self.rolling == "classical":
                raise InputError(
                    f"the start's slip has a spin of {value:g} rad/s, but in the classical model "
                    "the spin is part of M: give the spin with the momentum or the angular velocity"
                )
            raise InputError(
                f"the start's slip is {slip.tolist()}, but friction.{kind} has no limit: give "
                f"friction.{kind} a value, or start without this slip"
            )

    def _check_motors(self) -> None:
        """Raise InputError unless there are hinges that actuators and the controller can move."""
        motorized = [hinge.name for hinge in self.hinges if hinge.motor]
        for actuator in self.actuators:
            for name, ratio in actuator.gears:
                check_size(f"{actuator.name}'s gear", ratio)
                if name not in motorized:
                    line = "that hinge has a prescribed rate, or does not exist"
                    known = f"hinges with a motor: {', '.join(motorized) or 'none'}"
                    raise InputError(f"{actuator.name} cannot move {name!r}: {line}; {known}")
        if self.controller is not None and not self.actuators:
            from robotball.robot.motors import Free  # few scenes have a controller

            if all(isinstance(hinge.motor, Free | None) for hinge in self.hinges):
                line = "has no motor for the controller: give a hinge a motor, for example Servo"
                raise InputError(f"{self.name} {line}")

    def __repr__(self) -> str:
        ball = self.ball
        inside = [counted(len(ball.rotors), "rotor")] if ball.rotors else []
        inside += [counted(len(ball.pendulums), "pendulum")] if ball.pendulums else []
        parts = [self.rolling, *inside, f"{ball.mass:.4g} kg", f"radius {ball.radius:.4g} m"]
        return f"<Scene {self.name}: {', '.join(parts)}; {self.duration:g} s>"

    @cached_array
    def times(self) -> Array:
        """The default sample times (n,), from 0 to the duration [s]."""
        return sample_times(self.duration)

    @cached_array
    def principal_axes(self) -> Array:
        """Rotation (3, 3) from principal axes to frame axes: v_frame = principal_axes @ v."""
        return self.ball.principal[1]

    @cached_array
    def principal_quaternion(self) -> Array:
        """`principal_axes` as a quaternion (4,)."""
        return from_matrix(self.principal_axes)

    @cached_property
    def hinges(self) -> tuple[MovedHinge, ...]:
        """The ball's hinges in their initial state, with drives over the scene's duration."""
        hinges = []
        for hinge, link in zip(self.ball.hinges, self.ball.tree[1:], strict=True):
            command, rate = self._drive(link.name, hinge.command), hinge.rate
            if rate is None:  # the command of a Torque or a PositionServo is not a rate
                follows = hinge.motor is None or hinge.motor.follows_rate
                rate = float(command.rate(0.0)) if follows else 0.0
            hinges.append(MovedHinge(link, command, hinge.motor, float(hinge.angle), float(rate)))
        return tuple(hinges)

    @cached_property
    def drives(self) -> tuple[Drive, ...]:
        """The commands of the hinges."""
        return tuple(hinge.command for hinge in self.hinges)

    def _drive(self, name: str, rate: Rate) -> Drive:
        with named(name):
            return as_drive(rate, self.duration)

    @cached_property
    def controls(self) -> tuple[Drive, ...]:
        """The commands of the actuators."""
        return tuple(self._drive(a.name, a.control(self.duration)) for a in self.actuators)

    @cached_property
    def plane_drives(self) -> tuple[Drive, ...]:
        """The acceleration of the plane along X, Y and Z."""
        if len(self.plane_motion) != 3:
            raise InputError(f"plane_motion must be 3 rates (X, Y, Z), not {self.plane_motion}")
        return tuple(map(self._drive, map("the plane along {}".format, "XYZ"), self.plane_motion))

    @cached_property
    def plane_turn(self) -> Drive:
        """The rotation of the plane: `rate(t)` is its rate and `angle(t)` its angle."""
        return self._drive("the rotation of the plane", self.plane_rotation)

    @cached_property
    def _over_time(self) -> tuple[Drive, ...]:
        """All functions of time in the scene."""
        return (*self.drives, *self.controls, *self.plane_drives, self.plane_turn)

    def with_hinges(self, **given: Any) -> "Scene":
        """Return the scene with new values for fields of its hinges, see `Ball.with_hinges`."""
        return replace(self, ball=self.ball.with_hinges(**given))

    def from_start(self, start: Start) -> "Scene":
        """Return the scene with another start, without computing anything else again.

        The two scenes share all cached properties that do not depend on the start.
        """
        scene = copy(self)
        scene._set(start=self._exact(start))
        return scene

    def with_controller(self, controller: "Controller") -> "Scene":
        """Return the scene with a controller."""
        return replace(self, controller=controller)

    def check_open(self, format: str) -> None:
        """Raise InputError if the scene has a controller, which the format cannot store."""
        if self.controller is not None:
            line = f"{format} cannot hold a controller; write the scene without it"
            raise InputError(f"{self.name}: {line}")

    @cached_property
    def robot(self) -> "Robot":
        """The bodies and armatures as numbers for `robotball.robot.mechanics`."""
        # Balanced scenes with given rates are integrated with (3.2) or (3.3), which do not need
        # `robotball.robot.mechanics`.
        from robotball.robot.mechanics import robot_of

        return robot_of(self.ball)

    @cached_array
    def hinged(self) -> Array:
        """Initial hinge angles and rates (2, 1, h), as one state of `robot`."""
        return np.array([[[h.angle for h in self.hinges]], [[h.rate for h in self.hinges]]])

    @property
    def gravity_world(self) -> Array:
        """G (3,) in world axes [m/s²]."""
        return self.gravity * np.array(self.gravity_direction)

    def gravity_at(self, t: Any) -> Array:
        """Return gravity (..., 3) relative to the moving plane at times t (...) [s], world axes."""
        return self.gravity_world - np.array([drive.rate(t) for drive in self.plane_drives]).T

    @cached_property
    def plane_moves(self) -> bool:
        """True if the plane is accelerated at some time."""
        return any(map(turns, self.plane_drives))

    @cached_property
    def plane_turns(self) -> bool:
        """True if the plane turns at some time."""
        return turns(self.plane_turn)

    @property
    def plane_is_still(self) -> bool:
        """True if the plane neither moves nor turns."""
        return not (self.plane_moves or self.plane_turns)

    def plane_velocity(self, t: Any, points: Array) -> Array:
        """Return the velocity of the turning plane (..., 3) at points (..., 2) and times t (...).

        Its components are the velocity along X and Y [m/s], and the rate of rotation [rad/s].
        """
        spin = np.asarray(self.plane_turn.rate(t), dtype=float)
        x, y = turntable_velocity(spin, (points[..., 0], points[..., 1]))
        return np.stack([x, y, spin + 0 * x], axis=-1)

    def slip_of(self, t: Any, points: Array, velocity: Array, turning: Array) -> Array:
        """Return the slip (..., 3) of a shell at points (..., 2) and times t (...).

        The slip has the components of `Start.slip`, relative to the plane. velocity (..., 2): of
        the sphere's centre [m/s]; turning (..., 3): of the shell, world axes [rad/s].
        """
        a, spin = self.ball.radius, turning[..., 2]
        x, y = velocity[..., 0] - a * turning[..., 1], velocity[..., 1] + a * turning[..., 0]
        return np.stack([x, y, spin], axis=-1) - self.plane_velocity(t, points)

    def plane_acceleration(self, t: float, x: float, y: float, vx: float, vy: float) -> list[float]:
        """Return the rate of `plane_velocity` at a point (x, y) [m] that moves with (vx, vy) [m/s].

        This is not the acceleration of the plane's matter, because the point moves on the plane.
        """
        spin, faster = float(self.plane_turn.rate(t)), float(self.plane_turn.acceleration(t))
        there, moved = turntable_velocity(faster, (x, y)), turntable_velocity(spin, (vx, vy))
        return [there[0] + moved[0], there[1] + moved[1], faster]

    @property
    def start_slip(self) -> Array:
        """The slip of the start (3,) relative to a plane that does not turn.

        A ball on a turning plane starts at the plane's axis; a rubber shell turns with the plane.
        """
        of_plane = self.plane_velocity(0.0, np.zeros(2))
        return self.start.slip + (of_plane if self.rolling == "rubber" else 0.0)

    @property
    def contact_moves(self) -> bool:
        """True if the shell's point at the contact may move: it slips, or the plane turns."""
        return self.may_slip or self.plane_turns

    @cached_property
    def level(self) -> bool:
        """True if gravity, in the frame of the moving plane, stays normal to the plane."""
        return self.gravity_direction == DOWN and not any(map(turns, self.plane_drives[:2]))

    @cached_property
    def not_reduced(self) -> str | None:
        """The reason why (3.2) and (3.3) do not describe the scene; None if they do."""
        if offset := imbalance(self.ball):
            return offset
        if self.ball.pendulums:
            return "a pendulum moves the centre of mass"
        if self.ball.general:
            return "the bodies are a tree of links, or the shell is not symmetric"
        if any(hinge.motor for hinge in self.hinges):
            return "a hinge has a motor, so its rate is not prescribed"
        if not self.level:
            return "the plane is inclined or moves sideways"
        if self.plane_turns:
            return "the plane turns"
        if self.friction.rolling:
            return "the plane resists rolling"
        return None

    def check_reduced(self) -> None:
        """Raise InputError if (3.2) and (3.3) do not describe the scene."""
        if self.not_reduced:
            needed = "(3.2) and (3.3) need a balanced ball with given rates on a level plane"
            raise InputError(f"{self.name}: equations {needed}, but {self.not_reduced}")

    @property
    def load_varies(self) -> bool:
        """True if the normal force may change."""
        return self.plane_moves or self._off_centre

    @cached_property
    def _off_centre(self) -> bool:
        """True if the centre of mass is ever off the sphere's centre."""
        # A pendulum with its pivot at its centre of mass does not move the centre of mass.
        pivots = [body.pivot - body.centre for body in self.ball.pendulums]
        swings = [np.cross(b.axis, p) for b, p in zip(self.ball.pendulums, pivots, strict=True)]
        far = ROUNDING * self.ball.radius
        moves = self.ball.general or any(np.linalg.norm(s) > far for s in swings)
        return imbalance(self.ball) is not None or moves

    @property
    def slip_limits(self) -> Array:
        """Friction coefficients (3,) along X, along Y and about Z [m]; inf for no limit."""
        slide, spin = self.friction.sliding, self.friction.torsional
        # The classical model does not constrain the spin.
        limits = slide, slide, spin if self.rolling == "rubber" else None
        return np.array([np.inf if limit is None else limit for limit in limits])

    @property
    def may_slip(self) -> bool:
        """Whether the friction of the plane is limited."""
        return bool(np.isfinite(self.slip_limits).any())

    @property
    def ideal(self) -> "Scene":
        """The scene with unlimited friction, whose start does not slip."""
        friction = replace(self.friction, sliding=None, torsional=None)
        return replace(self, friction=friction, start=replace(self.start, slip=np.zeros(3)))

    @cached_property
    def keeps_momentum(self) -> bool:
        """True if M is constant in space.

        This needs a balanced ball on a level plane without resistance to rolling. The plane may
        move up and down, but not turn. The ball may slip: sliding friction has no moment about the
        contact point, and torsional friction has no moment about a horizontal axis.
        """
        if self.friction.rolling or self.plane_turns:
            return False
        return self.level and not self._off_centre

    def until(self, end: float) -> "Scene":
        """Return the scene of a run that ends at `end` [s]; its drives cover 0 to `end`.

        Raises InputError if a function of time jumps before the end.
        """
        if self.steady and not self.may_slip:
            return self
        scene = replace(self, duration=end)
        _ = scene.breakpoints  # raises before the run, not during it
        return scene

    @cached_property
    def breakpoints(self) -> tuple[float, ...]:
        """Times after 0 at which a drive is not smooth or the controller acts [s]."""
        stops = {*self.controller.stops(self.duration)} if self.controller else set()
        return tuple(sorted({t for d in self._over_time for t in d.breakpoints if t > 0} | stops))

    @cached_property
    def largest_rates(self) -> tuple[float, ...]:
        """The largest absolute value of each hinge's command over the scene's duration."""
        times = uneven(self.duration, self.duration / _RATE_SAMPLES)
        return tuple(float(np.abs(drive.rate(times)).max()) for drive in self.drives)

    @cached_property
    def rate_scales(self) -> tuple[float, ...]:
        """The rates by which the errors of each hinge's rate are divided.

        This is the largest command. If the command is 0 over the whole scene, or tiny, it is the
        rate of a ball that fell by its radius.
        """
        falling, a = math.sqrt(self.gravity / self.ball.radius), self.ball.radius
        units = [a * falling if hinge.body.slides else falling for hinge in self.hinges]
        both = zip(self.largest_rates, units, strict=True)
        return tuple(largest if largest > _AT_REST * unit else unit for largest, unit in both)

    @cached_property
    def steady(self) -> bool:
        """True if all rates and the plane's acceleration and rotation are constant."""
        return self.controller is None and all(isinstance(d, Constant) for d in self._over_time)

    def sampling_error(self, end: float, timestep: float, rule: Rule = SIMPSON) -> float:
        """Return `sampling_error` of the scene's drives, for steps [s] in a run to `end` [s]."""
        stops = np.array([0.0, *(t for t in self.breakpoints if t < end), end])
        return sampling_error(self._over_time, stops, timestep, rule)

    def parameters_at(self, t: float) -> Parameters:
        """Return the parameters of the equations at time t [s], in principal axes."""
        return parameters_of(self.ball, self.rolling, [float(d.rate(t)) for d in self.drives])

    @cached_property
    def parameters(self) -> Parameters:
        """The parameters of (3.2) or (3.3), in principal axes; InputError if they change."""
        self.check_reduced()
        if not self.steady:
            raise InputError(f"{self.name}: a drive or the plane varies; use parameters_at(t)")
        return self._first_parameters

    @cached_property
    def _first_parameters(self) -> Parameters:
        return self.parameters_at(0.0)

    @property
    def momentum_scale(self) -> float:
        """The scale by which errors of M are divided [kg m²/s]: |M| at the start, unless small.

        For a ball that starts from rest, M is 0 or a rounding error. K and dΩ then turn the ball,
        so the scale follows from K and dΩ. If K and dΩ are also zero, the scale is M of a ball that
        fell by its radius. So the scale is proportional to the masses in any unit of mass.
        """
        return self._scale_of(self.start.momentum)

    def _scale_of(self, momentum: Array) -> float:
        size, (least, falling) = math.hypot(*momentum.tolist()), self._least_scale
        return max(size, least) or falling

    @cached_property
    def _least_scale(self) -> tuple[float, float]:
        """The least `momentum_scale` at any start; the scale if M, K and dΩ are 0 [kg m²/s]."""
        falling = self.ball.d * float(np.sqrt(self.gravity / self.ball.radius))
        if self.not_reduced:
            return falling, falling
        with np.errstate(over="ignore", invalid="ignore"):  # the equations refuse an overflow
            numbers = self._first_parameters
        turned = math.hypot(*numbers.K) + numbers.d * math.hypot(*numbers.Omega)
        return _SMALL * turned, falling

    def angular_velocity_at(self, start: Start) -> Array:
        """Return ω (3,) of the frame at a start of this ball, in frame axes [rad/s]."""
        to_frame = start.to_world.T
        if self.not_reduced:
            angles, rates = self.hinged
            gamma, M = to_frame[None, :, 2], (to_frame @ start.momentum)[None]
            return self.robot.angular_velocity(gamma, angles, M, rates, self.rolling)[0]
        to_principal = self.principal_axes.T @ to_frame
        M, gamma = to_principal @ start.momentum, to_principal[:, 2]
        omega = self._first_parameters.angular_velocity(as_vector(M), as_vector(gamma))
        return self.principal_axes @ np.array(omega)

    def momentum_of(self, omega: Array) -> Array:
        """Return M (3,) in world axes for ω (3,) of the frame at the start, in frame axes [rad/s].

        In the rubber model, ω must be such that the shell does not spin.
        """
        return np.asarray(self.start.to_world @ self.states_of(omega).momentum(self.rolling)[0])

    def states_of(self, omega: Array) -> "States":
        """Return the initial state of the robot for ω (3,) of the frame, frame axes [rad/s]."""
        gamma, (angles, rates) = self.start.to_world[None, 2], self.hinged
        return self.robot.states(gamma, angles, omega[None], rates)
