"""The compiled derivative of a robot's state, from the formulas of robotball.robot.mechanics.

A state is (q, X, Y, M, loss, angles, h, work): the frame's attitude, the contact point, the
momentum M in space axes, the work lost to rolling resistance, and for every hinge its angle, its
momentum (if its rate is not prescribed) and the work of its motors. If the friction of the plane is
finite, the horizontal momentum P along X and Y and the loss to friction follow. If the plane moves
or turns, the work of the plane on the ball follows. While a rubber shell spins, the state has L in
place of M. A motor moves one hinge, or several hinges with gears. The derivative also gives the
forces and rates in `Readings`.

A call of compiled code takes longer than one derivative, so `differentiate` computes all stages of
a step, of one robot or of several.
"""

from functools import cache
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from robotball import rotations
from robotball.robot import formulas as eq
from robotball.robot import mechanics
from robotball.robot.formulas import Vector
from robotball.robot.mechanics import (
    ARTICULATED,
    MOVING,
    PLACED,
    TURNING,
    WHOLE,
    Matrix,
    Pose,
    articulate,
    bias,
    momenta,
    momentum_rates,
    move,
    of_shell,
    place,
    push,
    put,
    solve,
    vector,
    weigh,
)
from robotball.robot.motors import SLOW
from robotball.rotations import Array, Mask
from robotball.theory.compiled import compiled_from, inlined, text_of

# Indices in a state; from HINGES on the angles, the momenta and the work, h numbers each.
POINT, MOMENTUM, LOSS, HINGES = 4, 6, 9, 10
# Indices in the readings; from PER_HINGE on the rates and torques of hinges, h each, and the
# torques of motors without limits.
_FORCE, _PLANE_TORQUE, _OMEGA, _ROLLING, _SLIP, PER_HINGE = 0, 3, 6, 9, 12, 15
# Indices in the row of a motor's law.
_PER_COMMAND, _PER_ANGLE, _PER_RATE, _AT_REST, LIMIT, _FRICTION, MOTOR = 0, 1, 2, 3, 4, 5, 6
# rad/s: a shell that rolls at most at this rate stands. Below this rate, the direction of the
# resistance, which jumps at rest, is smoothed.
STANDING = 1e-8


# The formulas call each other, and numba compiles a call only if the function is registered.
for _module in (eq, mechanics):
    for _function in vars(_module).values():
        if isinstance(_function, FunctionType):
            inlined(_function)


class Machine(NamedTuple):
    """The parameters of a scene; with n robots, each robot has a row.

    bodies, radius, carrier: of its `Robot`; motors (m, MOTOR): the laws of the motors; gears
    (m, h); resistance: the plane's resistance to rolling [m]; friction (2,): the plane's sliding
    coefficient, and its torsional coefficient [m], inf if not limited. All robots share carrier,
    given and spin_free. given (k,): whether a rate of u is prescribed; for the shell's three rates,
    about the axes of space, and for the slip velocity this depends on the modes; spin_free: whether
    a shell that sticks may not turn about the vertical.
    """

    bodies: Array
    radius: Any
    carrier: int
    motors: Array
    gears: Array
    given: Mask
    spin_free: bool
    resistance: Any
    friction: Any


class Inputs(NamedTuple):
    """Inputs at the stages of a step (s, ...); with n robots, each robot has a row.

    rates, accelerations (s, h): of the hinges; commands (s, m): of the motors; gravity (s, 3) m/s²
    and plane (s, 5): the velocity of the plane [m/s], world axes, the rate at which it turns
    [rad/s], and the rate of that.
    """

    rates: Array
    accelerations: Array
    commands: Array
    gravity: Array
    plane: Array


class Modes(NamedTuple):
    """The modes of a robot, in which the derivative is a smooth function of the state.

    motors (m,): -1 or 1 at a torque limit, else 0; standing: whether the plane's resistance to
    rolling holds the shell; toward (3,), world: the direction in which it will roll; slipping:
    whether the friction is exceeded; ahead (n, s, 3), n and s may be 1: the directions of Wv that
    the friction of n robots opposes at the stages of a step; 0 means the direction of the slip.
    """

    motors: NDArray[np.int64]
    standing: bool = False
    toward: Array = np.zeros(3)
    slipping: bool = False
    ahead: Array = np.zeros((1, 1, 3))


class Work(NamedTuple):
    """Workspace of the derivative: code without new arrays compiles faster.

    state (size,); placed, moving, joints, matrix: as in `mechanics`; rows (5, k + h); forces,
    weights (h,).
    """

    state: Array
    placed: Array
    moving: Array
    joints: Array
    matrix: Array
    rows: Array
    forces: Array
    weights: Array


