"""The derivative of a robot's state, by the formulas of robotball.mechanics, compiled.

A state is (q, X, Y, M, loss, angles, h, work): the frame's attitude, the contact point, the
momentum M in space axes, the work lost to rolling resistance, and of every hinge its angle, its
momentum (used where its rate is not given) and the work of its motors. A motor moves one hinge, or
several by gears. Where the plane moves, its work on the ball follows. The derivative is computed
with readings of the state, the forces and rates that it takes: see `Readings`.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from robotball import equations as eq
from robotball import mechanics
from robotball.drives import Constant, Drive
from robotball.engines.compiled import compiled_from, inlined
from robotball.equations import Vector
from robotball.function_drives import Held
from robotball.mechanics import (
    COLUMN,
    MOVING,
    PLACED,
    TURNING,
    eliminate,
    mass_matrix,
    momentum_rates,
    move,
    needed,
    partial_velocities,
    place,
    put,
    solve_rolling,
    vector,
)
from robotball.motors import SLOW
from robotball.rotations import Array, Mask
from robotball.scene import Scene

# Places in a state; from HINGES on the angles, the momenta and the work, h numbers each.
POINT, MOMENTUM, LOSS, HINGES = 4, 6, 9, 10
# Places in the readings; from _PER_HINGE on the hinges' rates and torques, h each, and the motors'
# torques without limits.
_FORCE, _PLANE_TORQUE, _OMEGA, _ROLLING, _PER_HINGE = 0, 3, 6, 9, 12
# Places in a motor's row: the numbers of its law.
_PER_COMMAND, _PER_ANGLE, _PER_RATE, _AT_REST, _LIMIT, _FRICTION, _MOTOR = 0, 1, 2, 3, 4, 5, 6
# rad/s: a shell that rolls no faster stands. The direction of the resistance, which would jump at
# rest, is smoothed below it.
STANDING = 1e-8


def _sources() -> str:
    # All that the derivative is compiled from: kept code is stale where one of them changes.
    files = (eq.__file__, mechanics.__file__, __file__)
    return "".join(Path(file).read_text(encoding="utf-8") for file in files)


# The formulas call each other by name, and numba compiles only calls of functions that it knows.
for _module in (eq, mechanics):
    for _function in vars(_module).values():
        if isinstance(_function, FunctionType):
            inlined(_function)


class Machine(NamedTuple):
    """The numbers of a scene that stay while it moves; of n robots, those of each are in a row.

    bodies, radius, carrier: of its `Robot`; gravity (3,) m/s², world, which changes where the plane
    moves; motors (m, _MOTOR), the numbers of their laws; gears (m, h); resistance m, of the plane
    to rolling. The same of all robots: carrier; given (3 + h,): whether a rate is given; spin_free:
    whether the shell may not turn about the vertical.
    """

    bodies: Array
    radius: Any
    carrier: int
    gravity: Array
    motors: Array
    gears: Array
    given: Mask
    spin_free: bool
    resistance: Any


class Inputs(NamedTuple):
    """The drives at a time: given rates and accelerations (h,), and the motors' commands (m,).

    Of n robots, those of each are in a row.
    """

    rates: Array
    accelerations: Array
    commands: Array


class Modes(NamedTuple):
    """The modes of a robot; while they stay, the derivative is a smooth function of the state.

    motors (m,): -1, 0 or 1, the side of its limit on which a motor is; standing: whether the
    plane's resistance to rolling holds the shell; toward (3,), world: the direction in which it
    will roll.
    """

    motors: NDArray[np.int64]
    standing: bool = False
    toward: Array = np.zeros(3)


class _Pose(NamedTuple):
    """A state as the formulas of `mechanics` take it, in the axes of the carrier.

    matrix: 𝓜 as `eliminate` leaves it; directions (c, 3): those about which the shell may not turn.
    """

    axes: tuple[Vector, Vector, Vector]
    gravity: Vector
    placed: Any
    columns: Any
    matrix: Any
    directions: Any


@inlined
def _pose_of(state: Any, machine: Machine, standing: bool) -> _Pose:
    k = len(machine.given)
    axes = eq.space_axes((state[0], state[1], state[2], state[3]))
    placed, columns = np.zeros((k - 2, PLACED)), np.zeros((k - 2, k, COLUMN))
    matrix = np.zeros((k, k))
    place(machine.bodies, machine.carrier, state[HINGES : HINGES + k - 3], placed)
    partial_velocities(machine.bodies, placed, machine.radius, axes[2], columns)
    mass_matrix(machine.bodies, placed, columns, matrix)
    eliminate(matrix, machine.given)
    # A shell that stands turns about neither horizontal axis, a rubber one not about the vertical.
    first, end = 0 if standing else 2, 3 if machine.spin_free else 2
    directions = np.zeros((end - first, 3))
    for i in range(first, end):
        put(directions[i - first], 0, axes[i])
    gravity = eq.seen_from_frame(vector(machine.gravity, 0), axes)
    return _Pose(axes, gravity, placed, columns, matrix, directions)


# `solve_rolling` is called by the derivative alone: numba optimises it anew in every function that
# calls it, and in all that call that one.
@inlined
def _momenta(state: Any, machine: Machine, inputs: Inputs, pose: _Pose) -> tuple[Any, Any]:
    """Return (L, h) and u (3 + h,), of which the given rates are known."""
    count = len(inputs.rates)
    right, u = np.zeros(3 + count), np.zeros(3 + count)
    M = eq.seen_from_frame(vector(state, MOMENTUM), pose.axes)
    # L = M×γ + λγ in the rubber model; (ω_s, γ) = 0 stands in for the unknown λ.
    put(right, 0, eq.cross(M, pose.axes[2]) if machine.spin_free else M)
    for j in range(count):
        right[3 + j], u[3 + j] = state[HINGES + count + j], inputs.rates[j]
    return right, u


@inlined
def _motors_act(
    state: Any, machine: Machine, inputs: Inputs, modes: Modes, u: Any, torques: Any, unlimited: Any
) -> None:
    """Write the torques (h,) of the motors on the hinges, and those (m,) without limits."""
    count = len(torques)
    torques[:] = 0.0
    for i in range(len(unlimited)):
        motor, angle, speed = machine.motors[i], 0.0, 0.0
        for j in range(count):
            angle += machine.gears[i, j] * state[HINGES + j]
            speed += machine.gears[i, j] * u[3 + j]
        free = (
            motor[_PER_COMMAND] * inputs.commands[i]
            - motor[_PER_ANGLE] * angle
            - motor[_PER_RATE] * speed
            + motor[_AT_REST]
        )
        if motor[_FRICTION] > 0:
            free -= motor[_FRICTION] * np.tanh(speed / SLOW)
        unlimited[i] = free
        torque = free if modes.motors[i] == 0 else modes.motors[i] * motor[_LIMIT]
        for j in range(count):
            torques[j] += machine.gears[i, j] * torque


@inlined
def _forces(machine: Machine, pose: _Pose, u: Any, moving: Any, u_rate: Any, by_plane: Any) -> Any:
    """Write the torques that u needs to change so, by the plane first; return the plane's force."""
    return needed(
        machine.bodies, pose.placed, pose.columns, moving, machine.radius, pose.axes[2],
        pose.gravity, u, u_rate, by_plane,
    )  # fmt: skip


