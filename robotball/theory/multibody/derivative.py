"""The compiled derivative of a robot's state, from the formulas of robotball.robot.mechanics.

A state is (q, X, Y, M, loss, angles, h, work): the frame's attitude, the contact point, the
momentum M in space axes, the work lost to rolling resistance, and for every hinge its angle, its
momentum (if its rate is not prescribed) and the work of its motors. If the friction of the plane is
finite, the horizontal momentum P along X and Y and the loss to friction follow, and if the plane
moves or turns its work on the ball. While a rubber shell spins, L takes the place of M. A motor
moves one hinge, or several with gears. The derivative also gives the forces and rates in
`Readings`.

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
    COLUMN,
    MOVING,
    PLACED,
    TURNING,
    bias,
    constrain,
    eliminate,
    mass_matrix,
    momentum_rates,
    move,
    partial_velocities,
    place,
    push,
    put,
    slip_columns,
    solve,
    vector,
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
# rad/s: a shell that rolls no faster stands. Below it the direction of the resistance, which jumps
# at rest, is smoothed.
STANDING = 1e-8
_Axes = tuple[Vector, Vector, Vector]


# The formulas call each other, and numba compiles only calls of registered functions.
for _module in (eq, mechanics):
    for _function in vars(_module).values():
        if isinstance(_function, FunctionType):
            inlined(_function)


class Machine(NamedTuple):
    """The parameters of a scene; with n robots each has a row.

    bodies, radius, carrier: of its `Robot`; motors (m, MOTOR): the laws of the motors; gears
    (m, h); resistance m: the plane's resistance to rolling; friction (2,): its sliding coefficient
    and its torsional one [m], inf if not limited. All robots share carrier, given and spin_free.
    given (6 + h,), or (8 + h,) with the slip velocity: whether a rate is prescribed, and whether
    the shell may turn about each axis of space, which depends on the modes; spin_free: whether a
    shell that sticks may not turn about the vertical.
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
    """Inputs at the stages of a step (s, ...); with n robots each has a row.

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
    the friction of n robots opposes at the stages of a step, 0 for those of their slip.
    """

    motors: NDArray[np.int64]
    standing: bool = False
    toward: Array = np.zeros(3)
    slipping: bool = False
    ahead: Array = np.zeros((1, 1, 3))


class Work(NamedTuple):
    """Workspace of the derivative: code without new arrays compiles faster.

    state (size,); placed, columns, moving: as in `mechanics`; matrix (6 + h, 6 + h): 𝓜 with its
    border, eliminated; rows (5, 6 + h).
    """

    state: Array
    placed: Array
    columns: Array
    moving: Array
    matrix: Array
    rows: Array


def work_of(size: int, hinges: int, slips: int) -> Work:
    """Return the workspace for a state (size,); slips: 2 if the slip velocity is unknown, or 0."""
    b, k = 1 + hinges, 6 + hinges + slips
    shapes = (size,), (b, PLACED), (b, k - 3, COLUMN), (b, MOVING), (k, k), (5, k)
    return Work(*map(np.zeros, shapes))


@inlined
def _pose(state: Any, machine: Machine, modes: Modes, work: Work) -> _Axes:
    """Place the bodies and eliminate 𝓜. Returns the axes of space in carrier axes."""
    count, given, standing = len(machine.bodies) - 1, machine.given, modes.standing
    free = work.columns.shape[1]
    axes = eq.space_axes((state[0], state[1], state[2], state[3]))
    place(machine.bodies, machine.carrier, state[HINGES : HINGES + count], work.placed)
    partial_velocities(machine.bodies, work.placed, machine.radius, axes[2], work.columns)
    if free > 3 + count:
        slip_columns(work.columns, axes[0], axes[1])
        given[3 + count] = given[4 + count] = not (modes.slipping and machine.friction[0] < np.inf)
    mass_matrix(machine.bodies, work.placed, work.columns, work.matrix)
    # A standing shell does not turn about the horizontal axes, a rubber one not about the vertical.
    given[free] = given[free + 1] = not standing
    given[free + 2] = not _keeps_spin(machine, modes)
    constrain(work.matrix, axes)
    eliminate(work.matrix, given)
    return axes


@inlined
def _keeps_spin(machine: Machine, modes: Modes) -> bool:
    """Return whether the shell may not turn about the vertical."""
    return machine.spin_free and not (modes.slipping and machine.friction[1] < np.inf)


