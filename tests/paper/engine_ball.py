"""Motions of MuJoCo's ball, in the variables of the paper."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from robotball import Motion, Scene, sample_times, simulate
from robotball.robot.formulas import parameters_of
from robotball.robot.scene import Start
from robotball.rotations import Array, from_matrix, rotation_matrix
from tests.paper.formulas import Numbers, cross, numbers, paper_scene

_INTERVAL = 0.005  # s between samples, one step of "balanced"
# Both models with constant rates, and one ball with oscillating rates, which has Ω̇ and k̇.
RUBBER, CLASSICAL, DRIVEN = "fig12", "classical_chaotic", "wobbling_drive"
EACH = (RUBBER, CLASSICAL, DRIVEN)
INNER = slice(2, -2)  # the samples at which `rate` is known


@dataclass(frozen=True, repr=False)  # its repr in a failed assertion would take a second
class BallMotion:
    """A motion of MuJoCo's ball at n times, in principal axes.

    The rows of axes (n, 3, 3) are α, β and γ. The numbers may depend on time.
    """

    motion: Motion
    axes: Array
    numbers: tuple[Numbers, ...]
    omega: Array

    @cached_property
    def gamma(self) -> Array:
        """γ (n, 3)."""
        return self.axes[:, 2]

    @cached_property
    def momentum(self) -> Array:
        """M (n, 3) in principal axes, from the momenta of MuJoCo's bodies."""
        return np.einsum("nij,ni->nj", self.axes, self.motion.momentum)

    @cached_property
    def path_velocity(self) -> Array:
        """(Ẋ, Ẏ, 0) (n - 4, 3) in world axes, from finite differences."""
        return np.pad(rate(self.motion.contact_point), ((0, 0), (0, 1)))

    @cached_property
    def centre_velocity(self) -> Array:
        """v (n - 4, 3), the velocity of the centre, in principal axes."""
        return np.einsum("nij,ni->nj", self.axes[INNER], self.path_velocity)

    def of(self, formula: Callable[[Numbers, Array, Array], Array | float]) -> Array:
        """Evaluate a function of the ball's numbers, ω and γ at all times."""
        states = zip(self.numbers, self.omega, self.gamma, strict=True)
        return np.array([formula(n, omega, gamma) for n, omega, gamma in states])

    def path_error(self, X: Array, Y: Array) -> float:
        """Return the largest difference of Ẋ and Ẏ (n,) from the velocity of the contact point."""
        return largest(self.path_velocity[:, :2] - np.stack([X, Y], axis=1)[INNER])

    def carried(self, rows: Array) -> Array:
        """Return the first of the vectors (n, 3), held constant in space, in principal axes."""
        return np.einsum("nij,i->nj", self.axes, self.axes[0] @ rows[0])

    def drift(self, rows: Array) -> float:
        """Return the largest change of a vector (n, 3) in space during the motion."""
        return largest(rows - self.carried(rows))


@cache
def mujoco_ball(name: str, duration: float = 10.0, interval: float = _INTERVAL) -> BallMotion:
    """Simulate a scene of the catalog in MuJoCo with the preset "balanced"."""
    return mujoco_ball_of(paper_scene(name), duration, interval)


def mujoco_ball_from(
    name: str, gamma: Array, alpha: Array, M_world: Array, duration: float
) -> BallMotion:
    """Simulate the ball of a scene of the catalog from γ, α and M; M in world axes."""
    start = Start(from_matrix(np.array([alpha, cross(gamma, alpha), gamma])), M_world)
    return mujoco_ball_of(replace(paper_scene(name), start=start), duration)


def mujoco_ball_of(scene: Scene, duration: float, interval: float = _INTERVAL) -> BallMotion:
    """Simulate a scene in MuJoCo with the preset "balanced" for a duration [s]."""
    motion = simulate(scene, sample_times(duration, interval))
    return BallMotion(
        motion=motion,
        axes=rotation_matrix(motion.attitude) @ scene.principal_axes,
        numbers=tuple(_numbers_at(scene, motion.times)),
        omega=motion.angular_velocity @ scene.principal_axes,
    )


def _numbers_at(scene: Scene, times: Array) -> list[Numbers]:
    """Return the ball's numbers at n times, with Ω̇ and k̇."""
    if scene.steady:
        return [numbers(scene.parameters)] * len(times)
    # Ω and k are linear in the hinge rates, so Ω̇ and k̇ follow from the hinge accelerations.
    accelerations = np.stack([drive.acceleration(times) for drive in scene.drives], axis=1)
    change = [parameters_of(scene.ball, scene.rolling, rates) for rates in accelerations]
    return [
        replace(numbers(scene.parameters_at(t)), Omega_rate=np.array(p.Omega), k_rate=np.array(p.k))
        for t, p in zip(times.tolist(), change, strict=True)
    ]


def largest(rows: Array) -> float:
    """Return the greatest length of vectors (n, k), or absolute value of numbers (n,)."""
    return float(np.abs(rows).max() if rows.ndim == 1 else np.linalg.norm(rows, axis=1).max())


def rate(samples: Array) -> Array:
    """Return d/dt (n - 4, …) of samples (n, …) with finite differences of fourth order."""
    ahead, behind = samples[3:-1] - samples[1:-3], samples[4:] - samples[:-4]
    return (8 * ahead - behind) / (12 * _INTERVAL)
