"""A scene as the compiled derivative takes it, and what is told of a state."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robotball.drives import Constant
from robotball.engines.multibody.compiled import (
    FORCE,
    HINGES,
    LIMIT,
    MOMENTUM,
    MOTOR,
    OMEGA,
    PLANE_TORQUE,
    ROLLING,
    TOLD,
    differentiate,
)
from robotball.rotations import Array, Mask, rotation_matrix
from robotball.scene import Scene


@dataclass(frozen=True)
class Told:
    """What the derivative tells of a state besides itself: world axes, but for omega."""

    numbers: Array

    def _hinges(self, part: int) -> Array:
        count = (len(self.numbers) - TOLD) // 3
        return self.numbers[TOLD + part * count : TOLD + (part + 1) * count]

    @property
    def force(self) -> Array:
        """(3,) N, of the plane on the shell."""
        return self.numbers[FORCE : FORCE + 3]

    @property
    def normal(self) -> float:
        return float(self.numbers[FORCE + 2])

    @property
    def plane_torque(self) -> Array:
        """(3,) N m, of the plane on the shell about the contact point."""
        return self.numbers[PLANE_TORQUE : PLANE_TORQUE + 3]

    @property
    def omega(self) -> Array:
        """(3,) rad/s of the frame, frame axes."""
        return self.numbers[OMEGA : OMEGA + 3]

    @property
    def rolling(self) -> Array:
        """(3,) rad/s, the horizontal part of the shell's angular velocity."""
        return self.numbers[ROLLING : ROLLING + 3]

    @property
    def rates(self) -> Array:
        """(h,) rad/s."""
        return self._hinges(0)

    @property
    def torques(self) -> Array:
        """(h,) N m, of the motors."""
        return self._hinges(1)

    @property
    def unlimited(self) -> Array:
        """(h,) N m: what the motors' torques would be without limits."""
        return self._hinges(2)


@dataclass
class Modes:
    """What makes the derivative another function of the state: it is smooth while they stay.

    motors (h,): -1, 0 or 1, the side of its limit on which a motor is; standing: whether the
    plane's resistance to rolling holds the shell; toward (3,), world: which way it will roll.
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
        laws = [(0.0, 0.0, 0.0, 0.0, np.inf) if not h.motor else tuple(h.motor.law) for h in hinges]
        self.motors = np.array(laws).reshape(-1, MOTOR)
        self.limits = self.motors[:, LIMIT]
        self.limited = np.flatnonzero(np.isfinite(self.limits)).tolist()
        self.resistance = scene.friction.rolling
        self.modes = Modes(np.zeros(self.count, dtype=np.int64))
        self.end = np.inf
        self._bodies, self._radius = np.ascontiguousarray(robot.bodies), robot.radius
        self._gravity, self._spin_free = scene.gravity_world, scene.rolling == "rubber"
        self._commands = np.array([float(hinge.command.rate(0.0)) for hinge in hinges])
        self._accelerations = np.zeros(self.count)
        self._changing = [
            (i, hinge.command, hinge.motor is None)
            for i, hinge in enumerate(hinges)
            if not isinstance(hinge.command, Constant)
        ]

    @property
    def size(self) -> int:
        return HINGES + 3 * self.count

    @property
    def told_size(self) -> int:
        return TOLD + 3 * self.count

    @property
    def scale(self) -> Array:
        """(size,): what the numbers of a state are measured by."""
        scene, count = self.scene, self.count
        energy = scene.ball.mass * scene.gravity * scene.ball.radius
        unit, momentum = np.ones(count), scene.momentum_scale
        of_ball = [*np.ones(4), *[scene.ball.radius] * 2, *[momentum] * 3, energy]
        return np.concatenate([of_ball, unit, momentum * unit, energy * unit])

    def start(self) -> Array:
        """The state (size,) at the scene's start."""
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
        """The derivative (size,) of a state at time t [s]."""
        return self._run(t, state)[0]

    def told(self, t: float, state: Array) -> Told:
        return Told(self._run(t, state)[1])

    def _run(self, t: float, state: Array) -> tuple[Array, Array]:
        for i, command, given in self._changing:
            self._commands[i] = command.rate(t)
            if given:
                # At its end a piece's own, not that of the next.
                self._accelerations[i] = command.acceleration(min(t, self.end))
        rate, told = np.empty(self.size), np.empty(self.told_size)
        modes = self.modes
        differentiate(
            state,
            self._bodies,
            self._radius,
            self._gravity,
            self.motors,
            self.given,
            modes.motors,
            self._commands,
            self._accelerations,
            self._spin_free,
            self.resistance,
            modes.standing,
            modes.toward,
            rate,
            told,
        )
        return rate, told