@inlined
def _motors_act(
    machine: Machine, commands: Any, sides: Any, state: Any, u: Any, torques: Any, unlimited: Any
) -> None:
    """Write the torques (h,) on the hinges, and the torques (m,) of motors without limits."""
    count = len(torques)
    torques[:] = 0.0
    for i in range(len(unlimited)):
        motor, angle, speed = machine.motors[i], 0.0, 0.0
        for j in range(count):
            angle += machine.gears[i, j] * state[HINGES + j]
            speed += machine.gears[i, j] * u[3 + j]
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
            torques[j] += machine.gears[i, j] * torque


@inlined
def _across(v: Vector, gamma: Vector) -> Vector:
    return eq.subtract(v, eq.scale(eq.dot(v, gamma), gamma))


@inlined
def _pull(machine: Machine, along: Vector, velocity: Vector) -> Vector:
    """Return -W²v/|Wv|, the friction over the normal force: along X and Y, and about Z [m]."""
    slide = machine.friction[0] if machine.friction[0] < np.inf else 0.0
    spin = machine.friction[1] if machine.spin_free and machine.friction[1] < np.inf else 0.0
    weighted = (slide * velocity[0], slide * velocity[1], spin * velocity[2])
    if eq.dot(along, along) == 0.0:
        along = weighted
    length = np.sqrt(eq.dot(along, along))
    along = eq.scale(-1 / length if length > 0.0 else 0.0, along)
    return (slide * along[0], slide * along[1], spin * along[2])


@inlined
def _along(toward: Any, axes: _Axes, rolling: Vector) -> Vector:
    """Return the direction of the rolling, which the plane's resistance opposes."""
    # Below STANDING it changes continuously into the direction in which the shell will roll.
    speed = np.sqrt(eq.dot(rolling, rolling))
    ahead = eq.seen_from_frame(vector(toward, 0), axes)
    along = eq.add(rolling, eq.scale(max(STANDING - speed, 0.0), ahead))
    length = np.sqrt(eq.dot(along, along))
    return eq.scale(1 / length if length > STANDING / 2 else 0.0, along)


@inlined
def _write_rates(
    machine: Machine, axes: _Axes, gravity: Vector, level: Vector, twist: Vector, slip: Vector,
    spins: bool, torques: Any, state: Any, work: Work, rate: Any,
) -> None:  # fmt: skip
    """Write the derivative of the state.

    level, twist: the plane's horizontal torque and its friction torque about the vertical; slip:
    velocity of the shell's point at the contact; spins: M is L, not γ×L.
    """
    (alpha, beta, gamma), count, moving = axes, len(torques), work.moving
    u, momenta = work.rows[1], work.rows[0]
    momentum_rates(
        machine.bodies, work.placed, moving, machine.radius, gamma, gravity, slip, momenta
    )  # fmt: skip
    L_rate, shell = eq.add(eq.add(vector(momenta, 0), level), twist), vector(u, 0)
    M_rate = L_rate if spins else eq.cross(gamma, L_rate)
    q, omega = (state[0], state[1], state[2], state[3]), vector(moving[machine.carrier], TURNING)
    rate[0], rate[1], rate[2], rate[3] = eq.attitude_rate(q, omega)
    rate[POINT], rate[POINT + 1] = eq.contact_velocity(
        alpha, beta, shell, (0.0, 0.0, 0.0), machine.radius
    )
    rate[POINT] += eq.dot(alpha, slip)
    rate[POINT + 1] += eq.dot(beta, slip)
    put(rate, MOMENTUM, (eq.dot(alpha, M_rate), eq.dot(beta, M_rate), eq.dot(gamma, M_rate)))
    if not spins:
        # M = γ×L is horizontal; without this its rounding would accumulate.
        rate[MOMENTUM + 2] = 0.0
    rate[LOSS] = -eq.dot(level, shell)
    for j in range(count):
        rate[HINGES + j] = u[3 + j]
        rate[HINGES + count + j] = 0.0 if machine.given[3 + j] else momenta[3 + j] + torques[j]
        rate[HINGES + 2 * count + j] = torques[j] * u[3 + j]


