"""The derivative of one or several robots, with their starts, drives and modes."""

from collections.abc import Iterable
from functools import cached_property
from typing import Any

import numpy as np

from robotball.robot.drives import Constant, Drive, Ramp
from robotball.robot.function_drives import HeldCommand
from robotball.robot.scene import Scene
from robotball.rotations import Array
from robotball.theory.dop853 import STAGES
from robotball.theory.multibody.derivative import (
    HINGES,
    LIMIT,
    MOMENTUM,
    MOTOR,
    PER_HINGE,
    Inputs,
    Machine,
    Modes,
    Readings,
    differentiate,
    readings_of,
    work_of,
)


class System:
    """The derivative of a scene's state in the present modes, within a smooth piece.

    If there are several scenes, they may differ only in their parameters. Their states are
    concatenated. The modes, readings and margins are those of the first scene.
    """

    def __init__(self, *scenes: Scene) -> None:
        first, self.scenes = scenes[0], scenes
        hinges, robot = first.hinges, first.robot
        self.scene, self.count = first, len(hinges)
        motors = np.stack([_laws_of(scene) for scene in scenes])
        limits = np.stack([scene.slip_limits for scene in scenes])
        self.friction = limits[0]
        # The diagonals of W (k, 1, 3) of k robots.
        self.all_weights = np.where(np.isfinite(limits), limits, 0.0)[:, None]
        self.weights = self.all_weights[0, 0]
        self.slips = first.contact_moves  # the state has the momentum along slip
        self.free = np.array([hinge.motor is not None for hinge in hinges], dtype=bool)
        moves = not first.plane_is_still
        self.slip_events: list[tuple[float, bool]] = []  # time [s], and whether slip begins there
        self.size = HINGES + 3 * self.count + 3 * self.slips + moves
        self.readings_size = PER_HINGE + 2 * self.count + motors.shape[1]
        self.limits = motors[0, :, LIMIT]
        self.limited = np.flatnonzero(np.isfinite(self.limits)).tolist()
        links = enumerate(first.ball.tree[1:], start=HINGES)
        self.ranges = [(i, link.range) for i, link in links if link.range]
        self.modes = Modes(np.zeros(motors.shape[1], dtype=np.int64))
        self.resistance = float(first.friction.rolling)  # m
        self.machine = Machine(
            np.stack([scene.robot.bodies for scene in scenes]),
            np.array([float(scene.robot.radius) for scene in scenes]),
            robot.carrier,
            motors,
            np.stack([_gears_of(scene) for scene in scenes]),
            np.append(np.zeros(3 + 2 * self.slips, dtype=bool), ~self.free),
            first.rolling == "rubber",
            np.array([float(scene.friction.rolling) for scene in scenes]),
            limits[:, 1:].copy(),
        )
        widths = self.count, self.count, motors.shape[1], 3, 5
        self.inputs = Inputs(*(np.zeros((len(scenes), STAGES, width)) for width in widths))
        for k, scene in enumerate(scenes):
            self.inputs.gravity[k] = scene.gravity_at(0.0)
        self._work = work_of(self.size, self.count, 2 * self.slips)
        self._commands = [
            [*(hinge.command for hinge in scene.hinges if hinge.motor is not None), *scene.controls]
            for scene in scenes
        ]
        self.holds = any(isinstance(command, HeldCommand) for command in self._commands[0])
        # For each plane with another motion: a scene with this plane, and the robots on the plane.
        self._planes: dict[Any, tuple[Scene, list[int]]] = {}
        for k, scene in enumerate(scenes if moves else ()):
            plane = *scene.gravity_world.tolist(), *scene.plane_drives, scene.plane_turn
            self._planes.setdefault(plane, (scene, []))[1].append(k)
        self._rates = [
            (i, hinge.command, k)
            for k, scene in enumerate(scenes)
            for i, hinge in enumerate(scene.hinges)
            if hinge.motor is None
        ]
        self.begin(0.0, np.inf)

    def begin(self, t: float, end: float) -> None:
        """Begin a smooth piece from t to `end` [s], within which no command changes its drive."""
        # A drive's rate may jump at the end of the piece. The last state is before the jump.
        self.end = float(np.nextafter(end, t))
        self._known: tuple[float, bytes, Modes] | None = None
        commands = [
            (i, command.at(t) if isinstance(command, HeldCommand) else command, k)
            for k, robot in enumerate(self._commands)
            for i, command in enumerate(robot)
        ]
        for i, drive, k in commands:
            self.inputs.commands[k, :, i] = drive.rate(t)
        for i, drive, k in self._rates:
            self.inputs.rates[k, :, i], self.inputs.accelerations[k, :, i] = drive.rate(t), 0.0
        self._changing_commands = _changing(commands, t, end)
        self._changing_rates = _changing(self._rates, t, end)

    @cached_property
    def scale(self) -> Array:
        """The scales by which the errors of a state's numbers are divided."""
        return np.concatenate([_scale_of(scene) for scene in self.scenes])

    def start(self) -> Array:
        """Return the state at the start of the scene."""
        return np.concatenate([self._start_of(scene) for scene in self.scenes])

    def _start_of(self, scene: Scene) -> Array:
        state, start = np.zeros(self.size), scene.start
        state[:4], state[MOMENTUM : MOMENTUM + 3] = start.attitude, start.momentum
        state[HINGES : HINGES + self.count] = scene.hinged[0, 0]
        if self.free.any():
            one = scene.states_of(scene.angular_velocity_at(start))
            state[HINGES + self.count : HINGES + 2 * self.count] = one.momenta[3:, 0]
        return state

    @property
    def spins(self) -> bool:
        """Whether the state has L in place of M, because a rubber shell spins."""
        return self.modes.slipping and bool(np.isfinite(self.friction[2]))

    def rate(self, t: float, state: Array) -> Array:
        """Return the derivative of a state at time t [s]."""
        base, slopes = np.array(state, dtype=float), np.empty((1, len(state)))
        self.stages(np.array([t]), 0.0, np.empty((1, 0)), base, np.zeros_like(base), slopes)
        return slopes[0]

    def readings(self, t: float, state: Array) -> Readings:
        """Return the readings of a state at time t [s]."""
        return readings_of(self.numbers(t, state)[0], self.count)

    def numbers(self, t: float, state: Array) -> Array:
        """Return the numbers of the readings at time t [s], a row for each scene."""
        # Margins are computed at the end of a step, where the readings are already known.
        known = self._known
        if not known or known[:2] != (t, state.tobytes()) or known[2] is not self.modes:
            self.rate(t, state)
        return self.stage_numbers[:, -1]

    def slips_at_stages(self) -> Array:
        """Return the slip velocities (k, s, 3) of k robots at the stages of the last step."""
        return readings_of(self.stage_numbers, self.count).slip

    def stages(
        self, times: Array, length: float, weights: Array, base: Array, begin: Array, slopes: Array
    ) -> Array:
        """Write the derivatives at the stages of a step, as in `dop853.Stages`."""
        self._drive(times)
        ends = np.empty_like(base)
        self.stage_numbers = np.empty((len(self.scenes), len(times), self.readings_size))
        differentiate()(
            self.machine, self.modes, self.inputs, length, weights, base, begin, slopes, ends,
            self.stage_numbers, self._work,
        )  # fmt: skip
        self._known = float(times[-1]), (base + ends).tobytes(), self.modes
        return ends

    def _drive(self, times: Array) -> None:
        """Set the drives and the plane at the times of the stages (s,) [s]."""
        # The last state of a piece has the acceleration of this piece, not of the next.
        inputs, within, stages = self.inputs, np.minimum(times, self.end), slice(len(times))
        for i, drive, robots in self._changing_rates:
            rates, accelerations = drive.rate(times), drive.acceleration(within)
            for k in robots:
                inputs.rates[k, stages, i] = rates
                inputs.accelerations[k, stages, i] = accelerations
        for i, drive, robots in self._changing_commands:
            commands = drive.rate(within)  # a held command may jump at the end
            for k in robots:
                inputs.commands[k, stages, i] = commands
        for scene, robots in self._planes.values():
            inputs.gravity[robots, stages] = scene.gravity_at(times)
            velocity = [drive.angle(times) for drive in scene.plane_drives]
            turn = scene.plane_turn
            plane = np.array([*velocity, turn.rate(times), turn.acceleration(within)])
            inputs.plane[robots, stages] = plane.T


