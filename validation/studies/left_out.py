"""Find physics that the program of a trajectory left out or added, from the balance of momentum.

About the contact point, L changes by the weight, the plane's resistance and P×v alone, and the
momentum along a hinge by its weight and its motor. The rest of a file's change is its imbalance.
Each omission has a signature, the torque that it adds in the file's own states. It is named if the
imbalance is this torque, with a factor of 1 or, for dampers and frictions, with a positive factor.
The path is not used, so a chaotic motion is judged as well as another.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_simpson

from robotball import RecordedMotion
from robotball.engines.recorded import sampled_rates
from robotball.robot.formulas import add
from robotball.robot.mechanics import Pose, States, momenta, momentum_rates, move, weigh
from robotball.robot.motors import Free, Servo
from robotball.rotations import Array, rotation_matrix, turned
from robotball.theory.multibody.derivative import STANDING

from .mistakes import SURE, Errors, Mistake

_LEVEL, _VERTICAL = (0, 1), (2,)  # axes of the world
PHYSICS = "physics"  # the family of these mistakes
_KNOWN_TO = 3.0  # an imbalance, or a slip, must be so many times its error from numerical rates
_LEAST = 1e-5  # of the momentum: a smaller imbalance is not searched
_EXACT = 0.05  # largest difference from a factor of 1
_AS_GOOD = 2.0  # omissions within this factor explain the imbalance equally well
_TURN = 1e-3  # rad, of a step whose error is computed
_FALLS = 0.2  # relative error of the acceleration of a ball in free flight
_OFF = 1e-2  # radii: a ball that is so much higher than its lowest place is off the plane


def left_out(motion: RecordedMotion) -> Mistake | None:
    """Return the omission that a file's height or the imbalance of its momentum shows, if any."""
    times, scale = motion.times, motion.scene.momentum_scale
    if flight := _flight(motion):
        return flight
    balance = _balance(motion)
    imbalance = _shape(balance.momenta - _integral(times, balance.rates))
    size, before = float(np.linalg.norm(imbalance)), float(np.abs(imbalance).max()) / scale
    if not before > max(_KNOWN_TO * float(motion.momentum_error.max()) / scale, _LEAST):
        return None
    found = []
    for name, torque in _signatures(motion, balance):
        shape = _shape(_integral(times, torque))
        if squares := float((shape**2).sum()):
            factor = float((shape * imbalance).sum()) / squares
            left = float(np.linalg.norm(imbalance - factor * shape)) / size
            if factor > 0 if "{" in name else abs(factor - 1) < _EXACT:
                found.append((left, name.format(factor)))
    found.sort()
    if not found or found[0][0] > SURE:
        return None
    left, name = found[0]
    others = tuple(other for error, other in found[1:] if error < _AS_GOOD * left)
    return Mistake(PHYSICS, name, Errors(momentum=before), Errors(momentum=left * before), others)


def _flight(motion: RecordedMotion) -> Mistake | None:
    """Return that the ball lost contact if it is off the plane and falls with gravity."""
    times, z, g = motion.times, motion.height, motion.scene.gravity
    falls = sampled_rates(times, sampled_rates(times, z[:, None])[0])[0][:, 0]
    flies = (z - z.min() > _OFF * motion.scene.ball.radius) & (np.abs(falls + g) < _FALLS * g)
    if not flies.any():
        return None
    height = float(z.max() - z.min())
    name = f"contact lost: the ball flies at t = {times[flies.argmax()]:.3g} s, {height:.2g} m high"
    return Mistake(PHYSICS, name, Errors(height=height), Errors(height=0.0), ())


def _integral(times: Array, rates: Array) -> Array:
    return np.asarray(cumulative_simpson(rates, x=times, axis=1, initial=0))


def _shape(rows: Array) -> Array:
    """Return rows (k, n) without their means: another start is not an omission."""
    return rows - rows.mean(axis=1, keepdims=True)


class _Balance(NamedTuple):
    """States, their momenta (k, n), and the rates of these by the scene's own physics.

    The rows are L along the axes of space, without the vertical one in the rubber model, where the
    plane's torque is unknown, then the momenta along the hinges that have a motor.
    """

    states: States
    momenta: Array
    rates: Array