@inlined
def _accelerating(inputs: Inputs, by_plane: Any, torques: Any, right: Any, u_rate: Any) -> None:
    """Write the torques that accelerate the robot, and those of du/dt (3 + h,) that are given."""
    # The torques that no acceleration at all would need are the bias; without them, solving for
    # accelerations has the same matrix as solving for rates.
    for i in range(len(right)):
        right[i] = -by_plane[i]
    for j in range(len(torques)):
        right[3 + j] += torques[j]
        u_rate[3 + j] = inputs.accelerations[j]


@inlined
def _rolling_of(u: Any, pose: _Pose) -> Vector:
    """Return the horizontal part of the shell's angular velocity."""
    return _across(vector(u, 0), pose.axes[2])


@inlined
def _across(v: Vector, gamma: Vector) -> Vector:
    return eq.subtract(v, eq.scale(eq.dot(v, gamma), gamma))


@inlined
def _along(modes: Modes, pose: _Pose, u: Any) -> Vector:
    """Return the direction of the rolling, which the plane's resistance is against."""
    # Below STANDING it goes over, without a jump, into the one in which the shell will roll.
    rolling = _rolling_of(u, pose)
    speed = np.sqrt(eq.dot(rolling, rolling))
    ahead = eq.seen_from_frame(vector(modes.toward, 0), pose.axes)
    along = eq.add(rolling, eq.scale(max(STANDING - speed, 0.0), ahead))
    length = np.sqrt(eq.dot(along, along))
    return eq.scale(1 / length if length > STANDING / 2 else 0.0, along)


