"""Find the drives that roll a robot's contact point along a wanted path.

The path determines the horizontal angular velocity of the shell, because the shell does not slip.
M follows from its differential equation, so (L, h) = 𝓜u gives equations for the hinge rates at
every time. There are two equations in the rubber model, and three in the classical model, in which
the shell's spin is also unknown. If there are more hinges than needed, the solution with the least
energy is taken.

`shortfalls` reports torques, rates and friction beyond the robot's limits.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

from robotball.errors import InputError, check_positive, check_size
from robotball.motion import Motion
from robotball.robot.drives import Ramp, Samples, turns
from robotball.robot.motors import Free
from robotball.robot.scene import MovedHinge, Scene, Start
from robotball.rotations import Array, Mask, continuous, rotation_matrix, turned
from robotball.theory.multibody.derivative import HINGES, MOMENTUM, Readings, readings_of
from robotball.theory.multibody.system import System
from robotball.theory.plane import check_no_turn

_FINE = 2001  # points of a path; the sum of the chords is 4e-7 too short for a circle
# Fraction of the duration to wait before and after the path. Hanging weights must swing to one side
# before the ball starts, and come to rest after it stops.
_WAITING = 0.05
_ASTRAY = 1e100  # a larger state is useless, and the square of a much larger one is infinite
_INTERVAL = 0.04  # s between the samples of a drive, which are interpolated with cubics
_TOLERANCE = 1e-7  # of the integration; the interpolation of the drives has an error of 3e-5 m
_BVP_TOLERANCE, _MOST_NODES = 1e-5, 20_000
_SINGULAR = 1e-4  # ratio of singular values below which the hinges cannot move the ball
_BALANCED, _ITERATIONS = 1e-13, 20  # last change of the angles [rad], iterations (usually 4)
_FASTEST = 1e4  # rad/s, faster than any motor; reached only close to a singularity


@dataclass(frozen=True)
class WantedPath:
    """A curve on the plane: point (2,) and its derivative (2,) [m] at u from 0 to 1."""

    name: str
    point: Callable[[float], Array]
    slope: Callable[[float], Array]

    @property
    def length(self) -> float:
        """Length of the curve [m], computed as a sum of chords."""
        points = np.array([self.point(u) for u in np.linspace(0, 1, _FINE).tolist()])
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def straight(length: float) -> WantedPath:
    """Return a straight line of the given length [m]."""
    check_positive("the line's length", length, "m")
    along = np.array([length, 0.0])
    return WantedPath("line", lambda u: u * along, lambda u: along)


def circle(radius: float, turns: float = 1.0) -> WantedPath:
    """Return a circle of the given radius [m] that bends left, or right if turns < 0."""
    check_positive("the circle's radius", radius, "m")
    check_size("the circle's turns", turns)
    if turns == 0:
        raise InputError("the circle's turns must not be 0")
    angle, side = 2 * np.pi * abs(turns), np.array([1.0, np.sign(turns)])

    def point(u: float) -> Array:
        return radius * side * np.array([np.sin(angle * u), 1 - np.cos(angle * u)])

    def slope(u: float) -> Array:
        return radius * angle * side * np.array([np.cos(angle * u), np.sin(angle * u)])

    return WantedPath("circle", point, slope)


def eight(size: float) -> WantedPath:
    """Return a figure eight that crosses at the origin and extends `size` [m] to each side."""
    check_positive("the figure's size", size, "m")
    turn = 2 * np.pi

    def point(u: float) -> Array:
        return size * np.array([np.sin(turn * u), np.sin(2 * turn * u) / 2])

    def slope(u: float) -> Array:
        return size * turn * np.array([np.cos(turn * u), np.cos(2 * turn * u)])

    return WantedPath("eight", point, slope)


def through(points: Sequence[Sequence[float]]) -> WantedPath:
    """Return a smooth curve from the origin through points (n, 2) [m]."""
    corners = np.array([(0.0, 0.0), *points], dtype=float)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 2:
        raise InputError("waypoints must be one or more pairs X,Y [m]")
    for number in corners.ravel().tolist():
        check_size("a waypoint", number, "m")
    apart = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    if not apart.min() > 0:
        raise InputError(f"waypoint {int(apart.argmin()) + 1} repeats the point before it")
    spline = CubicSpline(np.concatenate([[0.0], np.cumsum(apart) / apart.sum()]), corners)
    return WantedPath("waypoints", spline, spline.derivative())


@dataclass(frozen=True)
class _Steered:
    """The drives that roll a robot along a path.

    scene: the robot with these drives as prescribed hinge rates, starting from rest; times (n,)
    [s]; rates (n, h) of the hinges [rad/s]; wanted (n, 2): wanted contact points [m].
    """

    scene: Scene
    times: Array
    rates: Array
    wanted: Array


def steer(scene: Scene, path: WantedPath, duration: float) -> _Steered:
    """Find the drives that move a robot along a path, from rest to rest, in a duration [s].

    Hinges with a rate or a motor are driven. The shell starts as in the scene, and hanging weights
    start in equilibrium. Raises InputError if there are fewer than two driven hinges, if there is
    rolling friction, or if at some time the hinges cannot roll the ball as wanted.
    """
    check_positive("the duration", duration, "s")
    check_no_turn(scene, "steering")
    if scene.friction.rolling:
        raise InputError(f"{scene.name}: steering does not support rolling friction; set it to 0")
    # Hinges with neither rate nor motor are fixed; hinges with a `Free` motor cannot be driven.
    driven = np.array([_is_driven(hinge) for hinge in scene.hinges])
    if driven.sum() < 2:
        line = f"has {driven.sum()} driven hinges and needs two; give more hinges a rate or a motor"
        raise InputError(f"{scene.name} {line}")
    way = _Way(scene, path, duration, driven)
    times = np.linspace(0.0, duration, int(np.ceil(duration / _INTERVAL)) + 1)
    y = _forward(way, times) if scene.keeps_momentum else _bounded(way, times)
    rates, reach = way.rates(times, y)
    _check_reach(scene, times, rates, reach)
    samples: list[Any] = [
        Samples(times=tuple(times.tolist()), values=tuple(column.tolist())) if on else 0.0
        for column, on in zip(rates.T, driven, strict=True)
    ]
    steered = replace(
        scene,
        name=f"{scene.name}_{path.name}",
        title=f"{scene.title}, steered along the {path.name}",
        ball=scene.ball.with_hinges(command=samples, motor=[None] * len(samples), angle=y[7:, 0]),
        duration=duration,
        # Take the start of the solution, which satisfies the boundary conditions to a tolerance.
        start=Start(y[:4, 0] / np.linalg.norm(y[:4, 0]), np.zeros(3)),
    )
    return _Steered(steered, times, rates, way.point(times))


def _is_driven(hinge: MovedHinge) -> bool:
    return not isinstance(hinge.motor, Free) and (hinge.motor is not None or turns(hinge.command))


def _check_reach(scene: Scene, times: Array, rates: Array, reach: Array) -> None:
    speeds = np.abs(rates).max(axis=1)
    least, fastest = int(reach.argmin()), int(speeds.argmax())
    speed = float(speeds[fastest])
    if reach[least] < _SINGULAR:
        line = "the hinges cannot roll the ball in every direction; choose another path or attitude"
        raise InputError(f"{scene.name}: at t = {times[least]:.4g} s {line}")
    if not speed < _FASTEST:
        line = f"a hinge needs {speed:.3g} rad/s; increase the duration or choose another path"
        raise InputError(f"{scene.name}: at t = {times[fastest]:.4g} s {line}")


def shortfalls(robot: Scene, motion: Motion, rate_limit: float = math.inf) -> list[str]:
    """Return a line for each limit of the robot or plane that the motion exceeds.

    robot: the scene with its motors and friction; motion: the motion of the steered scene;
    rate_limit: the largest allowed rate of every hinge [rad/s].
    """
    lines, loads = [], motion.loads
    for i, hinge in enumerate(robot.hinges):
        torque = float(np.abs(loads.motor_torques[:, i]).max())
        limit = hinge.motor.law.limit if hinge.motor else math.inf
        if torque > limit:
            lines.append(f"{hinge.name} needs {torque:.3g} N m; its motor gives only {limit:g} N m")
        rate = float(np.abs(motion.hinge_rates[:, i]).max())
        if rate > rate_limit:
            lines.append(f"{hinge.name} turns at {rate:.3g} rad/s, above {rate_limit:g} rad/s")
    if slipping := getattr(motion, "slipping", ()):
        lines.append(f"slips from t = {slipping[0][0]:.3g} s: give the plane more friction")
    friction = robot.friction
    sliding = float(loads.sliding_friction.max())
    if friction.sliding is not None and sliding > friction.sliding:
        lines.append(f"slips: friction.sliding must be {sliding:.3g}, not {friction.sliding:g}")
    torsional = float(loads.torsional_friction.max())
    if friction.torsional is not None and torsional > friction.torsional:
        own = f"not {friction.torsional:g} m"
        lines.append(f"spins: friction.torsional must be {torsional:.3g} m, {own}")
    return lines


class _Way:
    """Differential equation of y = (q, M, hinge angles) along a path, vectorised over n times."""

    def __init__(self, scene: Scene, path: WantedPath, duration: float, driven: Mask) -> None:
        self.scene, self.path, self.driven, self.robot = scene, path, driven, scene.robot
        none = [None] * len(driven)
        held = scene.with_hinges(motor=none, command=np.zeros(len(driven)))
        self.held = replace(held.ideal, plane_motion=(0.0, 0.0, 0.0))
        # The trials: all rates 0, then a unit rate of each driven hinge.
        self.trials = np.vstack([np.zeros(len(driven)), np.eye(len(driven))[driven]])
        self._systems = lru_cache(maxsize=4)(self._system)
        wait = _WAITING * duration
        # With a quintic ramp, accelerations and torques are continuous at both ends.
        self.part = Ramp(initial=0.0, final=1.0, start=wait, end=duration - wait, shape="quintic")

    def start(self) -> Array:
        """Return y (7 + h,) of the scene's robot at rest."""
        angles = [hinge.angle for hinge in self.scene.hinges]
        return np.array([*self.scene.start.attitude, 0.0, 0.0, 0.0, *angles])

    def point(self, times: Array) -> Array:
        """Return the wanted contact point (n, 2) [m]."""
        return np.array([self.path.point(u) for u in self._parts(times)])

    def _parts(self, times: Array) -> list[float]:
        # A solver may use times slightly beyond the ends, where a spline would extrapolate.
        return np.clip(self.part.rate(times), 0.0, 1.0).tolist()

    def rolling(self, times: Array) -> Array:
        """Return the shell's horizontal angular velocity (n, 3), world axes [rad/s]."""
        slopes = np.array([self.path.slope(u) for u in self._parts(times)])
        velocity = slopes * self.part.acceleration(times)[:, None] / self.scene.ball.radius
        return np.column_stack([-velocity[:, 1], velocity[:, 0], np.zeros(len(times))])

    def _system(self, n: int, standing: bool) -> System:
        system = System(*[self.held] * n)
        if standing:
            bodies = np.repeat(self.robot.bodies[None], n, axis=0)  # with the motors' armatures
            system.machine = system.machine._replace(bodies=bodies, spin_free=True)
            system.modes = system.modes._replace(standing=True)
            system.inputs.plane[:: len(self.trials), 0, 4] = 1.0
        return system

    def _run(
        self, y: Array, rates: Array, gravity: Array | float = 0.0, standing: bool = False
    ) -> tuple[Array, Readings]:
        """Return derivatives (n, size) and readings of states y (7 + h, n) at hinge rates (n, h).

        standing: whether the shell is at rest; then there are accelerations in place of rates, and
        the first of the `trials` also accelerates the shell about the vertical.
        """
        system = self._systems(len(rates), standing)
        inputs, state = system.inputs, np.zeros((len(rates), system.size))
        inputs.gravity[:, 0] = gravity
        (inputs.accelerations if standing else inputs.rates)[:, 0] = rates
        state[:, :4], state[:, MOMENTUM : MOMENTUM + 3] = y[:4].T, y[4:7].T
        state[:, HINGES : HINGES + rates.shape[1]] = y[7:].T
        base, slopes, none = state.ravel(), np.empty((1, state.size)), np.zeros((1, 1))
        system.stages(none[0], 0.0, none, base, np.zeros_like(base), slopes)
        return slopes.reshape(state.shape), readings_of(system.stage_numbers[:, 0], rates.shape[1])

    def _inertias(self, y: Array, trials: Array) -> Array:
        """Return inertias (n, 1 + d): of the robot about the vertical, and along driven hinges."""
        _, readings = self._run(y, trials, standing=True)
        torques = np.column_stack([readings.plane_torque[:, 2], readings.torques[:, self.driven]])
        return np.einsum("njj->nj", torques.reshape(-1, *[len(self.trials)] * 2))

    def rates(self, times: Array, y: Array) -> tuple[Array, Array]:
        """Return the rates (n, h) of the hinges in states y (7 + h, n), and their reach (n,).

        The reach is the ratio of the least to the largest singular value of the map from hinge
        rates to rolling.
        """
        n, d, rubber = len(times), len(self.trials) - 1, self.scene.rolling == "rubber"
        every, trials = np.repeat(y, d + 1, axis=1), np.tile(self.trials, (n, 1))
        # The shell's rolling and its spin are linear in the rates of the hinges.
        _, readings = self._run(every, trials)
        turning = np.column_stack([readings.rolling[:, :2], readings.slip[:, 2]])
        turning = turning.reshape(n, d + 1, 3)
        right = self.rolling(times) - turning[:, 0]
        left = (turning[:, 1:] - turning[:, :1]).transpose(0, 2, 1)
        # If the unknowns are scaled by the inertia of each hinge, the least-norm solution has the
        # least energy.
        weights = 1 / np.sqrt(self._inertias(every, trials))
        left *= weights[:, None, 1:]
        if rubber:
            left, right = left[:, :2], right[:, :2]
        else:
            spin = weights[:, :1, None] * np.array([[0.0], [0.0], [-1.0]])
            left = np.concatenate([left, spin], axis=2)
        singular = np.linalg.svd(left, compute_uv=False)
        solution = np.einsum("nij,nj->ni", np.linalg.pinv(left), right)
        rates = np.zeros((n, len(self.driven)))
        rates[:, self.driven] = weights[:, 1:] * solution[:, :d]
        return rates, singular[:, -1] / singular[:, 0]

    def rate(self, times: Array, y: Array) -> Array:
        """Return dy/dt (7 + h, n); NaN for useless states, so that solvers reject them."""
        astray = ~(np.abs(y).max(axis=0) < _ASTRAY)
        if astray.any():
            y = np.where(astray, self.start()[:, None], y)
        rates, _ = self.rates(times, y)
        slopes, _ = self._run(y, rates, self.scene.gravity_at(times))
        parts = slopes[:, :4], slopes[:, MOMENTUM : MOMENTUM + 3], rates
        return np.where(astray, np.nan, np.concatenate(parts, axis=1).T)