def _balance(motion: RecordedMotion) -> _Balance:
    scene, R, states = motion.scene, rotation_matrix(motion.attitude), _states(motion)
    angles, rates = motion.hinge_angles, motion.hinge_rates
    along, changes, weights = np.empty((3, *rates.T.shape))
    seen = (np.einsum("nji,nj->in", R, v) for v in (_slip(motion), scene.gravity_at(motion.times)))
    slip, gravity = map(tuple, seen)
    move(states.pose, tuple(states.u[:3]), slip, rates.T, states.moving)
    L = momenta(states.pose, states.moving, rates.T, along)
    torque = momentum_rates(states.pose, states.moving, slip, changes)
    _, heavy = weigh(states.pose, gravity, weights)
    for j, hinge in enumerate(scene.hinges):
        if hinge.motor is not None:
            command = hinge.command.rate(motion.times)
            weights[j] += hinge.motor.torque(command, angles[:, j], rates[:, j])
    changed = _rows(motion, [*add(torque, heavy), *(changes + weights)])
    changed += scene.friction.rolling * _resistance(motion, states, _LEVEL)
    return _Balance(states, _rows(motion, [*L, *along]), changed)


def _states(motion: RecordedMotion) -> States:
    gamma = rotation_matrix(motion.attitude)[:, 2]
    omega, rates = motion.angular_velocity, motion.hinge_rates
    return motion.scene.robot.states(gamma, motion.hinge_angles, omega, rates)


def _slip(motion: RecordedMotion) -> Array:
    """Return the velocity of the contact point (n, 3) [m/s], or 0 if it is within its error."""
    velocity, a = sampled_rates(motion.times, motion.contact_point)[0], motion.scene.ball.radius
    x, y, _ = _in_space(motion, _states(motion).u[:3])
    slips = motion.slip.max() > _KNOWN_TO * motion.slip_error.max()
    return np.pad(slips * (velocity - a * np.stack([y, -x], axis=1)), ((0, 0), (0, 1)))


def _in_space(motion: RecordedMotion, v: Array | Sequence[Array]) -> Array:
    return np.einsum("nij,jn->in", rotation_matrix(motion.attitude), v)


def _rows(motion: RecordedMotion, forces: Array | Sequence[Array]) -> Array:
    """Return the rows of a balance for forces (3 + h, n), the first three in frame axes."""
    scene = motion.scene
    known = not (scene.actuators or scene.controller)
    free = [j for j, hinge in enumerate(scene.hinges) if hinge.motor is not None and known]
    level = 2 if scene.rolling == "rubber" else 3
    return np.concatenate([_in_space(motion, forces[:3])[:level], np.array(forces[3:])[free]])


def _resistance(motion: RecordedMotion, states: States, axes: Sequence[int]) -> Array:
    """Return the rows of a torque against turning about axes of the world, per coefficient [m]."""
    against = _in_space(motion, states.u[:3]) * np.isin([[0], [1], [2]], axes)
    pushed = _in_space(motion, np.einsum("ikn,kn->in", states.pushes, states.u))[2]
    weight = motion.scene.ball.mass * motion.scene.gravity_at(motion.times)[:, 2]
    normal = sampled_rates(motion.times, pushed[:, None])[0][:, 0] - weight
    torque = -normal * against / np.maximum(np.linalg.norm(against, axis=0), STANDING)
    to_frame = np.einsum("nji,jn->in", rotation_matrix(motion.attitude), torque)
    return _rows(motion, [*to_frame, *np.zeros_like(states.u[3:])])