@inlined
def _resist(
    machine: Machine, pose: _Pose, u: Any, moving: Any, by_torque: Any, u_rate: Any, by_plane: Any,
    force: Vector,
) -> Any:  # fmt: skip
    """Add the plane's resistance to du/dt and the torques; return the plane's force.

    by_torque (3 + h,): du/dt by a unit torque against the rolling. The torque is μN, and N is
    linear in it.
    """
    gamma, changed = pose.axes[2], np.zeros(len(u))
    for i in range(len(u)):
        changed[i] = u_rate[i] + by_torque[i]
    normal = eq.dot(gamma, force)
    per_torque = eq.dot(gamma, _forces(machine, pose, u, moving, changed, by_plane)) - normal
    torque = machine.resistance * normal / (1 - machine.resistance * per_torque)
    for i in range(len(u)):
        u_rate[i] += torque * by_torque[i]
    return _forces(machine, pose, u, moving, u_rate, by_plane)


@inlined
def _write_rates(
    machine: Machine, pose: _Pose, u: Any, moving: Any, torques: Any, by_plane: Any, state: Any,
    rate: Any,
) -> None:  # fmt: skip
    """Write the derivative of the state; by_plane (3 + h,) begins with the plane's torque."""
    (alpha, beta, gamma), count, shell = pose.axes, len(torques), vector(u, 0)
    momenta = np.zeros(3 + count)
    momentum_rates(
        machine.bodies, pose.placed, moving, machine.radius, gamma, pose.gravity, momenta
    )
    L_rate = vector(momenta, 0)
    rate[LOSS] = 0.0
    if machine.resistance > 0:
        level = _across(vector(by_plane, 0), gamma)
        L_rate = eq.add(L_rate, level)
        rate[LOSS] = -eq.dot(level, shell)
    M_rate = eq.cross(gamma, L_rate) if machine.spin_free else L_rate
    q, omega = (state[0], state[1], state[2], state[3]), vector(moving[machine.carrier], TURNING)
    rate[0], rate[1], rate[2], rate[3] = eq.attitude_rate(q, omega)
    rate[POINT], rate[POINT + 1] = eq.contact_velocity(
        alpha, beta, shell, (0.0, 0.0, 0.0), machine.radius
    )
    put(rate, MOMENTUM, (eq.dot(alpha, M_rate), eq.dot(beta, M_rate), eq.dot(gamma, M_rate)))
    if machine.spin_free:
        # M = γ×L is horizontal, and rounding must not add up to anything else.
        rate[MOMENTUM + 2] = 0.0
    for j in range(count):
        rate[HINGES + j] = u[3 + j]
        rate[HINGES + count + j] = 0.0 if machine.given[3 + j] else momenta[3 + j] + torques[j]
        rate[HINGES + 2 * count + j] = torques[j] * u[3 + j]


_ROW, _TABLE, _TABLES = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_MACHINE = (
    _TABLES, _ROW, types.int64, _TABLE, _TABLES, _TABLES, types.boolean[::1], types.boolean, _ROW,
)  # fmt: skip
_SIGNATURE = types.void(
    _TABLE,
    types.NamedTuple(_MACHINE, Machine),
    types.NamedUniTuple(_TABLE, 3, Inputs),
    types.NamedTuple((types.int64[::1], types.boolean, _ROW), Modes),
    _TABLE,
    _TABLE,
)


