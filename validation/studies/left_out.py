"""Find physical effects that a simulation left out or added, from the balance of momentum.

About the contact point, only the weight, the plane's resistance and P×v change L. Only the weight
and the motor change the momentum along a hinge. The imbalance is the remaining change of momentum
in a file. Each omission has a signature: the torque that it adds in the states of the file. An
omission is reported if the imbalance equals this torque with a factor of 1 or, for dampers and
frictions, with any positive factor. The path is hardly used, so a chaotic motion is judged as well
as a regular motion.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.integrate import cumulative_simpson

from robotball import RecordedMotion
from robotball.engines.recorded import sampled_rates
from robotball.robot.formulas import add
from robotball.robot.mechanics import Pose, States, momenta, momentum_rates, move, weigh
from robotball.robot.motors import Free, Servo
from robotball.rotations import Array, from_matrix, rotation_matrix, turned
from robotball.theory.multibody.derivative import STANDING

from .mistakes import SURE, Errors, Mistake

PHYSICS = "physics"  # the family of these mistakes
_KNOWN_TO = 3.0  # least imbalance, in errors of momentum due to computed rates
_SLIPS = 0.05  # of the speed; less slip may be a path that lags half a step behind
_LEAST = 1e-5  # of the momentum; a smaller imbalance is not explained
_EXACT = 0.05  # largest difference from a factor of 1
_AS_GOOD = 2.0  # omissions within this factor explain the imbalance equally well
_TURN = 1e-3  # rad, rotation in a step whose error is computed
_FALLS, _ROWS = 0.1, 2  # relative error of the acceleration in free flight, and rows that show it
_OFF = 1e-2  # radii; a ball that is higher than its lowest position by more is off the plane


def left_out(motion: RecordedMotion) -> Mistake | None:
    """Return the omission that a file's height or the imbalance of its momentum shows, if any."""
    times, scale = motion.times, motion.scene.momentum_scale
    if flight := _flight(motion):
        return flight
    balance = _balance(motion)
    imbalance = _centred(balance[2]) - _growth(times, balance[3])
    before = float(np.abs(imbalance).max()) / scale
    if not before > max(_KNOWN_TO * float(motion.momentum_error.max()) / scale, _LEAST):
        return None
    found = []
    for name, torque in _signatures(motion, balance):
        shape = _growth(times, torque)
        rows, squares = imbalance[: len(shape)], float((shape**2).sum())
        factor = float((shape * rows).sum()) / squares if squares else 0.0
        left = float(np.linalg.norm(rows - factor * shape) / np.linalg.norm(rows))
        if factor > 0 if "{" in name else abs(factor - 1) < _EXACT:
            found.append((left, name.format(factor)))
    found.sort()
    if not found or found[0][0] > SURE:
        return None
    left, name = found[0]
    others = tuple(other for error, other in found[1:] if error < _AS_GOOD * left)
    return Mistake(PHYSICS, name, Errors(momentum=before), Errors(momentum=left * before), others)


def _flight(motion: RecordedMotion) -> Mistake | None:
    """Return the loss of contact, if the ball is off the plane and falls freely."""
    times, z, gravity = motion.times, motion.height, motion.scene.gravity_world
    points = np.column_stack([motion.contact_point, z])
    velocities = np.diff(points, axis=0) / np.diff(times)[:, None]
    faster = 2 * np.diff(velocities, axis=0) / (times[2:] - times[:-2])[:, None]
    falls = np.linalg.norm(faster - gravity, axis=1) < _FALLS * np.linalg.norm(gravity)
    flies = falls & (z[1:-1] - z.min() > _OFF * motion.scene.ball.radius)
    if np.count_nonzero(flies) < _ROWS:
        return None
    first, height = times[1 + flies.argmax()], z.max() - z.min()
    name = f"contact lost: the ball flies at t = {first:.3g} s, {height:.2g} m high"
    return Mistake(PHYSICS, name, Errors(), Errors(), ())


def _growth(times: Array, rates: Array) -> Array:
    """Return integrals (k, n) of rates minus their means: another start is not an omission."""
    return _centred(np.asarray(cumulative_simpson(rates, x=times, axis=1, initial=0)))


def _centred(rows: Array) -> Array:
    return rows - rows.mean(axis=1, keepdims=True)


# Attitudes R (n, 3, 3) and states, their momenta (k, n), and the rates of these momenta in the
# scene. The rows are L along the axes of space and the momenta along the hinges that have a motor.
# If the ball does not spin, the vertical row is left out, because the plane's torque is unknown.
_Balance = tuple[Array, States, Array, Array]


