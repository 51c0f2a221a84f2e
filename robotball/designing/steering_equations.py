"""How a robot moves whose contact point goes along a path: an equation for its state alone."""

from dataclasses import dataclass

import numpy as np

from robotball import equations as eq
from robotball.designing.paths import WantedPath
from robotball.mechanics import formulas
from robotball.rates import Ramp
from robotball.rotations import Array, Mask, rotation_matrix
from robotball.scene import Scene

WAITING = 0.05  # of the duration, before and after the way
ASTRAY = 1e100  # a state that a solver tries so far off leads nowhere, and its square to infinity


class Way:
    """The differential equation of y = (q, M, angles) on the way along a path, for n times."""

    def __init__(self, scene: Scene, path: WantedPath, duration: float, driven: Mask) -> None:
        self.scene, self.path, self.driven, self.robot = scene, path, driven, scene.robot
        wait = WAITING * duration
        self.part = Ramp(initial=0.0, final=1.0, start=wait, end=duration - wait, shape="quintic")

    def start(self) -> Array:
        """(7 + h,): the scene's robot at rest."""
        angles = [hinge.angle for hinge in self.scene.hinges]
        return np.array([*self.scene.start.attitude, 0.0, 0.0, 0.0, *angles])

    def point(self, times: Array) -> Array:
        """(n, 2) m, the contact point that is wanted."""
        return np.array([self.path.point(u) for u in self._parts(times)])

    def _parts(self, times: Array) -> list[float]:
        parts: list[float] = np.clip(self.part.rate(times), 0.0, 1.0).tolist()
        return parts

    def shell(self, times: Array, gamma: Array, axes: Array) -> Array:
        """(n, 3) rad/s, frame axes: the horizontal part of the shell's angular velocity."""
        slopes = np.array([self.path.slope(u) for u in self._parts(times)])
        velocity = np.zeros((len(times), 3))
        velocity[:, :2] = slopes * self.part.acceleration(times)[:, None]
        in_frame = np.einsum("nji,nj->ni", axes, velocity)
        return np.asarray(np.cross(gamma, in_frame) / self.scene.ball.radius)

    def moves(self, times: Array, y: Array) -> "Moves":
        """How the robot moves in states y (7 + h, n)."""
        robot, scene, n = self.robot, self.scene, len(times)
        axes = rotation_matrix((y[:4] / np.linalg.norm(y[:4], axis=0)).T)
        gamma, rubber = axes[:, 2], scene.rolling == "rubber"
        shell = self.shell(times, gamma, axes)
        placed = robot.placed(y[7:].T)
        size = 3 + robot.hinges
        matrix = np.empty((size, size, n))
        formulas.mass_matrix(robot.bodies, placed, robot.radius, tuple(gamma.T), matrix)
        rows = np.einsum("nij,jkn->nik", axes, matrix[:3])  # L in space
        M = y[4:7].T
        L = np.column_stack([M[:, 1], -M[:, 0], 0 * M[:, 0]]) if rubber else M
        right = L - np.einsum("nij,nj->ni", rows[:, :, :3], shell)
        weights = 1 / np.sqrt(np.einsum("jjn->nj", matrix[3:, 3:])[:, self.driven])
        left = rows[:, :, 3:][:, :, self.driven] * weights[:, None]
        if rubber:
            left, right = left[:, :2], right[:, :2]
        else:
            spin = np.einsum("nij,nj->ni", rows[:, :, :3], gamma)
            spinning = 1 / np.sqrt(matrix[0, 0])
            left = np.concatenate([left, (spin * spinning[:, None])[:, :, None]], axis=2)
        singular = np.linalg.svd(left, compute_uv=False)
        found = np.einsum("nij,nj->ni", np.linalg.pinv(left), right)
        rates = np.zeros((n, robot.hinges))
        rates[:, self.driven] = weights * found[:, : self.driven.sum()]
        if not rubber:
            shell = shell + gamma * (found[:, -1] * spinning)[:, None]
        reach = singular[:, -1] / singular[:, 0]
        return Moves(axes, gamma, placed, np.concatenate([shell.T, rates.T]), reach)

    def rate(self, times: Array, y: Array) -> Array:
        """dy/dt (7 + h, n); NaN where a state is astray, so that a solver rejects what tried it."""
        astray = ~(np.abs(y).max(axis=0) < ASTRAY)
        if astray.any():
            y = np.where(astray, self.start()[:, None], y)
        robot, scene, now = self.robot, self.scene, self.moves(times, y)
        up = tuple(now.gamma.T)
        moving = np.empty((robot.hinges + 1, formulas.MOVING, len(times)))
        formulas.move(robot.bodies, now.placed, robot.radius, up, now.u, moving)
        momenta = np.empty_like(now.u)
        G = tuple(np.einsum("nji,j->in", now.axes, scene.gravity_world))
        formulas.momentum_rates(robot.bodies, now.placed, moving, robot.radius, up, G, momenta)
        L_rate = np.einsum("nij,jn->in", now.axes, momenta[:3])
        if scene.rolling == "rubber":
            L_rate = np.stack([-L_rate[1], L_rate[0], 0 * L_rate[0]])
        w, x, y_, z = y[:4]
        spin = eq.attitude_rate((w, x, y_, z), tuple(moving[1, :3]))
        return np.where(astray, np.nan, np.concatenate([np.stack(spin), L_rate, now.u[3:]]))


@dataclass(frozen=True)
class Moves:
    """axes (n, 3, 3), gamma (n, 3), placed, u (3 + h, n) and reach (n,).

    reach: how well the hinges move the ball in the direction that they move it least.
    """

    axes: Array
    gamma: Array
    placed: Array
    u: Array
    reach: Array