def _forward(way: _Way, times: Array) -> Array:
    """Return y (7 + h, n), integrated forward from the start."""
    # Gravity exerts no torque on a balanced ball, so no weight can fall to one side.
    span, off = (0.0, float(times[-1])), _TOLERANCE

    def rate(t: float, y: Array) -> Array:
        return way.rate(np.array([t]), y[:, None])[:, 0]

    solved = solve_ivp(rate, span, way.start(), "DOP853", times, rtol=off, atol=off)
    if not solved.success:
        raise _no_drives(way)
    return np.asarray(solved.y)


def _no_drives(way: _Way) -> InputError:
    line = "no drives roll the ball along this path; increase the duration or choose gentler turns"
    return InputError(f"{way.scene.name}: {line}")


def _bounded(way: _Way, times: Array) -> Array:
    """Return the bounded solution y (7 + h, n) for hanging weights.

    If it were integrated forward in time, a weight would fall over. So M = 0 is imposed at the end.
    In the initial guess, the weights hang straight down.
    """
    # In the rubber model M is horizontal: its third component is 0 and not an unknown.
    count, start = 3 if way.scene.rolling == "classical" else 2, way.start()
    kept = [0, 1, 2, 3, *range(4, 4 + count), *range(7, len(start))]

    def whole(part: Array) -> Array:
        y = np.zeros((len(start), part.shape[1]))
        y[kept] = part
        return y

    guess = _hanging(way, times)[kept]
    first_q, first_angles = guess[:4, 0], guess[4 + count :, 0]

    def ends(first: Array, last: Array) -> Array:
        begin = (first[:4] - first_q, first[4 + count :] - first_angles)
        return np.concatenate([*begin, last[4 : 4 + count]])

    def rate(t: Array, part: Array) -> Array:
        return way.rate(t, whole(part))[kept]

    solved = solve_bvp(rate, ends, times, guess, tol=_BVP_TOLERANCE, max_nodes=_MOST_NODES)
    if not solved.success:
        raise _no_drives(way)
    return whole(solved.sol(times))


