"""What MuJoCo's ball does, as the columns that equations.py computes with."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from robotball import Motion, Scene, load_scene, sample_times, simulate
from robotball.equations import Vector
from robotball.parameters import Parameters, parameters_of
from robotball.rotations import Array, rotation_matrix

INTERVAL = 0.005  # s between samples: each step of "balanced"


@dataclass(frozen=True)
class Seen:
    """A motion of MuJoCo's ball at n times, in principal axes; a vector is three columns (n,).

    axes (n, 3, 3): from principal axes to world. parameters: with Omega and K as columns, for
    the drives may change in time. gamma; omega rad/s; Omega_rate rad/s²; k_rate kg m²/s².
    """

    motion: Motion
    axes: Array
    parameters: Parameters
    gamma: Vector
    omega: Vector
    Omega_rate: Vector
    k_rate: Vector

    @property
    def momentum(self) -> Vector:
        """M by (3.1) or by section 3.2, kg m²/s."""
        return self.parameters.momentum(self.omega, self.gamma)

    def drift(self, M: Vector) -> float:
        """The largest change of a vector in space, over the motion."""
        in_space = np.einsum("nij,jn->ni", self.axes, np.array(M))
        return largest((in_space - in_space[0]).T)


@cache
def seen(name: str, duration: float = 10.0) -> Seen:
    """A scene of the catalog, rolled by MuJoCo at "balanced"."""
    return seen_of(load_scene(name), duration)


def seen_of(scene: Scene, duration: float) -> Seen:
    """A scene, rolled by MuJoCo at "balanced" for a duration [s]."""
    motion = simulate(scene, sample_times(duration, INTERVAL))
    axes = rotation_matrix(motion.attitude) @ scene.principal_axes
    now = [scene.parameters_at(t) for t in motion.times.tolist()]
    # Ω and k are linear in the hinges' rates, so their rates are those of the accelerations.
    accelerations = np.stack([drive.acceleration(motion.times) for drive in scene.drives], axis=1)
    change = [parameters_of(scene.ball, scene.rolling, each) for each in accelerations]
    return Seen(
        motion=motion,
        axes=axes,
        parameters=replace(
            now[0],
            Omega=columns(np.array([p.Omega for p in now])),
            K=columns(np.array([p.K for p in now])),
        ),
        gamma=columns(axes[:, 2]),
        omega=columns(motion.angular_velocity @ scene.principal_axes),
        Omega_rate=columns(np.array([p.Omega for p in change])),
        k_rate=columns(np.array([p.k for p in change])),
    )


def columns(rows: Array) -> Vector:
    """Rows (n, 3) as three columns (n,)."""
    return (rows[:, 0], rows[:, 1], rows[:, 2])


def largest(v: Vector | Array) -> float:
    """The greatest length of a vector of three columns."""
    return float(np.linalg.norm(np.array(v), axis=0).max())


def rate(samples: Array) -> Array:
    """d/dt (n - 4, …) of samples (n, …) at INTERVAL, by differences of fourth order."""
    ahead, behind = samples[3:-1] - samples[1:-3], samples[4:] - samples[:-4]
    return (8 * ahead - behind) / (12 * INTERVAL)


def inner(v: Vector) -> Vector:
    """The columns at the times at which `rate` is known."""
    return (v[0][2:-2], v[1][2:-2], v[2][2:-2])