def _changing(
    drives: Iterable[tuple[int, Drive, int]], t: float, end: float
) -> list[tuple[int, Drive, list[int]]]:
    """Return the drives that change from t to `end` [s], each with its index and its robots."""
    changing: dict[tuple[int, Drive], list[int]] = {}
    for i, drive, robot in drives:
        past = isinstance(drive, Ramp) and (t >= drive.end or end <= drive.start)
        if not (past or isinstance(drive, Constant)):
            changing.setdefault((i, drive), []).append(robot)
    return [(i, drive, robots) for (i, drive), robots in changing.items()]


def _laws_of(scene: Scene) -> Array:
    """Return the laws (m, MOTOR) of a scene's motors, first of hinges, then of actuators."""
    laws = [hinge.motor.law for hinge in scene.hinges if hinge.motor is not None]
    return np.array([*laws, *(a.law for a in scene.actuators)]).reshape(-1, MOTOR)


def _gears_of(scene: Scene) -> Array:
    """Return the gear ratios (m, h) of each motor to each hinge."""
    names = [hinge.name for hinge in scene.hinges]
    direct = [{hinge.name: 1.0} for hinge in scene.hinges if hinge.motor is not None]
    gears = [*direct, *(dict(actuator.gears) for actuator in scene.actuators)]
    rows = [[ratios.get(name, 0.0) for name in names] for ratios in gears]
    return np.array(rows).reshape(len(rows), len(names))


def _scale_of(scene: Scene) -> Array:
    # Constant units, because the momentum and energy of a ball at rest are zero.
    energy, unit = scene.ball.mass * scene.gravity * scene.ball.radius, np.ones(len(scene.hinges))
    momentum = scene.momentum_scale
    of_ball = [*np.ones(4), *[scene.ball.radius] * 2, *[momentum] * 3, energy]
    of_plane = [energy] * (not scene.plane_is_still)
    push = momentum / scene.ball.radius
    of_slip = [push, push, energy] * scene.contact_moves
    return np.concatenate([of_ball, unit, momentum * unit, energy * unit, of_slip, of_plane])
