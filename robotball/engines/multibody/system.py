"""The derivative of a robot's state, by the formulas of robotball.mechanics, compiled.

A state is (q, X, Y, M, loss, angles, h, work): the frame's attitude, the contact point, the
momentum M in space axes, the work lost to rolling resistance, and of every hinge its angle, its
momentum (used where its rate is not given) and the work of its motors. A motor moves one hinge, or
several by gears. The derivative is computed
with readings of the state, the forces and rates that it takes: see `Readings`.
"""

from dataclasses import dataclass, field
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotball import equations as eq
from robotball import mechanics
from robotball.drives import Constant
from robotball.engines.compiled import compiled_from, inlined
from robotball.mechanics import needed, put, solve_rolling, vector
from robotball.motors import SLOW
from robotball.rotations import Array, Mask, rotation_matrix
from robotball.scene import Scene

# Places in a state; from HINGES on the angles, the momenta and the work, h numbers each.
POINT, MOMENTUM, LOSS, HINGES = 4, 6, 9, 10
# Places in the readings; from PER_HINGE on the hinges' rates and torques, h each, and the motors'
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

_SIGNATURE = (
    "void(f8[::1], f8[:, ::1], i8, f8, f8[::1], f8[:, ::1], f8[:, ::1], b1[::1], i8[::1], "
    "f8[::1], f8[::1], f8[::1], b1, f8, b1, f8[::1], f8[::1], f8[::1])"
)