@compiled_from(_sources(), _SIGNATURE, nogil=True, error_model="numpy")
def _differentiate(
    states: Any, machines: Machine, inputs: Inputs, modes: Modes, rates: Any, readings: Any
) -> None:
    """Write the derivatives of robots' states into `rates`, and the readings into `readings`."""
    for i in range(len(states)):
        machine = Machine(
            machines.bodies[i], machines.radius[i], machines.carrier, machines.gravity[i],
            machines.motors[i], machines.gears[i], machines.given, machines.spin_free,
            machines.resistance[i],
        )  # fmt: skip
        own = Inputs(inputs.rates[i], inputs.accelerations[i], inputs.commands[i])
        _differentiate_one(states[i], machine, own, modes, rates[i], readings[i])


@inlined
def _differentiate_one(
    state: Any, machine: Machine, inputs: Inputs, modes: Modes, rate: Any, readings: Any
) -> None:
    count, pose = len(inputs.rates), _pose_of(state, machine, modes.standing)
    right, u = _momenta(state, machine, inputs, pose)
    solve_rolling(pose.matrix, machine.given, pose.directions, right, u)
    moving = np.zeros((len(machine.bodies), MOVING))
    move(pose.columns, u, moving)
    torques = readings[_PER_HINGE + count : _PER_HINGE + 2 * count]
    unlimited = readings[_PER_HINGE + 2 * count :]
    _motors_act(state, machine, inputs, modes, u, torques, unlimited)
    u_rate, by_plane = np.zeros(3 + count), np.zeros(3 + count)
    _forces(machine, pose, u, moving, u_rate, by_plane)
    _accelerating(inputs, by_plane, torques, right, u_rate)
    solve_rolling(pose.matrix, machine.given, pose.directions, right, u_rate)
    force = _forces(machine, pose, u, moving, u_rate, by_plane)
    if machine.resistance > 0 and not modes.standing:
        right, by_torque = np.zeros(3 + count), np.zeros(3 + count)
        put(right, 0, eq.scale(-1.0, _along(modes, pose, u)))
        solve_rolling(pose.matrix, machine.given, pose.directions, right, by_torque)
        force = _resist(machine, pose, u, moving, by_torque, u_rate, by_plane, force)
    for j in range(count):
        if machine.given[3 + j]:
            torques[j] = by_plane[3 + j]
    _write_rates(machine, pose, u, moving, torques, by_plane, state, rate)
    rolling = _rolling_of(u, pose)
    for i in range(3):
        readings[_FORCE + i] = eq.dot(pose.axes[i], force)
        readings[_PLANE_TORQUE + i] = eq.dot(pose.axes[i], vector(by_plane, 0))
        readings[_OMEGA + i] = moving[machine.carrier, TURNING + i]
        readings[_ROLLING + i] = eq.dot(pose.axes[i], rolling)
    for j in range(count):
        readings[_PER_HINGE + j] = u[3 + j]


@dataclass(frozen=True)
class Readings:
    """Readings of states (...); world axes, but for omega.

    numbers       (..., _PER_HINGE + 2h + m)  all of them, as the derivative writes them
    force         (..., 3)  N, of the plane on the shell
    plane_torque  (..., 3)  N m, of the plane on the shell about the contact point
    omega         (..., 3)  rad/s of the frame, frame axes
    rolling       (..., 3)  rad/s, the horizontal part of the shell's angular velocity
    rates         (..., h)  rad/s, of the hinges
    torques       (..., h)  N m, of the motors on the hinges
    unlimited     (..., m)  N m, the motors' torques as they would be without limits
    """

    numbers: Array
    force: Array
    plane_torque: Array
    omega: Array
    rolling: Array
    rates: Array
    torques: Array
    unlimited: Array

    @property
    def normal(self) -> float:
        """The normal force [N] of a single state."""
        return float(self.force[2])


def readings_of(numbers: Array, count: int) -> Readings:
    """Return the readings of `count` hinges in an array (..., _PER_HINGE + 2h + m), as views."""
    threes = (numbers[..., i : i + 3] for i in (_FORCE, _PLANE_TORQUE, _OMEGA, _ROLLING))
    per_hinge = numbers[..., _PER_HINGE:]  # in slices: np.split takes longer than the derivative
    ends = (0, count), (count, 2 * count), (2 * count, None)
    return Readings(numbers, *threes, *(per_hinge[..., begin:end] for begin, end in ends))