def _balance(motion: RecordedMotion) -> _Balance:
    scene, R = motion.scene, rotation_matrix(motion.attitude)
    angles, rates = motion.hinge_angles, motion.hinge_rates
    states = scene.robot.states(R[:, 2], angles, motion.angular_velocity, rates)
    along, changes, weights = np.empty((3, *rates.T.shape))
    velocity = sampled_rates(motion.times, motion.contact_point)[0]
    slips = motion.slip.max() > _SLIPS * np.linalg.norm(velocity, axis=1).max()
    x, y, _ = _in_space(R, states.u[:3])
    rolling = scene.ball.radius * np.stack([y, -x], axis=1)
    slip = tuple(np.einsum("nji,nj->in", R[:, :2], slips * (velocity - rolling)))
    move(states.pose, tuple(states.u[:3]), slip, rates.T, states.moving)
    L = momenta(states.pose, states.moving, rates.T, along)
    torque = momentum_rates(states.pose, states.moving, slip, changes)
    gravity = np.einsum("nji,nj->in", R, scene.gravity_at(motion.times))
    _, heavy = weigh(states.pose, tuple(gravity), weights)
    for j, hinge in enumerate(scene.hinges):
        if hinge.motor is not None:
            command = hinge.command.rate(motion.times)
            weights[j] += hinge.motor.torque(command, angles[:, j], rates[:, j])
    changed = _rows(motion, R, [*add(torque, heavy), *(changes + weights)])
    changed += scene.friction.rolling * _resistance(motion, R, states, [[1], [1], [0]])
    return R, states, _rows(motion, R, [*L, *along]), changed


def _in_space(R: Array, v: Array | Sequence[Array]) -> Array:
    return np.einsum("nij,jn->in", R, v)


def _rows(motion: RecordedMotion, R: Array, forces: Array | Sequence[Array]) -> Array:
    """Return the rows of a balance for forces (3 + h, n), the first three in frame axes."""
    scene = motion.scene
    known = not (scene.actuators or scene.controller)
    free = [j for j, hinge in enumerate(scene.hinges) if hinge.motor is not None and known]
    in_space = _in_space(R, forces[:3])[: 3 if _spins(motion) else 2]
    return np.concatenate([in_space, np.array(forces[3:])[free]])


def _spins(motion: RecordedMotion) -> bool:
    """Return whether the ball may spin. Then the plane's torque is known."""
    turning = np.linalg.norm(motion.angular_velocity, axis=1).max()
    return motion.scene.rolling == "classical" or np.abs(motion.spin).max() > _SLIPS * turning


def _resistance(
    motion: RecordedMotion, R: Array, states: States, axes: Sequence[Sequence[int]]
) -> Array:
    """Return the rows of a resistance to rotation about some axes of space, per coefficient [m]."""
    against = _in_space(R, states.u[:3]) * axes
    pushed = _in_space(R, np.einsum("ikn,kn->in", states.pushes, states.u))[2]
    weight = motion.scene.ball.mass * motion.scene.gravity_at(motion.times)[:, 2]
    normal = sampled_rates(motion.times, pushed[:, None])[0][:, 0] - weight
    torque = -normal * against / np.maximum(np.linalg.norm(against, axis=0), STANDING)
    to_frame = np.einsum("nji,jn->in", R, torque)
    return _rows(motion, R, [*to_frame, *np.zeros_like(states.u[3:])])


