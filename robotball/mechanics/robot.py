"""A robot's numbers, and what its states tell: many at once, by the formulas on columns.

Of n states: gamma (n, 3) in frame axes; angles and rates (n, h) of the hinges, as in
`Scene.hinges` [rad, rad/s]; omega (n, 3) of the frame, in frame axes [rad/s]. SI units.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotball.bodies import Ball, Frame
from robotball.mechanics import formulas
from robotball.mechanics.solving import solve_rolling
from robotball.parameters import Rolling
from robotball.rotations import Array, rotation_matrix


@dataclass(frozen=True)
class Robot:
    """The numbers of a ball's bodies, in rows (b, ROW) as the formulas take them, and a [m]."""

    bodies: Array
    radius: float

    @property
    def hinges(self) -> int:
        return len(self.bodies) - 1

    @property
    def mass(self) -> float:
        return float(self.bodies[:, formulas.MASS].sum())

    def states(self, gamma: Array, angles: Array, omega: Array, rates: Array) -> "States":
        """The robot in n states of motion."""
        axis = self.bodies[0, formulas.AXIS : formulas.PIVOT, None]
        u = np.concatenate([omega.T - rates[:, 0] * axis, rates.T])
        placed = self.placed(angles)
        moving = np.empty((len(self.bodies), formulas.MOVING, len(gamma)))
        formulas.move(self.bodies, placed, self.radius, tuple(gamma.T), u, moving)
        return States(self, gamma.T, placed, u, moving)

    def placed(self, angles: Array) -> Array:
        """Where the bodies are at angles (n, h): (b, PLACED, n), in frame axes."""
        placed = np.empty((len(self.bodies), formulas.PLACED, len(angles)))
        formulas.place(self.bodies, np.cos(angles.T), np.sin(angles.T), placed)
        return placed

    def angular_velocity(
        self, gamma: Array, angles: Array, M: Array, rates: Array, rolling: Rolling
    ) -> Array:
        """ω (n, 3) of the frame from the momentum M (n, 3), both in frame axes."""
        vertical, given = gamma.T[None], np.arange(3 + self.hinges) > 2
        matrix, right = self._matrix(gamma, angles), np.zeros((3 + self.hinges, 1, len(gamma)))
        right[:3, 0] = (np.cross(M, gamma) if rolling == "rubber" else M).T
        u = np.zeros_like(right)
        u[3:, 0] = rates.T
        solve_rolling(matrix, given, still(vertical, rolling), right, u)
        axis = self.bodies[0, formulas.AXIS : formulas.PIVOT]
        return u[:3, 0].T + np.outer(rates[:, 0], axis)

    def _matrix(self, gamma: Array, angles: Array) -> Array:
        matrix = np.empty((3 + self.hinges, 3 + self.hinges, len(gamma)))
        placed = self.placed(angles)
        formulas.mass_matrix(self.bodies, placed, self.radius, tuple(gamma.T), matrix)
        return matrix


def still(vertical: Array, rolling: Rolling) -> Array:
    """The directions (c, 3, n) about which the shell may not turn, of the vertical (1, 3, n)."""
    return vertical if rolling == "rubber" else vertical[:0]


def robot_of(ball: Ball, armatures: tuple[float, ...] = ()) -> Robot:
    """A ball's robot; armatures [kg m²] of its hinges, 0 where none are given."""
    rows = np.zeros((len(ball.named_bodies), formulas.ROW))
    for row, (_, body) in zip(rows, ball.named_bodies, strict=True):
        row[formulas.MASS] = body.mass
        row[formulas.CENTRE : formulas.AXIS] = body.centre
        axis = ball.shell.axis if isinstance(body, Frame) else body.axis
        row[formulas.AXIS : formulas.PIVOT] = axis
        row[formulas.INERTIA : formulas.ARMATURE] = body.inertia.ravel()
    for row, rotor in zip(rows[2:], ball.rotors, strict=False):
        row[formulas.PIVOT : formulas.INERTIA] = rotor.centre
    for row, pendulum in zip(rows[2 + len(ball.rotors) :], ball.pendulums, strict=True):
        row[formulas.PIVOT : formulas.INERTIA] = pendulum.pivot
    if armatures:
        rows[1:, formulas.ARMATURE] = armatures
    return Robot(rows, ball.radius)


@dataclass(frozen=True)
class States:
    """n states of a robot in motion, as the formulas have them: the last index counts them.

    gamma (3, n), placed (b, PLACED, n), u (3 + h, n), moving (b, MOVING, n).
    """

    robot: Robot
    gamma: Array
    placed: Array
    u: Array
    moving: Array

    @cached_property
    def matrix(self) -> Array:
        """𝓜 (3 + h, 3 + h, n)."""
        matrix = np.empty((len(self.u), *self.u.shape))
        formulas.mass_matrix(
            self.robot.bodies, self.placed, self.robot.radius, tuple(self.gamma), matrix
        )
        return matrix

    @cached_property
    def momenta(self) -> Array:
        """(L, h) (3 + h, n): about the contact point, in frame axes, and along the hinges."""
        found = np.empty_like(self.u)
        formulas.product(self.matrix, self.u, found)
        return found

    def momentum(self, rolling: Rolling) -> Array:
        """M (n, 3) in frame axes: γ×L in the rubber model, L in the classical one."""
        L = self.momenta[:3]
        return (np.cross(self.gamma, L, axis=0) if rolling == "rubber" else L).T

    @property
    def kinetic_energy(self) -> Array:
        """(n,) J, with that of the armatures."""
        return np.asarray((self.u * self.momenta).sum(axis=0) / 2)

    @property
    def centre_of_mass(self) -> Array:
        """(n, 3) m, from the centre of the sphere, frame axes."""
        masses = self.robot.bodies[:, formulas.MASS]
        return np.asarray(np.einsum("b,bin->ni", masses, self.placed[:, :3])) / self.robot.mass

    @property
    def turning(self) -> Array:
        """(b, n, 3) rad/s, the bodies' angular velocities, frame axes."""
        return self.moving[:, formulas.TURNING : formulas.VELOCITY].transpose(0, 2, 1)

    @property
    def velocities(self) -> Array:
        """(b, n, 3) m/s, of the bodies' centres of mass, frame axes."""
        return self.moving[:, formulas.VELOCITY :].transpose(0, 2, 1)


def momentum_at(
    ball: Ball, rolling: Rolling, attitude: Array, omega: Array, angles: Array, rates: Array
) -> Array:
    """M (3,) in world axes of a ball in one state [kg m²/s].

    attitude (4,), frame to world; omega (3,) of the frame, in frame axes [rad/s]; angles and rates
    (h,) of the hinges [rad, rad/s]. In the rubber model the shell must not spin.
    """
    to_world = rotation_matrix(attitude)
    one = robot_of(ball).states(to_world[None, 2], angles[None], omega[None], rates[None])
    return np.asarray(to_world @ one.momentum(rolling)[0])