@cache
def _entry() -> Any:
    # By the entry of its only signature: to look at the types of its records again and again would
    # take longer than the derivative of a ball.
    return next(iter(_differentiate.code.overloads.values())).entry_point


class System:
    """The derivative of a scene's state in given modes, up to the time `end` of a smooth piece.

    Of several scenes, which differ by numbers alone, a state has the numbers of all, in the modes
    of the first. Its readings, and so its margins, are those of the first.
    """

    def __init__(self, *scenes: Scene) -> None:
        first, self.scenes = scenes[0], scenes
        hinges, robot = first.hinges, first.robot
        self.scene, self.count = first, len(hinges)
        given = np.array([False] * 3 + [hinge.motor is None for hinge in hinges])
        motors = np.stack([_laws_of(each) for each in scenes])
        self.size = HINGES + 3 * self.count + first.plane_moves
        self.readings_size = _PER_HINGE + 2 * self.count + motors.shape[1]
        self.limits = motors[0, :, _LIMIT]
        self.limited = np.flatnonzero(np.isfinite(self.limits)).tolist()
        self.ranges = [
            (HINGES + i, each.range) for i, each in enumerate(first.ball.tree[1:]) if each.range
        ]
        self.modes = Modes(np.zeros(motors.shape[1], dtype=np.int64))
        # The plane's coefficient of resistance to rolling [m].
        self.resistance = float(first.friction.rolling)
        self.machine = Machine(
            np.stack([each.robot.bodies for each in scenes]),
            np.array([float(each.robot.radius) for each in scenes]),
            robot.carrier,
            np.stack([each.gravity_at(0.0) for each in scenes]),
            motors,
            np.stack([_gears_of(each) for each in scenes]),
            given,
            first.rolling == "rubber",
            np.array([float(each.friction.rolling) for each in scenes]),
        )
        self._inputs = Inputs(
            np.array([[float(hinge.command.rate(0.0)) for hinge in s.hinges] for s in scenes]),
            np.zeros((len(scenes), self.count)),
            np.zeros((len(scenes), motors.shape[1])),
        )
        self._commands = [
            [*(hinge.command for hinge in each.hinges if hinge.motor is not None), *each.controls]
            for each in scenes
        ]
        self.holds = any(isinstance(command, Held) for command in self._commands[0])
        self._plane_velocity = np.zeros((len(scenes), 3))
        # The planes that move differently, each by a scene and the robots on it.
        self._planes: dict[Any, tuple[Scene, list[int]]] = {}
        for k, each in enumerate(scenes if first.plane_moves else ()):
            plane = *each.gravity_world.tolist(), *each.plane_drives
            self._planes.setdefault(plane, (each, []))[1].append(k)
        self._changing_rates = _alike(
            (i, hinge.command, k)
            for k, each in enumerate(scenes)
            for i, hinge in enumerate(each.hinges)
            if hinge.motor is None
        )
        self.begin(0.0, np.inf)

    def begin(self, t: float, end: float) -> None:
        """Begin a smooth piece from t to `end` [s], in which each command is one drive."""
        # A drive's rate may jump at the end, and the piece's last state is before the jump.
        self.end = float(np.nextafter(end, t))
        self._known: tuple[float, bytes, Modes, tuple[Array, Array]] | None = None
        drives = [
            (i, command.at(t) if isinstance(command, Held) else command, k)
            for k, commands in enumerate(self._commands)
            for i, command in enumerate(commands)
        ]
        for i, drive, k in drives:
            self._inputs.commands[k, i] = drive.rate(t)
        self._changing_commands = _alike(drives)

    @cached_property
    def scale(self) -> Array:
        """The units in which the errors of a state's numbers are measured."""
        return np.concatenate([_scale_of(each) for each in self.scenes])

    def start(self) -> Array:
        """Return the state at the start of the scene."""
        return np.concatenate([self._start_of(each) for each in self.scenes])

    def _start_of(self, scene: Scene) -> Array:
        state, start = np.zeros(self.size), scene.start
        state[:4], state[MOMENTUM : MOMENTUM + 3] = start.attitude, start.momentum
        state[HINGES : HINGES + self.count] = scene.hinged[0, 0]
        if not self.machine.given[3:].all():
            one = scene.states_of(scene.angular_velocity_at(start))
            state[HINGES + self.count : HINGES + 2 * self.count] = one.momenta[3:, 0]
        return state

    def rate(self, t: float, state: Array) -> Array:
        """Return the derivative of a state at time t [s]."""
        return self._run(t, state)[0]

    def readings(self, t: float, state: Array) -> Readings:
        """Return the readings of a state at time t [s]."""
        return readings_of(self.numbers(t, state)[0], self.count)

    def numbers(self, t: float, state: Array) -> Array:
        """Return the numbers of the readings at time t [s], a row for each scene."""
        return self._run(t, state)[1]

    def _run(self, t: float, state: Array) -> tuple[Array, Array]:
        rows = np.ascontiguousarray(state, dtype=float)  # as the entry takes without a look
        # The last one again: a step's end is where margins are read, and the next one begins.
        text = rows.tobytes()
        if self._known and self._known[:2] == (t, text) and self._known[2] is self.modes:
            return self._known[3]
        rows = rows.reshape(-1, self.size)
        rates, readings = np.empty(rows.shape), np.empty((len(rows), self.readings_size))
        self._drive(t)
        _entry()(rows, self.machine, self._inputs, self.modes, rates, readings)
        if self.scene.plane_moves:
            for rate, read, velocity in zip(rates, readings, self._plane_velocity, strict=False):
                rate[-1] = read[_FORCE:_PLANE_TORQUE] @ velocity
        self._known = t, text, self.modes, (rates.ravel(), readings)
        return self._known[3]

    def _drive(self, t: float) -> None:
        """Set the drives and the plane as they are at time t [s]."""
        for i, drive, robots in self._changing_rates:
            rate = drive.rate(t)
            # A piece's last state has the acceleration of this piece, not that of the next one.
            acceleration = drive.acceleration(min(t, self.end))
            for k in robots:
                self._inputs.rates[k, i], self._inputs.accelerations[k, i] = rate, acceleration
        for i, drive, robots in self._changing_commands:
            command = drive.rate(min(t, self.end))  # one that is held may jump
            for k in robots:
                self._inputs.commands[k, i] = command
        for scene, robots in self._planes.values():
            self.machine.gravity[robots] = scene.gravity_at(t)
            self._plane_velocity[robots] = [each.angle(t) for each in scene.plane_drives]


