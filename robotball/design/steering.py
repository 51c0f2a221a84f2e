"""Find the drives that roll a robot's contact point along a wanted path.

The path determines the horizontal angular velocity of the shell, because it does not slip. M is
known from its equation, so (L, h) = 𝓜u gives equations for the hinge rates at every time: two in
the rubber model, and three in the classical model, where the shell's spin is unknown, too. If there
are more hinges, the solution with the least energy is taken.

`shortfalls` reports torques, rates and friction beyond the robot's limits.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares, minimize

from robotball.errors import InputError, check_positive, check_size
from robotball.motion import Motion
from robotball.robot import formulas as eq
from robotball.robot.drives import Ramp, Samples, turns
from robotball.robot.mechanics import States
from robotball.robot.motors import Free
from robotball.robot.scene import MovedHinge, Scene, Start
from robotball.rotations import Array, Mask, continuous, rotation_matrix, turned
from robotball.theory.plane import check_no_turn

_FINE = 2001  # points of a path, whose chords add up to its length; 4e-7 too short for a circle
# Fraction of the duration to wait before and after the path. Hanging weights must lean before the
# ball starts, and swing out after it stops.
_WAITING = 0.05
_ASTRAY = 1e100  # a larger state is useless, and its square would be infinite
_INTERVAL = 0.04  # s between the drives' samples, which are interpolated with cubics
_TOLERANCE = 1e-7  # of the integration; the drives' interpolation alone leaves 3e-5 m
_BVP_TOLERANCE, _MOST_NODES = 1e-5, 20_000
_SINGULAR = 1e-4  # ratio of singular values below which the hinges cannot move the ball
_FASTEST = 1e4  # rad/s, beyond any motor: needed only close to a singularity


@dataclass(frozen=True)
class WantedPath:
    """A curve on the plane: point (2,) and its derivative (2,) [m] at u from 0 to 1."""

    name: str
    point: Callable[[float], Array]
    slope: Callable[[float], Array]

    @property
    def length(self) -> float:
        """Length of the curve, as a sum of chords [m]."""
        points = np.array([self.point(u) for u in np.linspace(0, 1, _FINE).tolist()])
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def straight(length: float) -> WantedPath:
    """Return a straight line of the given length [m]."""
    check_positive("the line's length", length, "m")
    along = np.array([length, 0.0])
    return WantedPath("line", lambda u: u * along, lambda u: along)


def circle(radius: float, turns: float = 1.0) -> WantedPath:
    """Return a circle of a radius [m] that bends left, or right if turns < 0."""
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
    """Return a figure eight that crosses itself at the origin and extends `size` [m] both ways."""
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
        raise InputError("waypoints must be one or more pairs X,Y")
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

    scene: the robot with these drives, starting from rest, its hinge rates prescribed; times (n,)
    [s]; rates (n, h) of the hinges [rad/s]; wanted (n, 2): contact point [m].
    """

    scene: Scene
    times: Array
    rates: Array
    wanted: Array


@dataclass(frozen=True)
class _RobotMotion:
    """The motion of a robot at n times.

    axes (n, 3, 3); reach (n,): ratio of the smallest to the largest singular value of the map from
    hinge rates to momentum.
    """

    axes: Array
    states: States
    reach: Array


def steer(scene: Scene, path: WantedPath, duration: float) -> _Steered:
    """Find the drives that take a robot along a path, from rest to rest, in a duration [s].

    Hinges with a rate or a motor are driven. The shell starts as in the scene, hanging weights in
    equilibrium. Raises InputError for fewer than two driven hinges, rolling friction, or if the
    hinges cannot roll the ball as wanted at some time.
    """
    check_positive("the duration", duration, "s")
    check_no_turn(scene, "steering")
    if scene.friction.rolling:
        raise InputError(f"{scene.name}: steering does not support rolling friction; set it to 0")
    # Hinges with neither rate nor motor are fixed; free ones cannot be driven.
    driven = np.array([_is_driven(hinge) for hinge in scene.hinges])
    if driven.sum() < 2:
        line = f"{driven.sum()} driven hinges of two; give more hinges a rate or a motor"
        raise InputError(f"{scene.name}: {line}")
    way = _Way(scene, path, duration, driven)
    times = np.linspace(0.0, duration, int(np.ceil(duration / _INTERVAL)) + 1)
    y = _forward(way, times) if scene.keeps_momentum else _bounded(way, times)
    motion = way.motion(times, y)
    rates = motion.states.u[3:].T
    _check_reach(scene, times, motion)
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
        # Of the solution, which satisfies the boundary conditions up to a tolerance.
        start=Start(y[:4, 0] / np.linalg.norm(y[:4, 0]), np.zeros(3)),
    )
    return _Steered(steered, times, rates, way.point(times))


def _is_driven(hinge: MovedHinge) -> bool:
    return not isinstance(hinge.motor, Free) and (hinge.motor is not None or turns(hinge.command))