def _hanging(way: _Way, times: Array) -> Array:
    """Return y (7 + h, n) of a rolling shell with weights that hang below its centre."""
    robot, start = way.robot, way.start()
    e = way.scene.ball.shell.axis
    y = np.tile(start[:, None], len(times))
    shell = turned(start[:4], -start[7] * e)
    # Without slip, the attitude depends on the whole path, so it is integrated in small steps.
    fine = 8  # steps between two times, enough for an initial guess
    y[7:, 0] = start[7:]
    for i in range(len(times)):
        if i:
            step = (times[i] - times[i - 1]) / fine
            for k in range(fine):
                now = np.array([times[i - 1] + (k + 0.5) * step])
                shell = turned(shell, way.rolling(now)[0] @ rotation_matrix(shell) * step)
        y[7:, i] = _balanced(way, shell, y[7:, max(i - 1, 0)], first=i == 0)
        y[:4, i] = turned(shell, y[7, i] * e)
    y[:4] = continuous(y[:4].T).T
    rates = np.gradient(y[7:], times, axis=1)
    axes = rotation_matrix(y[:4].T)
    omega = np.einsum("ni,nij->nj", way.rolling(times), axes) + np.outer(rates[0], e)
    states = robot.states(axes[:, 2], y[7:].T, omega, rates.T)
    y[4:7] = np.einsum("nij,nj->in", axes, states.momentum(way.scene.rolling))
    return y


