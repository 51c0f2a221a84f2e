"""Where a sampled Motion, of either engine, crosses the section g = g₀ of section 5.2.

sections.py finds the crossings of the equations by its own steps; a contact engine's motion is
known at its samples only, but with the exact rates there, for everything that stands still in
space turns in the frame at v×ω.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from robotball.engines.reduced.compiled.kernels import Integers
from robotball.errors import InputError
from robotball.motion import Motion
from robotball.rotations import Array, Mask, rotation_matrix
from robotball.scene import Scene

ON_SECTION = 1e-10  # a start that near counts as on the section, and is no crossing


@dataclass(frozen=True)
class Crossings:
    """The m crossings of one motion, in principal axes.

    times (m,) s; gamma (m, 3); momenta (m, 3) kg m²/s; directions (m,): +1 where g grows, -1
    where it falls.
    """

    times: Array
    gamma: Array
    momenta: Array
    directions: Integers

    @property
    def l(self) -> Array:  # noqa: E743
        """l (m,) of (5.5), rad."""
        return np.arctan2(self.momenta[:, 0], self.momenta[:, 1])

    @property
    def L(self) -> Array:
        """L (m,) of (5.5), kg m²/s."""
        return self.momenta[:, 2]

    def __getitem__(self, which: slice | Mask) -> "Crossings":
        """Some of them."""
        return Crossings(
            self.times[which], self.gamma[which], self.momenta[which], self.directions[which]
        )

    def only(self, direction: int) -> "Crossings":
        """Those of one direction; all of them for 0."""
        return self[(self.directions == direction) | (direction == 0)]

    def later(self, time: float) -> "Crossings":
        """The same, `time` [s] later."""
        return replace(self, times=self.times + time)


def joined(parts: Sequence[Crossings]) -> Crossings:
    """Crossings one after the other."""
    return Crossings(
        *(
            np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(Crossings)
        )
    )


def crossings(motion: Motion, scene: Scene, g: float = 0.0) -> Crossings:
    """Where a motion of `scene` crosses g = `g` [rad], as `sampled_crossings` finds it."""
    axes = rotation_matrix(motion.attitude) @ scene.principal_axes
    M = np.einsum("nji,nj->ni", axes, motion.momentum)
    omega = motion.angular_velocity @ scene.principal_axes
    return sampled_crossings(motion.times, axes[:, 2], M, omega, g)


def sampled_crossings(
    times: Array, gamma: Array, M: Array, omega: Array, g: float = 0.0
) -> Crossings:
    """Where vectors γ and M (n, 3), constant in space, cross g = `g` [rad] at times (n,).

    omega (n, 3): of the axes in which they are given. Between samples by cubics through values and
    rates, whose error is h⁴/384 of the fourth derivative for samples h apart: 3e-9 s for the
    catalog's balls sampled every 5 ms. Raises InputError where M = 0.
    """
    f, c = (M * M).sum(axis=1, keepdims=True), (M * gamma).sum(axis=1, keepdims=True)
    if not f.min() > 0:
        raise InputError("a section needs M other than zero, which has no g")
    across = np.sqrt(1 - c * c / f)
    node = (gamma - c / f * M) / across
    beta = np.cross(M, node) / np.sqrt(f)
    # √(1 - L²/f) (sin g, cos g) = (-β₃, -γ₀₃), as in steppers.section_function.
    ahead, facing = np.sin(g) * node - np.cos(g) * beta, np.cos(g) * node + np.sin(g) * beta
    value, rate = ahead[:, 2], np.cross(ahead, omega)[:, 2]
    at = CubicHermiteSpline(times, value, rate)
    found = at.roots(extrapolate=False)
    if abs(value[0]) < ON_SECTION:
        found = found[found > times[1]]
    crossed = Crossings(
        times=found,
        gamma=CubicHermiteSpline(times, gamma, np.cross(gamma, omega))(found),
        momenta=CubicHermiteSpline(times, M, np.cross(M, omega))(found),
        directions=np.sign(at(found, 1)).astype(int),
    )
    faces = CubicHermiteSpline(times, facing[:, 2], np.cross(facing, omega)[:, 2])(found)
    return crossed[faces < 0]