@inlined
def _differentiate(
    state: Any, machine: Machine, modes: Modes, inputs: Inputs, s: int, work: Work, rate: Any,
    readings: Any,
) -> None:  # fmt: skip
    """Write the derivative of a state at stage s, and its readings."""
    count, given, matrix = len(machine.bodies) - 1, machine.given, work.matrix
    free, friction = work.columns.shape[1], HINGES + 3 * count
    rows, gravity = work.rows, vector(inputs.gravity[s], 0)
    rows[:] = 0.0
    right, u, u_rate, torques_bias, by_torque = rows[0], rows[1], rows[2], rows[3], rows[4]
    axes = _pose(state, machine, modes, work)
    spins = not _keeps_spin(machine, modes)
    gamma, gravity = axes[2], eq.seen_from_frame(gravity, axes)
    M = eq.seen_from_frame(vector(state, MOMENTUM), axes)
    # L = M×γ + λγ in the rubber model; (ω_s, γ) = 0 stands in for the unknown λ.
    put(right, 0, M if spins else eq.cross(M, gamma))
    for j in range(count):
        right[3 + j], u[3 + j] = state[HINGES + count + j], inputs.rates[s, j]
    # A shell that sticks has the plane's velocity at the contact, a rubber one also its rotation.
    turning = inputs.plane[s, 3]
    of_plane = eq.turntable_velocity(turning, (state[POINT], state[POINT + 1]))
    right[free + 2] = turning
    for i in range(3 + count, free):
        right[i], u[i] = state[friction + i - 3 - count], of_plane[i - 3 - count]
    solve(matrix, given, right, u)
    move(work.columns, u, work.moving)
    torques = readings[PER_HINGE + count : PER_HINGE + 2 * count]
    unlimited = readings[PER_HINGE + 2 * count :]
    _motors_act(machine, inputs.commands[s], modes.motors, state, u, torques, unlimited)
    force = bias(
        machine.bodies, work.placed, work.columns, work.moving, machine.radius, gamma, gravity, u,
        torques_bias,
    )  # fmt: skip
    for i in range(free):
        right[i] = -torques_bias[i]
    for j in range(count):
        right[3 + j] += torques[j]
        u_rate[3 + j] = inputs.accelerations[s, j]
    slip, velocity = eq.scale(0.0, gamma), (0.0, 0.0, eq.dot(vector(u, 0), gamma) - turning)
    if free > 3 + count:
        slip = eq.add(eq.scale(u[3 + count], axes[0]), eq.scale(u[4 + count], axes[1]))
        velocity = (u[3 + count] - of_plane[0], u[4 + count] - of_plane[1], velocity[2])
        # The contact point moves over the plane.
        x, y = eq.contact_velocity(
            axes[0], axes[1], vector(u, 0), (0.0, 0.0, 0.0), machine.radius
        )  # fmt: skip
        carried = eq.turntable_velocity(turning, (x + u[3 + count], y + u[4 + count]))
        faster = eq.turntable_velocity(inputs.plane[s, 4], (state[POINT], state[POINT + 1]))
        u_rate[3 + count], u_rate[4 + count] = carried[0] + faster[0], carried[1] + faster[1]
    right[free + 2] = inputs.plane[s, 4]
    solve(matrix, given, right, u_rate)
    force = eq.add(force, push(machine.bodies, work.columns, u_rate))
    rolling = _across(vector(u, 0), gamma)
    resisting = eq.scale(0.0, gamma)
    twist, lost = eq.scale(0.0, gamma), 0.0
    if modes.slipping:
        # Friction and resistance are proportional to N, and N is linear in them.
        pull = _pull(machine, vector(modes.ahead[s % len(modes.ahead)], 0), velocity)
        right[:] = 0.0
        if machine.resistance > 0 and not modes.standing:
            resisting = eq.scale(-machine.resistance, _along(modes.toward, axes, rolling))
        put(right, 0, eq.add(resisting, eq.scale(pull[2], gamma)))
        right[3 + count], right[4 + count] = pull[0], pull[1]
        solve(matrix, given, right, by_torque)
        by_unit = push(machine.bodies, work.columns, by_torque)
        normal = eq.dot(gamma, force) / (1 - eq.dot(gamma, by_unit))
        for i in range(len(u_rate)):
            u_rate[i] += normal * by_torque[i]
        force, resisting = eq.add(force, eq.scale(normal, by_unit)), eq.scale(normal, resisting)
        twist = eq.scale(normal * pull[2], gamma)
        lost = -normal * eq.dot(pull, velocity)
    elif machine.resistance > 0 and not modes.standing:
        # The torque is μN, and N is linear in it.
        along = _along(modes.toward, axes, rolling)
        right[:] = 0.0
        put(right, 0, eq.scale(-1.0, along))
        solve(matrix, given, right, by_torque)
        by_unit = push(machine.bodies, work.columns, by_torque)
        torque = machine.resistance * eq.dot(gamma, force)
        torque = torque / (1 - machine.resistance * eq.dot(gamma, by_unit))
        for i in range(len(u_rate)):
            u_rate[i] += torque * by_torque[i]
        force, resisting = eq.add(force, eq.scale(torque, by_unit)), eq.scale(-torque, along)
    # The last unknowns are the negative torques of the plane about the axes of space.
    level = eq.add(eq.scale(u_rate[free], axes[0]), eq.scale(u_rate[free + 1], axes[1]))
    level = eq.subtract(resisting, level)
    for j in range(count):
        if given[3 + j]:
            torques[j] = torques_bias[3 + j]
            for i in range(free):
                torques[j] += matrix[3 + j, i] * u_rate[i]
    _write_rates(machine, axes, gravity, level, twist, slip, spins, torques, state, work, rate)
    for i in range(3):
        readings[_FORCE + i] = eq.dot(axes[i], force)
        readings[_PLANE_TORQUE + i] = eq.dot(axes[i], eq.add(resisting, twist)) - u_rate[free + i]
        readings[_OMEGA + i] = work.moving[machine.carrier, TURNING + i]
        readings[_ROLLING + i] = eq.dot(axes[i], rolling)
    for j in range(count):
        readings[PER_HINGE + j] = u[3 + j]
    if free > 3 + count:
        mass = 0.0
        for b in range(len(machine.bodies)):
            mass += machine.bodies[b, 0]
        for i in range(2):
            rate[friction + i] = readings[_FORCE + i] + mass * eq.dot(axes[i], gravity)
        rate[friction + 2] = lost
        friction += 3
    for i in range(3):
        readings[_SLIP + i] = velocity[i]
    if len(state) > friction:
        turned = (of_plane[0], of_plane[1], 0.0)
        moved = eq.add(vector(inputs.plane[s], 0), turned)
        rate[friction] = eq.dot(vector(readings, _FORCE), moved)
        rate[friction] += readings[_PLANE_TORQUE + 2] * turning