def _check_reach(scene: Scene, times: Array, motion: _RobotMotion) -> None:
    least, fastest = (
        int(motion.reach.argmin()),
        int(np.abs(motion.states.u[3:]).max(axis=0).argmax()),
    )
    if motion.reach[least] < _SINGULAR:
        line = "the hinges cannot roll the ball in every direction; choose another path or attitude"
        raise InputError(f"{scene.name}: at t = {times[least]:.4g} s {line}")
    speed = float(np.abs(motion.states.u[3:, fastest]).max())
    if not speed < _FASTEST:
        line = f"a hinge needs {speed:.3g} rad/s; increase the duration or choose another path"
        raise InputError(f"{scene.name}: at t = {times[fastest]:.4g} s {line}")


def shortfalls(robot: Scene, motion: Motion, rate_limit: float = math.inf) -> list[str]:
    """Return a line for each limit of the robot or plane that the motion exceeds.

    robot: the scene with its motors and friction; motion: of the steered scene; rate_limit: of
    every hinge [rad/s].
    """
    lines, loads = [], motion.loads
    for i, hinge in enumerate(robot.hinges):
        torque = float(np.abs(loads.motor_torques[:, i]).max())
        limit = hinge.motor.law.limit if hinge.motor else math.inf
        if torque > limit:
            lines.append(f"{hinge.name} needs {torque:.3g} N m; its motor gives {limit:g} N m")
        rate = float(np.abs(motion.hinge_rates[:, i]).max())
        if rate > rate_limit:
            lines.append(f"{hinge.name} turns at {rate:.3g} rad/s, of at most {rate_limit:g} rad/s")
    if slipping := getattr(motion, "slipping", ()):
        lines.append(f"slips from t = {slipping[0][0]:.3g} s: give the plane more friction")
    friction = robot.friction
    sliding = float(loads.sliding_friction.max())
    if friction.sliding is not None and sliding > friction.sliding:
        lines.append(f"slips: needs a sliding friction of {sliding:.3g}, has {friction.sliding:g}")
    torsional = float(loads.torsional_friction.max())
    if friction.torsional is not None and torsional > friction.torsional:
        has = f"has {friction.torsional:g} m"
        lines.append(f"spins: needs a torsional friction of {torsional:.3g} m, {has}")
    return lines


class _Way:
    """Differential equation of y = (q, M, hinge angles) along a path, vectorised over n times."""

    def __init__(self, scene: Scene, path: WantedPath, duration: float, driven: Mask) -> None:
        self.scene, self.path, self.driven, self.robot = scene, path, driven, scene.robot
        wait = _WAITING * duration
        # Quintic: acceleration is continuous at both ends, and so are torques.
        self.part = Ramp(initial=0.0, final=1.0, start=wait, end=duration - wait, shape="quintic")

    def start(self) -> Array:
        """Return y (7 + h,) of the scene's robot at rest."""
        angles = [hinge.angle for hinge in self.scene.hinges]
        return np.array([*self.scene.start.attitude, 0.0, 0.0, 0.0, *angles])

    def point(self, times: Array) -> Array:
        """Return the wanted contact point (n, 2) [m]."""
        return np.array([self.path.point(u) for u in self._parts(times)])

    def _parts(self, times: Array) -> list[float]:
        # A solver may evaluate slightly beyond the ends, where a spline would extrapolate.
        return np.clip(self.part.rate(times), 0.0, 1.0).tolist()

    def shell(self, times: Array, gamma: Array, axes: Array) -> Array:
        """Return the shell's horizontal angular velocity (n, 3), frame axes [rad/s]."""
        slopes = np.array([self.path.slope(u) for u in self._parts(times)])
        velocity = np.zeros((len(times), 3))
        velocity[:, :2] = slopes * self.part.acceleration(times)[:, None]
        in_frame = np.einsum("nji,nj->ni", axes, velocity)
        return np.asarray(np.cross(gamma, in_frame) / self.scene.ball.radius)

    def motion(self, times: Array, y: Array) -> _RobotMotion:
        """Return the motion of the robot in states y (7 + h, n)."""
        robot, scene, n = self.robot, self.scene, len(times)
        axes = rotation_matrix((y[:4] / np.linalg.norm(y[:4], axis=0)).T)
        gamma, rubber = axes[:, 2], scene.rolling == "rubber"
        shell = self.shell(times, gamma, axes)
        pose = robot.pose(gamma, y[7:].T)
        matrix = robot.matrix(pose)
        rows = np.einsum("nij,jkn->nik", axes, matrix[:3])  # L in space
        # In the rubber model M = γ×L, so L = M×γ except for its vertical component, which is free.
        M = y[4:7].T
        L = np.column_stack([M[:, 1], -M[:, 0], 0 * M[:, 0]]) if rubber else M
        right = L - np.einsum("nij,nj->ni", rows[:, :, :3], shell)
        # In unknowns scaled by each hinge's inertia, the least-norm solution has the least energy.
        weights = 1 / np.sqrt(np.einsum("jjn->nj", matrix[3:, 3:])[:, self.driven])
        left = rows[:, :, 3:][:, :, self.driven] * weights[:, None]
        if rubber:
            left, right = left[:, :2], right[:, :2]
        else:
            spin = np.einsum("nij,nj->ni", rows[:, :, :3], gamma)
            spinning = 1 / np.sqrt(matrix[0, 0])
            left = np.concatenate([left, (spin * spinning[:, None])[:, :, None]], axis=2)
        singular = np.linalg.svd(left, compute_uv=False)
        solution = np.einsum("nij,nj->ni", np.linalg.pinv(left), right)
        rates = np.zeros((n, robot.hinges))
        rates[:, self.driven] = weights * solution[:, : self.driven.sum()]
        if not rubber:
            shell = shell + gamma * (solution[:, -1] * spinning)[:, None]
        reach = singular[:, -1] / singular[:, 0]
        states = robot.moving(pose, np.concatenate([shell.T, rates.T]))
        return _RobotMotion(axes, states, reach)

    def rate(self, times: Array, y: Array) -> Array:
        """Return dy/dt (7 + h, n); NaN for states that are astray, so that solvers reject them."""
        # Written with ~ so that NaN counts as astray.
        astray = ~(np.abs(y).max(axis=0) < _ASTRAY)
        if astray.any():
            y = np.where(astray, self.start()[:, None], y)
        scene, now = self.scene, self.motion(times, y)
        G = np.einsum("nji,nj->in", now.axes, scene.gravity_at(times))
        L_rate = np.einsum("nij,jn->in", now.axes, now.states.torque(G))
        if scene.rolling == "rubber":
            L_rate = np.stack([-L_rate[1], L_rate[0], 0 * L_rate[0]])
        w, x, y_, z = y[:4]
        spin = eq.attitude_rate((w, x, y_, z), tuple(now.states.turning[self.robot.carrier].T))
        return np.where(astray, np.nan, np.concatenate([np.stack(spin), L_rate, now.states.u[3:]]))