def work_of(size: int, hinges: int, slips: int) -> Work:
    """Return the workspace for a state (size,); slips: 2 if the slip velocity is unknown, or 0."""
    b, k, h = 1 + hinges, 3 + slips, hinges
    shapes = (size,), (b, PLACED), (b, MOVING), (b, ARTICULATED), (k, k), (5, k + h), (h,), (h,)
    return Work(*map(np.zeros, shapes))


@inlined
def _motors_act(
    laws: Any, gears: Any, commands: Any, sides: Any, angles: Any, rates: Any, torques: Any,
    unlimited: Any,
) -> None:  # fmt: skip
    """Write the torques (h,) on the hinges, and the torques (m,) of motors without limits."""
    count = len(torques)
    torques[:] = 0.0
    for i in range(len(unlimited)):
        motor, angle, speed = laws[i], 0.0, 0.0
        for j in range(count):
            angle += gears[i, j] * angles[j]
            speed += gears[i, j] * rates[j]
        free = (
            motor[_PER_COMMAND] * commands[i]
            - motor[_PER_ANGLE] * angle
            - motor[_PER_RATE] * speed
            + motor[_AT_REST]
        )
        if motor[_FRICTION] > 0:
            free -= motor[_FRICTION] * np.tanh(speed / SLOW)
        unlimited[i] = free
        torque = free if sides[i] == 0 else sides[i] * motor[LIMIT]
        for j in range(count):
            torques[j] += gears[i, j] * torque


@inlined
def _pull(slide: float, spin: float, along: Vector, velocity: Vector) -> Vector:
    """Return -W²v/|Wv|, the friction over the normal force: along X and Y, and about Z [m]."""
    if eq.dot(along, along) == 0.0:
        along = (slide * velocity[0], slide * velocity[1], spin * velocity[2])
    length = np.sqrt(eq.dot(along, along))
    along = eq.scale(-1 / length if length > 0.0 else 0.0, along)
    return (slide * along[0], slide * along[1], spin * along[2])


@inlined
def _along(ahead: Vector, rolling: Vector) -> Vector:
    """Return the direction of the rolling, which the plane's resistance opposes."""
    # Below STANDING it changes continuously into the direction in which the shell will roll.
    speed = np.sqrt(eq.dot(rolling, rolling))
    along = eq.add(rolling, eq.scale(max(STANDING - speed, 0.0), ahead))
    length = np.sqrt(eq.dot(along, along))
    return eq.scale(1 / length if length > STANDING / 2 else 0.0, along)


@inlined
def _in_space(v: Vector, axes: Matrix) -> Vector:
    return (eq.dot(axes[0], v), eq.dot(axes[1], v), eq.dot(axes[2], v))


_ROW, _TABLE, _TABLES = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_MACHINE = (
    _TABLES, _ROW, types.int64, _TABLES, _TABLES, types.boolean[::1], types.boolean, _ROW, _TABLE,
)  # fmt: skip
_SIGNATURE = types.void(
    types.NamedTuple(_MACHINE, Machine),
    types.NamedTuple((types.int64[::1], types.boolean, _ROW, types.boolean, _TABLES), Modes),
    types.NamedUniTuple(_TABLES, 5, Inputs),
    types.float64, _TABLE, _ROW, _ROW, _TABLE, _ROW, _TABLES,
    types.NamedTuple((_ROW, *[_TABLE] * 5, _ROW, _ROW), Work),
)  # fmt: skip


# Calls with many arrays, with numba's reference counts, would take as much time as the formulas.
_OPTIONS = {"forceinline": True, "_nrt": False, "no_cfunc_wrapper": True}
_FILES = rotations.__file__, eq.__file__, mechanics.__file__, __file__