_ROW, _TABLE, _TABLES = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_MACHINE = (
    _TABLES, _ROW, types.int64, _TABLES, _TABLES, types.boolean[::1], types.boolean, _ROW, _TABLE,
)  # fmt: skip
_SIGNATURE = types.void(
    types.NamedTuple(_MACHINE, Machine),
    types.NamedTuple((types.int64[::1], types.boolean, _ROW, types.boolean, _TABLES), Modes),
    types.NamedUniTuple(_TABLES, 5, Inputs),
    types.float64, _TABLE, _ROW, _ROW, _TABLE, _ROW, _TABLES,
    types.NamedTuple((_ROW, _TABLE, _TABLES, _TABLE, _TABLE, _TABLE), Work),
)  # fmt: skip


@compiled_from(text_of(rotations.__file__, eq.__file__, mechanics.__file__, __file__), _SIGNATURE)
def differentiate_stages(
    machines: Machine, modes: Modes, inputs: Inputs, length: float, weights: Any, base: Any,
    begin: Any, slopes: Any, ends: Any, readings: Any, work: Work,
) -> None:  # fmt: skip
    size = len(work.state)
    for k in range(len(readings)):
        machine = Machine(
            machines.bodies[k], machines.radius[k], machines.carrier, machines.motors[k],
            machines.gears[k], machines.given, machines.spin_free, machines.resistance[k],
            machines.friction[k],
        )  # fmt: skip
        robot_inputs = Inputs(
            inputs.rates[k], inputs.accelerations[k], inputs.commands[k], inputs.gravity[k],
            inputs.plane[k],
        )  # fmt: skip
        robot_modes = Modes(
            modes.motors, modes.standing, modes.toward, modes.slipping,
            modes.ahead[k % len(modes.ahead)],
        )  # fmt: skip
        for s in range(len(weights)):
            before = len(slopes) - len(weights) + s
            rate = slopes[before, k * size : (k + 1) * size]
            for i in range(size):
                change, at = 0.0, k * size + i
                for j in range(before):
                    change += weights[s, j] * slopes[j, at]
                ends[at] = begin[at] + length * change
                work.state[i] = base[at] + ends[at]
            _differentiate(
                work.state, machine, robot_modes, robot_inputs, s, work, rate, readings[k, s]
            )


@cache
def differentiate() -> Any:
    """Return the compiled function for the derivatives at the stages of a step, of n robots.

    It takes machines, modes and inputs; length, weights, base, begin and slopes as in
    `dop853.Stages`, for the concatenated states of all robots; arrays for the last displacement and
    for the readings (n, s, ...) at the stages; and a workspace.
    """
    # The entry of its only signature: numba's dispatch on the types of its records takes longer
    # than the derivative of a ball.
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