def _forward(way: _Way, times: Array) -> Array:
    """Return y (7 + h, n), integrated forward from the start."""
    # Gravity exerts no torque on a balanced ball, so no weight can fall over.
    span, off = (0.0, float(times[-1])), _TOLERANCE

    def rate(t: float, y: Array) -> Array:
        return way.rate(np.array([t]), y[:, None])[:, 0]

    solved = solve_ivp(rate, span, way.start(), "DOP853", times, rtol=off, atol=off)
    if not solved.success:
        raise _no_drives(way)
    return np.asarray(solved.y)


def _no_drives(way: _Way) -> InputError:
    line = "no drives roll it along this path; increase the duration or choose gentler turns"
    return InputError(f"{way.scene.name}: {line}")


def _bounded(way: _Way, times: Array) -> Array:
    """Return the bounded solution y (7 + h, n) for hanging weights.

    Integrated forward in time a weight would fall over, so M = 0 is imposed at the end. The initial
    guess is a weight that hangs straight down.
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
    # Without slip the attitude depends on the whole path, so it is integrated in small steps.
    fine = 8  # steps between two times, enough for an initial guess
    y[7:, 0] = start[7:]
    for i in range(len(times)):
        if i:
            step = (times[i] - times[i - 1]) / fine
            for k in range(fine):
                now = np.array([times[i - 1] + (k + 0.5) * step])
                axes = rotation_matrix(shell)[None]
                turn = way.shell(now, axes[:, 2], axes)[0] * step
                shell = turned(shell, turn)
        y[7:, i] = _balanced(way, shell, y[7:, max(i - 1, 0)])
        y[:4, i] = turned(shell, y[7, i] * e)
    y[:4] = continuous(y[:4].T).T
    rates = np.gradient(y[7:], times, axis=1)
    axes = rotation_matrix(y[:4].T)
    gamma = axes[:, 2]
    omega = way.shell(times, gamma, axes) + np.outer(rates[0], e)
    states = robot.states(gamma, y[7:].T, omega, rates.T)
    y[4:7] = np.einsum("nij,nj->in", axes, states.momentum(way.scene.rolling))
    return y


def _balanced(way: _Way, shell: Array, angles: Array) -> Array:
    """Return hinge angles (h,) near `angles` with the centre of mass below the ball's centre."""
    scene, e = way.scene, way.scene.ball.shell.axis
    masses = scene.robot.bodies[:, 0]

    def off(driven: Array) -> Array:
        """Return the centre of mass (3,) in world axes, over the radius."""
        trial = angles.copy()
        trial[way.driven] = driven
        frame = rotation_matrix(turned(shell, trial[0] * e))
        centre = masses @ way.robot.placed(trial[None])[:, :3, 0] / masses.sum()
        return np.asarray(frame @ centre / scene.ball.radius)

    def height(driven: Array) -> float:
        return float(off(driven)[2])

    def beside(driven: Array) -> Array:
        return off(driven)[:2]

    # First minimise the height, because the weights may also balance above the centre. The minimum
    # is flat and gives half the digits; the horizontal offset then gives all of them.
    lowest = minimize(height, angles[way.driven], method="BFGS").x
    balanced = angles.copy()
    balanced[way.driven] = least_squares(beside, lowest, xtol=1e-14).x
    return balanced