@compiled_from(text_of(*_FILES), _SIGNATURE, **_OPTIONS)
def differentiate_stages(
    machines: Machine, modes: Modes, inputs: Inputs, length: float, weights: Any, base: Any,
    begin: Any, slopes: Any, ends: Any, readings: Any, work: Work,
) -> None:  # fmt: skip
    """Compute derivatives as in `differentiate`.

    Vectors are in world axes, but for the arguments and results of `mechanics`.
    """
    # This is one long function, because numba compiles a function again for each of its callers.
    state, moving, joints, matrix = work.state, work.moving, work.joints, work.matrix
    count, given, size = len(work.forces), machines.given, len(state)
    root, slipping = len(given) - count, HINGES + 3 * count
    moves = size > slipping + (3 if root > 3 else 0)
    rows = work.rows
    right, u, u_rate, load, by_torque = rows[0], rows[1], rows[2], rows[3], rows[4]
    for stage in range(len(readings) * len(weights)):
        k, s = stage // len(weights), stage % len(weights)
        before = len(slopes) - len(weights) + s
        rate, numbers = slopes[before, k * size : (k + 1) * size], readings[k, s]
        for i in range(size):
            change, at = 0.0, k * size + i
            for j in range(before):
                change += weights[s, j] * slopes[j, at]
            ends[at] = begin[at] + length * change
            state[i] = base[at] + ends[at]
        bodies, radius, resistance = machines.bodies[k], machines.radius[k], machines.resistance[k]
        slide, spin, plane = machines.friction[k, 0], machines.friction[k, 1], inputs.plane[k, s]
        slides = modes.slipping and slide < np.inf
        spins = not machines.spin_free or (modes.slipping and spin < np.inf)
        rows[:] = 0.0
        axes = eq.space_axes((state[0], state[1], state[2], state[3]))
        place(bodies, machines.carrier, state[HINGES : HINGES + count], work.placed)
        pose = Pose(bodies, work.placed, eq.scale(radius, axes[2]))
        # A standing shell turns about the vertical only, a rubber one about the horizontal axes.
        given[0] = given[1] = modes.standing
        given[2] = not spins
        for i in range(3, root):
            given[i] = not slides
        articulate(pose, axes, given, joints, matrix)
        gravity = vector(inputs.gravity[k, s], 0)
        M, point = vector(state, MOMENTUM), (state[POINT], state[POINT + 1])
        # L = M×γ + λγ in the rubber model; its unknown vertical part is not used.
        put(right, 0, M if spins else (M[1], -M[0], 0.0))
        for j in range(count):
            right[root + j], u[root + j] = state[HINGES + count + j], inputs.rates[k, s, j]
            u_rate[root + j] = inputs.accelerations[k, s, j]
        # A shell that sticks moves with the plane at the contact, a rubber one also turns with it.
        turning = plane[3]
        of_plane = eq.turntable_velocity(turning, point)
        u[2], u_rate[2] = turning, plane[4]
        for i in range(3, root):
            right[i], u[i] = state[slipping + i - 3], of_plane[i - 3]
        solve(pose, axes, given, joints, matrix, right, u, moving)
        (shell, slip), rates = of_shell(u, axes, root), u[root:]
        move(pose, shell, slip, rates, moving)
        torques = numbers[PER_HINGE + count : PER_HINGE + 2 * count]
        unlimited = numbers[PER_HINGE + 2 * count :]
        _motors_act(
            machines.motors[k], machines.gears[k], inputs.commands[k, s], modes.motors,
            state[HINGES:], rates, torques, unlimited,
        )  # fmt: skip
        held, against = bias(pose, moving, rates, work.forces)
        weight, heavy = weigh(pose, eq.seen_from_frame(gravity, axes), work.weights)
        heavy = _in_space(heavy, axes)
        force = _in_space(eq.subtract(held, weight), axes)
        torque = eq.subtract(_in_space(against, axes), heavy)
        put(right, 0, eq.scale(-1.0, torque))
        for j in range(count):
            work.forces[j] -= work.weights[j]
            right[root + j] = torques[j] - work.forces[j]
        x, y = eq.contact_velocity(axes[0], axes[1], shell, (0.0, 0.0, 0.0), radius)
        velocity = (0.0, 0.0, u[2] - turning)
        if root > 3:
            # The contact point moves over the plane.
            x, y = x + u[3], y + u[4]
            velocity = (u[3] - of_plane[0], u[4] - of_plane[1], velocity[2])
            carried = eq.turntable_velocity(turning, (x, y))
            faster = eq.turntable_velocity(plane[4], point)
            for i in range(2):
                right[3 + i], u_rate[3 + i] = -force[i], carried[i] + faster[i]
        solve(pose, axes, given, joints, matrix, right, u_rate, moving)
        force = eq.add(force, _in_space(push(pose, axes, u_rate), axes))
        rolling, resisting, twist, lost = (u[0], u[1], 0.0), (0.0, 0.0, 0.0), 0.0, 0.0
        resists = resistance > 0 and not modes.standing
        if modes.slipping or resists:
            # Friction and resistance are proportional to N, and N is linear in them.
            pull = (0.0, 0.0, 0.0)
            if modes.slipping:
                ahead = modes.ahead[k % len(modes.ahead), s % modes.ahead.shape[1]]
                slide = slide if slides else 0.0
                spin = spin if spins and machines.spin_free else 0.0
                pull = _pull(slide, spin, vector(ahead, 0), velocity)
            if resists:
                resisting = eq.scale(-resistance, _along(vector(modes.toward, 0), rolling))
            put(load, 0, (resisting[0], resisting[1], pull[2]))
            for i in range(3, root):
                load[i] = pull[i - 3]
            solve(pose, axes, given, joints, matrix, load, by_torque, moving)
            by_unit = _in_space(push(pose, axes, by_torque), axes)
            normal = force[2] / (1 - by_unit[2])
            for i in range(len(right)):
                right[i] += normal * load[i]
            force, resisting = eq.add(force, eq.scale(normal, by_unit)), eq.scale(normal, resisting)
            twist = normal * pull[2]
            lost = -normal * eq.dot(pull, velocity)
        put(numbers, _PLANE_TORQUE, (resisting[0], resisting[1], twist))
        for i in range(3):
            if given[i]:
                numbers[_PLANE_TORQUE + i] += torque[i] + right[i]
            numbers[_OMEGA + i] = moving[machines.carrier, TURNING + i]
            numbers[_FORCE + i], numbers[_ROLLING + i] = force[i], rolling[i]
            numbers[_SLIP + i] = velocity[i]
        for j in range(count):
            if given[root + j]:
                torques[j] = work.forces[j] + right[root + j]
            numbers[PER_HINGE + j] = rates[j]
        # The derivative of the state.
        by_plane = vector(numbers, _PLANE_TORQUE)
        q, omega = (state[0], state[1], state[2], state[3]), vector(numbers, _OMEGA)
        rate[0], rate[1], rate[2], rate[3] = eq.attitude_rate(q, omega)
        rate[POINT], rate[POINT + 1] = x, y
        momenta(pose, moving, rates, work.forces)
        changes = momentum_rates(pose, moving, slip, work.forces)
        L = eq.add(_in_space(changes, axes), eq.add(heavy, by_plane))
        put(rate, MOMENTUM, L if spins else (-L[1], L[0], 0.0))
        rate[LOSS] = -(by_plane[0] * u[0] + by_plane[1] * u[1])
        for j in range(count):
            rate[HINGES + j] = rates[j]
            free = 0.0 if given[root + j] else work.forces[j] + work.weights[j] + torques[j]
            rate[HINGES + count + j], rate[HINGES + 2 * count + j] = free, torques[j] * rates[j]
        for i in range(3, root):
            rate[slipping + i - 3] = force[i - 3] + bodies[0, WHOLE] * gravity[i - 3]
        if root > 3:
            rate[slipping + 2] = lost
        if moves:
            moved = eq.add(vector(plane, 0), (of_plane[0], of_plane[1], 0.0))
            rate[size - 1] = eq.dot(force, moved) + by_plane[2] * turning