@compiled_from(_sources(), _SIGNATURE, nogil=True, error_model="numpy")
def _differentiate(
    state: Any, bodies: Any, carrier: int, radius: float, gravity: Any, motors: Any, gears: Any,
    given: Any, modes: Any, rates: Any, accelerations: Any, commands: Any, spin_free: bool,
    resistance: float, standing: bool, toward: Any, rate: Any, readings: Any,
) -> None:  # fmt: skip
    """Write the derivative of a state into `rate`, and the readings into `readings`.

    gravity (3,) m/s², world; motors (m, MOTOR); gears (m, h); given (3 + h,): whether a rate is
    given, by rates (h,) and their accelerations (h,); modes (m,): -1, 0 or 1, the side of its limit
    on which a motor is; commands (m,), of the motors; resistance m, of the plane to rolling;
    standing: whether that holds the shell; toward (3,) world, the direction in which a standing
    shell will roll.
    """
    count = len(rates)
    w, x, y, z = state[0], state[1], state[2], state[3]
    alpha, beta, gamma = eq.space_axes((w, x, y, z))
    axes = (alpha, beta, gamma)
    M = eq.seen_from_frame(vector(state, MOMENTUM), axes)
    G = eq.seen_from_frame(vector(gravity, 0), axes)
    angles = state[HINGES : HINGES + count]
    placed = np.empty((count + 1, mechanics.PLACED))
    mechanics.place(bodies, carrier, angles, placed)
    columns = np.empty((count + 1, 3 + count, mechanics.COLUMN))
    mechanics.partial_velocities(bodies, placed, radius, gamma, columns)
    matrix = np.empty((3 + count, 3 + count))
    mechanics.mass_matrix(bodies, placed, columns, matrix)

    directions = np.zeros(((2 if standing else 0) + (1 if spin_free else 0), 3))
    if standing:
        put(directions[0], 0, alpha)
        put(directions[1], 0, beta)
    if spin_free:
        put(directions[-1], 0, gamma)
    right, u = np.zeros((3 + count, 1)), np.zeros((3 + count, 1))
    # L = M×γ + λγ in the rubber model; (ω_s, γ) = 0 stands in for the unknown λ.
    L = eq.cross(M, gamma) if spin_free else M
    put(right[:, 0], 0, L)
    right[3:, 0] = state[HINGES + count : HINGES + 2 * count]
    u[3:, 0] = rates
    solve_rolling(matrix, given, directions, right, u)
    now = u[:, 0]
    moving = np.empty((count + 1, mechanics.MOVING))
    mechanics.move(columns, now, moving)

    torques = readings[_PER_HINGE + count : _PER_HINGE + 2 * count]
    torques[:] = 0.0
    readings[_PER_HINGE : _PER_HINGE + count] = now[3:]
    for i in range(len(motors)):
        motor, angle, speed = motors[i], 0.0, 0.0
        for j in range(count):
            angle += gears[i, j] * angles[j]
            speed += gears[i, j] * now[3 + j]
        free = (
            motor[_PER_COMMAND] * commands[i]
            - motor[_PER_ANGLE] * angle
            - motor[_PER_RATE] * speed
            + motor[_AT_REST]
        )
        if motor[_FRICTION] > 0:
            free -= motor[_FRICTION] * np.tanh(speed / SLOW)
        readings[_PER_HINGE + 2 * count + i] = free
        torque = free if modes[i] == 0 else modes[i] * motor[_LIMIT]
        torques += gears[i] * torque

    # The torques that no acceleration at all would need are the bias; without them, solving for
    # accelerations has the same matrix as solving for rates.
    u_rate, plane = np.zeros((3 + count, 1)), np.empty(3 + count)
    needed(bodies, placed, columns, moving, radius, gamma, G, now, u_rate[:, 0], plane)
    right[:, 0] = -plane
    right[3:, 0] += torques
    u_rate[3:, 0] = accelerations
    solve_rolling(matrix, given, directions, right, u_rate)
    force = needed(bodies, placed, columns, moving, radius, gamma, G, now, u_rate[:, 0], plane)

    shell = vector(now, 0)
    rolling = eq.subtract(shell, eq.scale(eq.dot(shell, gamma), gamma))
    speed = np.sqrt(eq.dot(rolling, rolling))
    if resistance > 0 and not standing:
        # The torque is -μN along the rolling, and N is linear in the torque: one more solution, for
        # a unit torque, gives both. Below STANDING the direction goes over, without a jump, into
        # the one in which the shell will roll.
        ahead = eq.seen_from_frame(vector(toward, 0), axes)
        along = eq.add(rolling, eq.scale(max(STANDING - speed, 0.0), ahead))
        length = np.sqrt(eq.dot(along, along))
        along = eq.scale(1 / length if length > STANDING / 2 else 0.0, along)
        by_torque, resisted = np.zeros((3 + count, 1)), np.zeros((3 + count, 1))
        put(resisted[:, 0], 0, eq.scale(-1.0, along))
        solve_rolling(matrix, given, directions, resisted, by_torque)
        both = u_rate[:, 0] + by_torque[:, 0]
        normal = eq.dot(gamma, force)
        changed = needed(bodies, placed, columns, moving, radius, gamma, G, now, both, plane)
        per_torque = eq.dot(gamma, changed) - normal
        torque = resistance * normal / (1 - resistance * per_torque)
        u_rate += torque * by_torque
        force = needed(bodies, placed, columns, moving, radius, gamma, G, now, u_rate[:, 0], plane)
    for j in range(count):
        if given[3 + j]:
            torques[j] = plane[3 + j]

    momenta = np.empty(3 + count)
    mechanics.momentum_rates(bodies, placed, moving, radius, gamma, G, momenta)
    L_rate, by_plane = vector(momenta, 0), vector(plane, 0)
    rate[LOSS] = 0.0
    if resistance > 0:
        level = eq.subtract(by_plane, eq.scale(eq.dot(by_plane, gamma), gamma))
        L_rate = eq.add(L_rate, level)
        rate[LOSS] = -eq.dot(level, shell)
    M_rate = eq.cross(gamma, L_rate) if spin_free else L_rate
    omega = vector(moving[carrier], mechanics.TURNING)
    rate[0], rate[1], rate[2], rate[3] = eq.attitude_rate((w, x, y, z), omega)
    rate[POINT], rate[POINT + 1] = eq.contact_velocity(alpha, beta, shell, (0.0, 0.0, 0.0), radius)
    for i in range(3):
        rate[MOMENTUM + i] = eq.dot(axes[i], M_rate)
        readings[_FORCE + i] = eq.dot(axes[i], force)
        readings[_PLANE_TORQUE + i] = eq.dot(axes[i], by_plane)
        readings[_OMEGA + i] = omega[i]
        readings[_ROLLING + i] = eq.dot(axes[i], rolling)
    if spin_free:
        # M = γ×L is horizontal, and rounding must not add up to anything else.
        rate[MOMENTUM + 2] = 0.0
    for j in range(count):
        rate[HINGES + j] = now[3 + j]
        rate[HINGES + count + j] = 0.0 if given[3 + j] else momenta[3 + j] + torques[j]
        rate[HINGES + 2 * count + j] = torques[j] * now[3 + j]