def _signatures(motion: RecordedMotion, balance: _Balance) -> Iterator[tuple[str, Array]]:
    """Yield the name and the torque (k, n) of each omission; a name has a place for its factor."""
    scene, (R, states, own, _), tree = motion.scene, balance, motion.scene.ball.tree
    robot, k, omega = scene.robot, len(states.u), motion.angular_velocity
    tiled = np.tile(states.pose.placed, k), tuple(np.tile(states.pose.lift, k))
    units = np.repeat(np.eye(k), len(motion.times), axis=1)
    unit = robot.moving(Pose(robot.bodies, *tiled), units)
    turning, moving = (v.reshape(len(tree), k, -1, 3) for v in (unit.turning, unit.velocities))

    def of_bodies(torques: Array, forces: Array | None = None) -> Array:
        """Return the rows of torques, and forces on the centres of mass (b, n, 3), frame axes."""
        powers = turning * torques[:, None] + moving * (0.0 if forces is None else forces[:, None])
        return _rows(motion, R, powers.sum(axis=(0, 3)))

    turns, inertias = robot.moved(motion.hinge_angles)[0], [link.inertia for link in tree]
    tensors = np.einsum("bnij,bjk,bnlk->bnil", turns, inertias, turns)
    spins, whole = np.einsum("bnij,bnj->bni", tensors, states.turning), tensors @ omega[..., None]
    term, whole = "the gyroscopic term {} is left out", whole[..., 0]
    yield term.format("ω×Iω"), of_bodies(np.cross(omega, whole))
    if np.any(inside := spins - whole):
        yield term.format("ω×k, of what turns in the frame,"), of_bodies(np.cross(omega, inside))
        yield term.format("ω×(Iω + k)"), of_bodies(np.cross(omega, spins))
        yield term.format("ω×Iω of each body"), of_bodies(np.cross(states.turning, spins))

    masses, gravity = np.array([link.mass for link in tree]), scene.gravity_at(motion.times)
    weights = masses[:, None, None] * np.einsum("nji,nj->ni", R, gravity)
    bodies = np.arange(len(tree))[:, None, None]
    lifted = {f"on the {link.name}": bodies == b for b, link in enumerate(tree)}
    if len(tree) > 2:
        lifted["inside the shell"] = bodies > 0
    for where, which in lifted.items():
        gone = f"gravity does not act {where} (gravity compensation)"
        yield gone, of_bodies(0 * weights, -weights * which)
    of_shell = bodies == 0
    damped = of_bodies(-states.turning * of_shell, -states.velocities * of_shell)
    yield "the ball's free joint is damped, by about {:.2g} N m s/rad and N s/m", damped
    yield "all velocities are damped, by about {:.2g} of them per second", -own
    for j, hinge in enumerate(scene.hinges):
        if isinstance(hinge.motor, Free | Servo):
            drag = _rows(motion, R, -states.u * (np.arange(k)[:, None] == 3 + j))
            own_damping = hinge.motor.damping if isinstance(hinge.motor, Free) else 0.0
            if own_damping:
                yield f"the damping of the {hinge.name} is left out", -own_damping * drag
            else:
                yield f"the joint of the {hinge.name} is damped, by about {{:.2g}} N m s/rad", drag
    rolling = _resistance(motion, R, states, [[1], [1], [0]])
    if resistance := scene.friction.rolling:
        yield "the plane's resistance to rolling is left out", -resistance * rolling
    else:
        yield "the plane resists rolling, friction.rolling is about {:.2g} m", rolling
    if _spins(motion):
        spinning = _resistance(motion, R, states, [[0], [0], [1]])
        yield "the plane resists spinning, friction.torsional is about {:.2g} m", spinning
    yield from _first_order(motion, balance)


def _first_order(motion: RecordedMotion, balance: _Balance) -> Iterator[tuple[str, Array]]:
    """Yield the change of L by a first-order integrator's step, per second and step."""
    times, rates, robot = motion.times, motion.hinge_rates, motion.scene.robot
    R, states, _, known = balance
    shell, omega = R @ robot.moved(motion.hinge_angles)[0][0], _in_space(R, states.u[:3]).T
    faster, accelerations = sampled_rates(times, omega)[0], sampled_rates(times, rates)[0]
    h = _TURN / max(float(np.abs(omega).max()), float(np.abs(rates).max()))

    def L_after(h: float, later: float = 0.0) -> Array:
        """Return L after h [s], if the angles change with the rates at the time `later`."""
        turn = np.einsum("nji,nj->ni", shell, omega + later * faster)
        angles = motion.hinge_angles + h * (rates + later * accelerations)
        to_shell = robot.moved(angles)[0][0]
        R = rotation_matrix(turned(from_matrix(shell), h * turn)) @ to_shell.transpose(0, 2, 1)
        seen = np.einsum("nji,nj->in", R, omega + h * faster)
        u = np.concatenate([seen, (rates + h * accelerations).T])
        return _in_space(R, robot.moving(robot.pose(R[:, 2], angles), u).momenta[:3])[:level]

    # The rows of hinges are left out, because their motors may act at the end of a step.
    level = 3 if _spins(motion) else 2
    after, bent = L_after(h), sampled_rates(times, known[:level].T)[0].T / 2
    explicit = (after - 2 * L_after(0.0) + L_after(-h)) / (2 * h * h) - bent
    name = "{} Euler steps of about {{:.2g}} s (an integrator of first order)"
    yield name.format("explicit"), explicit
    yield name.format("semi-implicit"), explicit + (L_after(h, h) - after) / h**2