def _signatures(motion: RecordedMotion, balance: _Balance) -> Iterator[tuple[str, Array]]:
    """Yield the name and the torque (k, n) of each omission; a name has a place for its factor."""
    scene, states, tree = motion.scene, balance.states, motion.scene.ball.tree
    robot, k, still = scene.robot, len(states.u), np.zeros_like(states.turning)
    turns, _ = robot.moved(motion.hinge_angles)
    inertias = np.einsum("bnij,bjk,bnlk->bnil", turns, [link.inertia for link in tree], turns)
    tiled = np.tile(states.pose.placed, k), tuple(np.tile(states.pose.lift, k))
    units = np.repeat(np.eye(k), len(motion.times), axis=1)
    unit = robot.moving(Pose(robot.bodies, *tiled), units)
    turning, moving = (v.reshape(len(tree), k, -1, 3) for v in (unit.turning, unit.velocities))

    def on_bodies(torques: Array, forces: Array) -> Array:
        torque = np.einsum("bkni,bni->kn", turning, torques)
        return _rows(motion, torque + np.einsum("bkni,bni->kn", moving, forces))

    def on_all(torque: Array) -> Array:
        return _rows(motion, [*torque.T, *np.zeros_like(states.u[3:])])

    omega, term = motion.angular_velocity, "the gyroscopic term ω×{} is left out"
    inside = np.einsum("bnij,bnj->ni", inertias, states.turning - omega)
    whole = np.einsum("bnij,nj->ni", inertias, omega)
    yield term.format("Iω"), on_all(np.cross(omega, whole))
    if inside.any():
        yield term.format("k, of what turns in the frame,"), on_all(np.cross(omega, inside))
        yield term.format("(Iω + k)"), on_all(np.cross(omega, whole + inside))
        spins = np.einsum("bnij,bnj->bni", inertias, states.turning)
        yield term.format("Iω of each body"), on_bodies(np.cross(states.turning, spins), still)

    down = np.einsum("nji,nj->ni", rotation_matrix(motion.attitude), scene.gravity_at(motion.times))
    weights = np.array([link.mass for link in tree])[:, None, None] * down
    for b, link in enumerate(tree):
        lifted = still.copy()
        lifted[b] = -weights[b]
        yield (
            f"gravity does not act on the {link.name} (gravity compensation)",
            on_bodies(still, lifted),
        )
    yield "gravity acts on no body (gravity compensation)", on_bodies(still, -weights)

    on_shell = np.arange(len(tree))[:, None, None] == 0
    damped = on_bodies(-states.turning * on_shell, -states.velocities * on_shell)
    yield "the ball's free joint is damped, by about {:.2g} N m s/rad and N s/m", damped
    yield "all velocities are damped, by about {:.2g} of them per second", -balance.momenta
    for j, hinge in enumerate(scene.hinges):
        if isinstance(hinge.motor, Free | Servo):
            torque = np.zeros_like(states.u)
            torque[3 + j] = -motion.hinge_rates[:, j]
            own = isinstance(hinge.motor, Free) * hinge.motor.law.per_rate
            damping = (
                f"the {hinge.name}'s damping is left out"
                if own
                else (f"the {hinge.name}'s joint is damped, by about {{:.2g}} N m s/rad")
            )
            yield damping, _rows(motion, torque) * (-own or 1)

    resistance = _resistance(motion, states, _LEVEL)
    if own := scene.friction.rolling:
        yield "the plane's resistance to rolling is left out", -own * resistance
    else:
        yield "the plane resists rolling, friction.rolling = {:.2g}", resistance
    if scene.rolling == "classical":
        name = "torsional friction brakes the spin, friction.torsional = {:.2g}"
        yield name, _resistance(motion, states, _VERTICAL)
    yield from _first_order(motion, balance)


def _first_order(motion: RecordedMotion, balance: _Balance) -> Iterator[tuple[str, Array]]:
    """Yield what a step of a first-order integrator adds to the momenta, per second and step."""
    times, rates, q = motion.times, motion.hinge_rates, motion.attitude
    omega = _in_space(motion, motion.angular_velocity.T).T
    faster, accelerations = sampled_rates(times, omega)[0], sampled_rates(times, rates)[0]
    h = _TURN / max(float(np.abs(omega).max()), float(np.abs(rates).max()))

    def momenta_after(h: float, later: float = 0.0) -> Array:
        turn = np.einsum("nji,nj->ni", rotation_matrix(q), omega + later * faster)
        attitude = turned(q, h * turn)
        seen = np.einsum("nji,nj->ni", rotation_matrix(attitude), omega + h * faster)
        angles = motion.hinge_angles + h * (rates + later * accelerations)
        moved = replace(
            motion, attitude=attitude, angular_velocity=seen, hinge_angles=angles,
            hinge_rates=rates + h * accelerations,
        )  # fmt: skip
        return _balance(moved).momenta

    after, bent = momenta_after(h), sampled_rates(times, balance.rates.T)[0].T / 2
    explicit = (after - 2 * balance.momenta + momenta_after(-h)) / (2 * h * h) - bent
    name = "{} Euler steps of about {{:.2g}} s (an integrator of first order)"
    yield name.format("explicit"), explicit
    yield name.format("semi-implicit"), explicit + (momenta_after(h, h) - after) / h**2