def _balanced(way: _Way, shell: Array, angles: Array, first: bool) -> Array:
    """Return hinge angles (h,) near `angles` with the centre of mass below the ball's centre.

    first: the weights may also balance above the centre at `angles`.
    """
    e, balanced, still = way.scene.ball.shell.axis, angles.copy(), np.zeros((3 + len(angles), 1))

    def off(driven: Array) -> tuple[Array, Array]:
        """Return the centre of mass (3,) over the radius, world axes, and its derivative (3, d)."""
        balanced[way.driven] = driven
        states = way.robot.moving(way.robot.pose(np.zeros((1, 3)), balanced[None]), still)
        frame = rotation_matrix(turned(shell, balanced[0] * e)) / way.scene.ball.radius
        slopes = states.pushes[:, 3:, 0] / way.robot.mass
        return frame @ states.centre_of_mass[0], frame @ slopes[:, way.driven]

    def height(driven: Array) -> tuple[float, Array]:
        centre, slopes = off(driven)
        return centre[2], slopes[2]

    driven = angles[way.driven]
    if first:
        driven = minimize(height, driven, method="BFGS", jac=True).x
    # The minimum of the height is flat and gives only half of the digits of the angles. The zero of
    # the horizontal offset gives all digits.
    for _ in range(_ITERATIONS):
        centre, slopes = off(driven)
        change = np.linalg.pinv(slopes[:2]) @ centre[:2]
        driven = driven - change
        if np.abs(change).max() < _BALANCED:
            break
    balanced[way.driven] = driven
    return balanced