def _alike(drives: Iterable[tuple[int, Drive, int]]) -> list[tuple[int, Drive, list[int]]]:
    """Return drives that change, each once with its place and the robots that have it."""
    found: dict[tuple[int, Drive], list[int]] = {}
    for i, drive, robot in drives:
        if not isinstance(drive, Constant):
            found.setdefault((i, drive), []).append(robot)
    return [(i, drive, each) for (i, drive), each in found.items()]


def _laws_of(scene: Scene) -> Array:
    """Return the laws (m, _MOTOR) of a scene's motors, those of hinges first."""
    laws = [hinge.motor.law for hinge in scene.hinges if hinge.motor is not None]
    return np.array([*laws, *(each.law for each in scene.actuators)]).reshape(-1, _MOTOR)


def _gears_of(scene: Scene) -> Array:
    """Return how much each motor (m, h) turns by a hinge's angle."""
    names = [hinge.name for hinge in scene.hinges]
    own = [{hinge.name: 1.0} for hinge in scene.hinges if hinge.motor is not None]
    gears = [*own, *(dict(each.gears) for each in scene.actuators)]
    rows = [[each.get(name, 0.0) for name in names] for each in gears]
    return np.array(rows).reshape(len(rows), len(names))


def _scale_of(scene: Scene) -> Array:
    # Fixed ones: a ball at rest has no momentum or energy of its own to measure errors by.
    energy, unit = scene.ball.mass * scene.gravity * scene.ball.radius, np.ones(len(scene.hinges))
    momentum = scene.momentum_scale
    of_ball = [*np.ones(4), *[scene.ball.radius] * 2, *[momentum] * 3, energy]
    of_plane = [energy] * scene.plane_moves
    return np.concatenate([of_ball, unit, momentum * unit, energy * unit, of_plane])
