"""Means over long motions: Lyapunov exponents, and the drift of the contact point.

Exponents are taken by the reduced form of three numbers and the divergence. With M ≠ 0 the motion
is a flow on the rotations, a space of three dimensions: a neighbour's small turn ξ obeys
dξ/dt = Dω·ξ - ω×ξ, whose mean growth is λ₁ (Benettin, Galgani, Giorgilli and Strelcyn, Meccanica
15, 1980); along the motion itself the exponent is 0; and the three add up to the mean divergence
⟨div⟩, so λ₆ = ⟨div⟩ - λ₁. The other three of the six in (M, γ) belong to the constants γ², M² and
(M, γ), and are 0.
"""

from dataclasses import dataclass

import numpy as np

from robotball.engines.ensembles.orbits import LONG_RUN_TOLERANCE, Integers, Starts, orbits
from robotball.engines.ensembles.steppers import DEVIATION
from robotball.equations import Parameters
from robotball.errors import InputError
from robotball.rotations import Array


@dataclass(frozen=True)
class Exponents:
    """The exponents of n starts, each from its own run, and what they say together.

    largest, divergence: (n,) 1/s, λ₁ and ⟨div⟩ of each run; duration s, of the means. Where the
    runs are of one attractor, `mean` and `error` estimate its exponents. Of a regular motion λ₁
    is the motion's own 0, and λ₆ stands for the sum of the other two.
    """

    largest: Array
    divergence: Array
    duration: float

    @property
    def smallest(self) -> Array:
        """λ₆ (n,) of each run, 1/s."""
        return self.divergence - self.largest

    @property
    def spectrum(self) -> Array:
        """All six exponents (6,) of (M, γ) over all runs, largest first, 1/s."""
        largest, smallest = self.mean
        return np.sort([largest, 0.0, 0.0, 0.0, 0.0, smallest])[::-1]

    @property
    def mean(self) -> tuple[float, float]:
        """λ₁ and λ₆ over all runs, 1/s."""
        return float(self.largest.mean()), float(self.smallest.mean())

    @property
    def error(self) -> tuple[float, float]:
        """The standard errors of `mean`, from the scatter of the runs; NaN for a single one."""
        return standard_error(self.largest), standard_error(self.smallest)

    @property
    def dimension(self) -> float:
        """The Kaplan-Yorke dimension of the attractor's section, as in the paper.

        In phase space, with the direction of the motion, it is one more.
        """
        return _kaplan_yorke(self.mean[0], self.mean[1])

    @property
    def dimension_error(self) -> float:
        """The standard error of `dimension`, from the scatter of the runs."""
        return standard_error(
            np.array(
                [_kaplan_yorke(*each) for each in zip(self.largest, self.smallest, strict=True)]
            )
        )


def exponents(
    parameters: Parameters,
    attitudes: Array,
    momenta: Array,
    duration: float,
    transient: float = 1000.0,
    tolerance: float = LONG_RUN_TOLERANCE,
) -> Exponents:
    """Estimate the exponents of motions from n starts, over `duration` after a `transient` [s].

    attitudes (n, 4), momenta (n, 3): as for `orbits`. Raises InputError on unusable starts
    or durations, and where a motion could not be followed.
    """
    if not (duration > 0 and transient > 0):
        raise InputError("duration and transient must be positive")
    starts = Starts(parameters, attitudes, momenta)
    if not (starts.size > 0).all():
        raise InputError("exponents need M other than zero: with M = 0 the motion is on the sphere")
    # Any direction will do, if none is special: the transient turns it into the fastest growing.
    rest = np.tile([0.6, 0.48, 0.64, 0.0, 0.0], (len(starts.rows), 1))
    times = np.array([transient, transient + duration])
    states, status = starts.march(DEVIATION, rest, times, tolerance)
    _check_followed(status)
    # Logarithms at both ends of the duration: the transient's growth is no part of the mean.
    growth, volume = np.moveaxis(states[:, 1, 7:9] - states[:, 0, 7:9], -1, 0) / duration
    return Exponents(largest=growth, divergence=volume, duration=duration)


@dataclass(frozen=True)
class Drift:
    """Mean motions of the contact points of n starts, along and across their momenta.

    velocities (n, 2) m/s: along OX = -M/√f of section 3.3, which each start has for itself, and
    OY, to its left. duration s, of the means.
    """

    velocities: Array
    duration: float

    @property
    def mean(self) -> Array:
        """The mean velocity (2,) over the starts, m/s."""
        return self.velocities.mean(axis=0)

    @property
    def error(self) -> Array:
        """The standard error (2,) of `mean`, from the scatter of the starts, m/s."""
        return np.array([standard_error(each) for each in self.velocities.T])


def drift(
    parameters: Parameters,
    attitudes: Array,
    momenta: Array,
    duration: float,
    transient: float = 1000.0,
    tolerance: float = LONG_RUN_TOLERANCE,
) -> Drift:
    """Estimate the mean motion of the contact point over `duration` after a `transient` [s].

    attitudes (n, 4), momenta (n, 3): as for `orbits`. Raises InputError on unusable starts
    or durations, and where a motion could not be followed.
    """
    times = np.array([0.0, transient, transient + duration])
    runs = orbits(parameters, attitudes, momenta, times, tolerance)
    _check_followed(runs.status)
    velocities = (runs.contact_points[:, 2] - runs.contact_points[:, 1]) / duration
    # Each start has its own OX, along which its momentum lies in the plane.
    turns = Starts(parameters, attitudes, momenta).turns
    cos, sin = np.cos(turns), np.sin(turns)
    VX, VY = velocities.T
    return Drift(np.stack([cos * VX + sin * VY, cos * VY - sin * VX], axis=1), duration)


def _kaplan_yorke(largest: float, smallest: float) -> float:
    """Return the dimension 1 + λ₁/|λ₆| of an attractor's section; 0 of a cycle's, 1 of a torus's.

    From λ₁, 0, λ₆ with the direction of the motion left out.
    """
    if largest <= 0:
        return 0.0
    # A sum that is not negative contracts no area: the section is filled.
    return 2.0 if largest + smallest >= 0 else 1 + largest / -smallest


def standard_error(values: Array) -> float:
    """Return the standard error of the mean of independent values (n,)."""
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else float("nan")


def _check_followed(status: Integers) -> None:
    if status.any():
        raise InputError(f"{np.count_nonzero(status)} motions could not be followed")
