"""From a wanted path of the contact point to the drives of a robot that roll it along.

The path tells how the shell turns, for it does not slip. The momentum tells the rest: M is what it
is, so (L, h) = 𝓜u is, at every time, two equations for the rates of the hinges in the rubber
model, and three in the classical one, where the shell's spin is unknown as well. Of more hinges
than that the ones that take the least energy are taken.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import least_squares, minimize
from scipy.spatial.transform import Rotation

from robotball.designing.paths import WantedPath
from robotball.designing.steering_equations import Moves, Way
from robotball.drives import turns
from robotball.errors import InputError, check_positive
from robotball.hinges import Hinge
from robotball.motors import Free
from robotball.rates import Samples
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.scene import Scene
from robotball.start import Start

INTERVAL = 0.04  # s, between the samples of the drives
TOLERANCE = 1e-9
BVP_TOLERANCE, MOST_NODES = 1e-5, 20_000
SINGULAR = 1e-4  # of the largest part: hinges that move the ball less in some direction cannot
FASTEST = 1e4  # rad/s


@dataclass(frozen=True)
class Steered:
    """The drives that roll a robot along a path.

    scene       the robot with them, from rest; its hinges keep their rates exactly
    times (n,)  s
    rates (n, h) rad/s, of the hinges
    wanted (n, 2) m, the contact point
    """

    scene: Scene
    times: Array
    rates: Array
    wanted: Array


def steer(scene: Scene, path: WantedPath, duration: float) -> Steered:
    """The robot of a scene on its way along a path, from rest to rest in a duration [s].

    The hinges that turn or have motors are driven. The shell starts as in the scene, the weights
    where they keep it at rest. Raises InputError where too few hinges are driven, where the plane
    resists rolling, and where the hinges cannot roll the ball as it is wanted, with the time.
    """
    check_positive("the duration", duration, "s")
    if scene.friction.rolling:
        raise InputError(f"{scene.name}: the plane resists rolling, which steering does not know")
    driven = np.array([_is_driven(hinge) for hinge in scene.hinges])
    if driven.sum() < 2:
        raise InputError(
            f"{scene.name}: {driven.sum()} hinges are driven; to roll anywhere takes two: give "
            "them a rate or a motor"
        )
    way = Way(scene, path, duration, driven)
    times = np.linspace(0.0, duration, int(np.ceil(duration / INTERVAL)) + 1)
    y = _forward(way, times) if scene.keeps_momentum else _bounded(way, times)
    moves = way.moves(times, y)
    rates = moves.u[3:].T
    _check_reach(scene, times, moves)
    samples: list[Any] = [
        Samples(times=tuple(times.tolist()), values=tuple(column.tolist())) if on else 0.0
        for column, on in zip(rates.T, driven, strict=True)
    ]
    rotors = len(scene.ball.rotors)
    steered = replace(
        scene,
        name=f"{scene.name}_{path.name}",
        title=f"{scene.title}, steered along a {path.name}",
        frame_rate=samples[0],
        rotor_rates=tuple(samples[1 : 1 + rotors]),
        pendulum_rates=tuple(samples[1 + rotors :]),
        motors=(),
        duration=duration,
        start=Start(y[:4, 0] / np.linalg.norm(y[:4, 0]), np.zeros(3), y[7:, 0]),
    )
    return Steered(steered, times, rates, way.point(times))


def _is_driven(hinge: Hinge) -> bool:
    return not isinstance(hinge.motor, Free) and (hinge.motor is not None or turns(hinge.command))


def _check_reach(scene: Scene, times: Array, moves: Moves) -> None:
    least, fastest = int(moves.reach.argmin()), int(np.abs(moves.u[3:]).max(axis=0).argmax())
    if moves.reach[least] < SINGULAR:
        raise InputError(
            f"{scene.name}: at t = {times[least]:.4g} s the hinges cannot roll the ball in every "
            "direction, for what they move lies in one line; take another path or attitude"
        )
    speed = float(np.abs(moves.u[3:, fastest]).max())
    if not speed < FASTEST:
        raise InputError(
            f"{scene.name}: at t = {times[fastest]:.4g} s a hinge would turn at {speed:.3g} rad/s; "
            "take more time, or another path"
        )


def _forward(way: Way, times: Array) -> Array:
    """y (7 + h, n) from the start on: what turns a balanced ball is no matter of gravity."""
    solved = solve_ivp(
        lambda t, y: way.rate(np.array([t]), y[:, None])[:, 0],
        (0.0, float(times[-1])),
        way.start(),
        "DOP853",
        times,
        rtol=TOLERANCE,
        atol=TOLERANCE,
    )
    if not solved.success:
        raise _no_drives(way)
    return np.asarray(solved.y)


def _no_drives(way: Way) -> InputError:
    return InputError(
        f"{way.scene.name}: no drives are found that roll it along this path; take more time, or "
        "gentler turns"
    )


def _bounded(way: Way, times: Array) -> Array:
    """y (7 + h, n) of weights that hang: of all ways to roll along, the one that stays bounded.

    Forward in time a weight that is moved as the path wants it falls over. So M = 0 is asked for at
    the end, where all rests, and not at the start. The first guess is a weight that hangs still.
    """
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

    solved = solve_bvp(
        lambda t, part: way.rate(t, whole(part))[kept],
        ends,
        times,
        guess,
        tol=BVP_TOLERANCE,
        max_nodes=MOST_NODES,
    )
    if not solved.success:
        raise _no_drives(way)
    return whole(solved.sol(times))


def _hanging(way: Way, times: Array) -> Array:
    """y (7 + h, n) where the shell rolls along the path and the weights hang below its centre."""
    robot, start = way.robot, way.start()
    e = way.scene.ball.shell.axis
    y = np.tile(start[:, None], len(times))
    shell = _turned_back(start[:4], e, start[7])
    fine = 8
    y[7:, 0] = start[7:]
    for i in range(len(times)):
        if i:
            step = (times[i] - times[i - 1]) / fine
            for k in range(fine):
                now = np.array([times[i - 1] + (k + 0.5) * step])
                axes = rotation_matrix(shell)[None]
                turn = way.shell(now, axes[:, 2], axes)[0] * step
                shell = multiply(shell, Rotation.from_rotvec(turn).as_quat(scalar_first=True))
        y[7:, i] = _balanced(way, shell, y[7:, max(i - 1, 0)])
        y[:4, i] = _turned_back(shell, e, -y[7, i])
        if i and y[:4, i] @ y[:4, i - 1] < 0:
            y[:4, i] *= -1
    rates = np.gradient(y[7:], times, axis=1)
    axes = rotation_matrix(y[:4].T)
    gamma = axes[:, 2]
    omega = way.shell(times, gamma, axes) + np.outer(rates[0], e)
    states = robot.states(gamma, y[7:].T, omega, rates.T)
    y[4:7] = np.einsum("nij,nj->in", axes, states.momentum(way.scene.rolling))
    return y


def _turned_back(attitude: Array, axis: Array, angle: float) -> Array:
    turn = np.array([np.cos(angle / 2), *(-np.sin(angle / 2) * axis)])
    return multiply(attitude, turn)


def _balanced(way: Way, shell: Array, angles: Array) -> Array:
    """The hinges' angles (h,) near others at which the centre of mass is below the ball's."""
    scene, e = way.scene, way.scene.ball.shell.axis
    to_world, masses = rotation_matrix(shell), scene.robot.bodies[:, 0]

    def off(driven: Array) -> Array:
        """The centre of mass (3,) in space, over the radius."""
        trial = angles.copy()
        trial[way.driven] = driven
        frame = rotation_matrix(_turned_back(np.array([1.0, 0.0, 0.0, 0.0]), e, -trial[0]))
        centre = masses @ way.robot.placed(trial[None])[:, :3, 0] / masses.sum()
        return np.asarray(to_world @ frame @ centre / scene.ball.radius)

    def height(driven: Array) -> float:
        return float(off(driven)[2])

    def beside(driven: Array) -> Array:
        return off(driven)[:2]

    lowest = minimize(height, angles[way.driven], method="BFGS").x
    found = angles.copy()
    found[way.driven] = least_squares(beside, lowest, xtol=1e-14).x
    return found