@cache
def differentiate() -> Any:
    """Return the compiled function for the derivatives at the stages of a step, of n robots.

    It takes machines, modes and inputs; length, weights, base, begin and slopes as in
    `dop853.Stages`, for the concatenated states of all robots; arrays for the last displacement and
    for the readings (n, s, ...) at the stages; and a workspace.
    """
    # Return the entry point for the only signature: numba's dispatch on the types of the records
    # takes longer than the derivative of a ball.
    return next(iter(differentiate_stages.code.overloads.values())).entry_point


class Readings(NamedTuple):
    """Readings of states (...); world axes, but for omega.

    force         (..., 3)  N, of the plane on the shell
    plane_torque  (..., 3)  N m, of the plane on the shell about the contact point
    omega         (..., 3)  rad/s of the frame, frame axes
    rolling       (..., 3)  rad/s, the horizontal part of the shell's angular velocity
    slip          (..., 3)  m/s along X and Y, rad/s about Z: the shell's point at the contact,
                            relative to the plane
    rates         (..., h)  rad/s, of the hinges
    torques       (..., h)  N m, of the motors on the hinges
    unlimited     (..., m)  N m, of the motors without limits
    """

    force: Array
    plane_torque: Array
    omega: Array
    rolling: Array
    slip: Array
    rates: Array
    torques: Array
    unlimited: Array

    @property
    def normal(self) -> float:
        """The normal force [N] of a single state."""
        return float(self.force[2])


def readings_of(numbers: Array, count: int) -> Readings:
    """Return readings of `count` hinges as views of an array (..., PER_HINGE + 2h + m)."""
    # Slices, because np.split takes longer than the derivative.
    torques, unlimited = PER_HINGE + count, PER_HINGE + 2 * count
    starts = (_FORCE, _PLANE_TORQUE, _OMEGA, _ROLLING, _SLIP)
    force, plane_torque, omega, rolling, slip = [numbers[..., i : i + 3] for i in starts]
    return Readings(
        force, plane_torque, omega, rolling, slip, numbers[..., PER_HINGE:torques],
        numbers[..., torques:unlimited], numbers[..., unlimited:],
    )  # fmt: skip