@dataclass(frozen=True)
class Readings:
    """Readings of states (...); world axes, but for omega.

    numbers       (..., PER_HINGE + 2h + m)  all of them, as the derivative writes them
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
    """Return the readings of `count` hinges in an array (..., PER_HINGE + 2h + m), as views."""
    threes = (numbers[..., i : i + 3] for i in (_FORCE, _PLANE_TORQUE, _OMEGA, _ROLLING))
    of_hinges = np.split(numbers[..., _PER_HINGE:], [count, 2 * count], axis=-1)
    return Readings(numbers, *threes, *of_hinges)


@dataclass
class Modes:
    """The modes of a robot; while they stay, the derivative is a smooth function of the state.

    motors (m,): -1, 0 or 1, the side of its limit on which a motor is; standing: whether the
    plane's resistance to rolling holds the shell; toward (3,), world: the direction in which it
    will roll.
    """

    motors: NDArray[np.int64]
    standing: bool = False
    toward: Array = field(default_factory=lambda: np.zeros(3))


class System:
    """The derivative of a scene's state in given modes, up to the time `end` of a smooth piece."""

    def __init__(self, scene: Scene) -> None:
        hinges, robot = scene.hinges, scene.robot
        self.scene, self.count = scene, len(hinges)
        self.given: Mask = np.array([False] * 3 + [hinge.motor is None for hinge in hinges])
        own = [i for i, hinge in enumerate(hinges) if hinge.motor is not None]
        laws = [hinge.motor.law for hinge in hinges if hinge.motor is not None]
        laws += [each.law for each in scene.actuators]
        self.motors = np.array(laws).reshape(-1, _MOTOR)
        self.gears = np.zeros((len(laws), self.count))
        self.gears[range(len(own)), own] = 1.0
        places = {hinge.name: i for i, hinge in enumerate(hinges)}
        for row, actuator in zip(self.gears[len(own) :], scene.actuators, strict=True):
            for name, ratio in actuator.gears:
                row[places[name]] += ratio
        self.limits = self.motors[:, _LIMIT]
        self.limited = np.flatnonzero(np.isfinite(self.limits)).tolist()
        self.ranges = [
            (HINGES + i, each.range) for i, each in enumerate(scene.ball.tree[1:]) if each.range
        ]
        self.resistance = scene.friction.rolling
        self.modes = Modes(np.zeros(len(laws), dtype=np.int64))
        self.end = np.inf
        self._bodies = np.ascontiguousarray(robot.bodies)
        self._gravity, self._spin_free = scene.gravity_world, scene.rolling == "rubber"
        self._rates = np.array([float(hinge.command.rate(0.0)) for hinge in hinges])
        self._accelerations = np.zeros(self.count)
        commands = [*(hinges[i].command for i in own), *scene.controls]
        self._commands = np.array([float(command.rate(0.0)) for command in commands])
        self._changing_rates = [
            (i, hinge.command)
            for i, hinge in enumerate(hinges)
            if hinge.motor is None and not isinstance(hinge.command, Constant)
        ]
        self._changing_commands = [
            (i, command) for i, command in enumerate(commands) if not isinstance(command, Constant)
        ]

    @property
    def size(self) -> int:
        return HINGES + 3 * self.count

    @property
    def readings_size(self) -> int:
        return _PER_HINGE + 2 * self.count + len(self.motors)

    @property
    def scale(self) -> Array:
        """The units (size,) in which the errors of a state's numbers are measured."""
        # Fixed ones: a ball at rest has no momentum or energy of its own to measure errors by.
        scene, count = self.scene, self.count
        energy = scene.ball.mass * scene.gravity * scene.ball.radius
        unit, momentum = np.ones(count), scene.momentum_scale
        of_ball = [*np.ones(4), *[scene.ball.radius] * 2, *[momentum] * 3, energy]
        return np.concatenate([of_ball, unit, momentum * unit, energy * unit])

    def start(self) -> Array:
        """Return the state (size,) at the scene's start."""
        scene, start = self.scene, self.scene.start
        state = np.zeros(self.size)
        state[:4], state[MOMENTUM : MOMENTUM + 3] = start.attitude, start.momentum
        angles = np.array([hinge.angle for hinge in scene.hinges])
        rates = np.array([hinge.rate for hinge in scene.hinges])
        gamma = rotation_matrix(start.attitude)[None, 2]
        omega = scene.angular_velocity_at(start)[None]
        momenta = scene.robot.states(gamma, angles[None], omega, rates[None]).momenta[3:, 0]
        state[HINGES : HINGES + self.count] = angles
        state[HINGES + self.count : HINGES + 2 * self.count] = momenta
        return state

    def rate(self, t: float, state: Array) -> Array:
        """Return the derivative (size,) of a state at time t [s]."""
        return self._run(t, state)[0]

    def readings(self, t: float, state: Array) -> Readings:
        """Return the readings of a state at time t [s]."""
        return readings_of(self._run(t, state)[1], self.count)

    def _run(self, t: float, state: Array) -> tuple[Array, Array]:
        for i, command in self._changing_rates:
            self._rates[i] = command.rate(t)
            # A piece's last state has the acceleration of this piece, not that of the next one.
            self._accelerations[i] = command.acceleration(min(t, self.end))
        for i, command in self._changing_commands:
            self._commands[i] = command.rate(t)
        rate, readings = np.empty(self.size), np.empty(self.readings_size)
        modes, robot = self.modes, self.scene.robot
        _differentiate(
            state, self._bodies, robot.carrier, robot.radius, self._gravity, self.motors,
            self.gears, self.given, modes.motors, self._rates, self._accelerations, self._commands,
            self._spin_free, self.resistance, modes.standing, modes.toward, rate, readings,
        )  # fmt: skip
        return rate, readings
