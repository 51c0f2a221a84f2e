"""Long motions: Lyapunov exponents, the drift of the contact point, basins of attraction.

Exponents are taken by the reduced form of three numbers and the divergence. With M ≠ 0 the motion
is a flow on the rotations, a space of three dimensions: a neighbour's small turn ξ obeys
dξ/dt = Dω·ξ - ω×ξ, whose mean growth is λ₁ (Benettin, Galgani, Giorgilli and Strelcyn, Meccanica
15, 1980); along the motion itself the exponent is 0; and the three add up to the mean divergence
⟨div⟩, so λ₆ = ⟨div⟩ - λ₁. The other three of the six in (M, γ) belong to the constants γ², M² and
(M, γ), and are 0.

A motion from one of many starts is on a straight line after a transient if it hardly turns. Else
its crossings of a section repeat, on a cycle, or do not: then λ₁ parts tori from chaos.

In order: exponents, drift, basins.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robotball.dynamics.cycles import Cycle, close, nearest
from robotball.dynamics.sections import sections_of, starts_of
from robotball.errors import InputError
from robotball.robot.ball import Value
from robotball.robot.formulas import Parameters, speed_bound
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array, Mask, rotation_matrix
from robotball.theory.ensembles.orbits import LONG_RUN_TOLERANCE, Balls, Integers, Starts, orbits
from robotball.theory.ensembles.steppers import DEVIATION, PATH, System

# Any direction of a deviation will do, if none is special: the transient turns it into the fastest
# growing.
ANY_TURN = (0.6, 0.48, 0.64)


@dataclass(frozen=True)
class Exponents(Value):
    """The exponents of n starts, each from its own run, and what they say together.

    halves: (n, 2) 1/s, λ₁ over either half of each run; divergence: (n,) 1/s, ⟨div⟩ of each;
    duration s, of the means. Where the runs are of one attractor, `mean` and `error` estimate its
    exponents. Of a regular motion λ₁ is the motion's own 0, and λ₆ stands for the sum of the other
    two.
    """

    halves: Array
    divergence: Array
    duration: float

    @property
    def largest(self) -> Array:
        """λ₁ (n,) of each run, 1/s."""
        return self.halves.mean(axis=1)

    @property
    def smallest(self) -> Array:
        """λ₆ (n,) of each run, 1/s."""
        return self.divergence - self.largest

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
        return _kaplan_yorke(*self.mean)

    @property
    def dimension_error(self) -> float:
        """The standard error of `dimension`, from the scatter of the runs."""
        return standard_error(np.array([*map(_kaplan_yorke, self.largest, self.smallest)]))


def exponents(
    scene: Scene | str | Path,
    duration: float = 1e4,
    *,
    starts: Sequence[Start] | None = None,
    transient: float = 1000.0,
) -> Exponents:
    """Estimate the Lyapunov exponents of motions by the equations.

    The scene must be balanced, with constant rates and M other than zero. A positive largest
    exponent means chaos. That of a regular motion falls to 0 as ln(t)/t.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    duration : float, default 1e4, s
        The time over which the growth of a deviation is averaged.
    starts : sequence of Start, optional
        The starts of the motions. The default is the start of the scene.
    transient : float, default 1000, s
        The time before that, in which the motion settles.

    Returns
    -------
    Exponents
        The largest and the smallest exponent of each motion, with their standard errors.

    Raises
    ------
    InputError
        If the paper's equations do not describe the scene, if its rates change, if M is zero, if a
        time is not positive, if a motion cannot be followed, or if `load_scene` raises it.

    Examples
    --------
    >>> import robotball as rb
    >>> chaotic, regular = (rb.exponents(name, 2000.0) for name in ("fig14", "fig12"))
    >>> bool(chaotic.largest[0] > 0.05 > 0.01 > regular.largest[0])
    True
    """
    return exponents_of(*starts_of(scene, starts), duration, transient)


def exponents_of(
    balls: Balls,
    attitudes: Array,
    momenta: Array,
    duration: float,
    transient: float = 1000.0,
) -> Exponents:
    """Estimate the exponents of motions from n starts, over `duration` after a `transient` [s].

    balls: one, or several with equally many of the starts each; attitudes (n, 4), momenta (n, 3):
    as for `orbits`. Raises InputError on unusable starts or durations, and where a motion could not
    be followed.
    """
    starts = Starts(balls, attitudes, momenta)
    if not (starts.size > 0).all():
        raise InputError("exponents need M other than zero: with M = 0 the motion is on the sphere")
    rest = np.tile([*ANY_TURN, 0.0, 0.0], (len(starts.rows), 1))
    halves = _mean_rates(starts, DEVIATION, rest, duration, transient)
    return Exponents(halves[..., 7], halves[..., 8].mean(axis=1), duration)


def _mean_rates(
    starts: Starts, system: System, rest: Array, duration: float, transient: float
) -> Array:
    """Return a system's mean rates (n, 2, size) over each half of a duration after a transient [s].

    rest: as in `Starts.rows_of`. The states are in turned axes.
    """
    if not (duration > 0 and transient > 0):
        raise InputError("duration and transient must be positive")
    times = transient + duration * np.array([0.0, 0.5, 1.0])
    states, status = starts.march(system, rest, times, LONG_RUN_TOLERANCE)
    if status.any():
        raise InputError(f"{np.count_nonzero(status)} motions could not be followed")
    # Between both ends of the duration: what the transient adds is no part of the mean.
    return np.diff(states, axis=1) / (duration / 2)


@dataclass(frozen=True)
class Drift(Value):
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
) -> Drift:
    """Estimate the mean motion of the contact point over `duration` after a `transient` [s].

    attitudes (n, 4), momenta (n, 3): as for `orbits`. Raises InputError on unusable starts
    or durations, and where a motion could not be followed.
    """
    starts = Starts(parameters, attitudes, momenta)
    no_way = np.zeros((len(starts.rows), 2))
    # In the turned axes each start's momentum is against X, so that X is its OX.
    rates = _mean_rates(starts, PATH, no_way, duration, transient)
    return Drift(rates.mean(axis=1)[:, 4:], duration)


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


TORUS, CHAOS, LOST, LINE = -1, -2, -3, -4
_CROSSINGS = 64  # looked at after the transient; cycles that cross half as often are recognised
_REACHED = 1e-3  # of unit vectors: a point that near to a cycle has reached it
_AT_REST = 1e-4  # of the speed that |M| allows: a frame that slow has settled on a straight line
# Over _CHAOS_TIME a neighbour on a torus departs as the time does, by e^7; in chaos past e^30.
_CHAOS_TIME, _CHAOTIC_GROWTH = 1000.0, 30.0


@dataclass(frozen=True)
class Basins(Value):
    """labels (n,): for each start the number of its cycle in `cycles`, or TORUS, CHAOS, LINE, LOST.

    All tori have one label, as have all chaotic attractors and all straight-line motions (section
    5.1); LOST could not be followed, or stops crossing the section g = 0.
    """

    labels: Integers
    cycles: tuple[Cycle, ...]

    def share(self, label: int) -> float:
        """Return the part of the starts with a label."""
        return float(np.mean(self.labels == label))


def basins(
    parameters: Parameters, attitudes: Array, momenta: Array, transient: float = 3000.0
) -> Basins:
    """Find the attractor that the motion from each of n starts reaches, after a transient [s].

    attitudes (n, 4), momenta (n, 3): as for `orbits`. A start that approaches a cycle more
    slowly than the transient allows counts as on a torus. Raises InputError on unusable starts.
    """
    momenta = np.asarray(momenta, dtype=float)
    # The dear steps come last, for the starts that the cheap ones left undecided.
    settled = orbits(parameters, attitudes, momenta, np.array([0.0, transient]), LONG_RUN_TOLERANCE)
    labels = np.where(settled.status > 0, LOST, TORUS)
    at_end = settled.attitudes[:, 1]
    labels[_resting(parameters, at_end, momenta)] = LINE
    followed = np.flatnonzero(labels == TORUS)
    if not len(followed):
        return Basins(labels, ())
    ends = at_end[followed]
    crossings = sections_of(
        parameters, ends, momenta[followed], _CROSSINGS, tolerance=LONG_RUN_TOLERANCE
    )
    labels[followed[crossings.status > 0]] = LOST
    points = crossings.states
    cycles: list[Cycle] = []
    for i, start in enumerate(followed):
        if labels[start] != TORUS:
            continue
        period = _repeats(points[i], crossings.times[i])
        if period is None:
            continue
        cycle = _attracting(parameters, crossings.attitudes[i, -1], momenta[start], period)
        if cycle is None:
            continue
        # All starts that have reached this cycle are labelled at once, so that it is closed once.
        own = sections_of(parameters, cycle.attitude[None], cycle.momentum[None], _CROSSINGS)
        reached: Mask = nearest(points[:, -1], own.states[0]) < _REACHED
        if reached[i]:
            labels[followed[reached & (labels[followed] == TORUS)]] = len(cycles)
            cycles.append(cycle)
    # An orbit that repeats too slowly to be seen is regular, and counts as a torus.
    undecided = np.flatnonzero(labels == TORUS)
    if len(undecided):
        begin = settled.attitudes[undecided, 1]
        growth = exponents_of(parameters, begin, momenta[undecided], _CHAOS_TIME, transient=100.0)
        labels[undecided[growth.largest * _CHAOS_TIME > _CHAOTIC_GROWTH]] = CHAOS
    return Basins(labels, tuple(cycles))


def _resting(parameters: Parameters, attitudes: Array, momenta: Array) -> Mask:
    """Return where (n,) the frame hardly turns, at attitudes (n, 4), world momenta (n, 3)."""
    # Motions that could not be followed are NaN: any attitude stands in for theirs.
    followed: Mask = np.asarray(np.isfinite(attitudes).all(axis=1))
    axes = rotation_matrix(np.where(followed[:, None], attitudes, [1.0, 0.0, 0.0, 0.0]))
    M = np.einsum("nij,ni->nj", axes, momenta)
    omega = np.stack(parameters.angular_velocity(tuple(M.T), tuple(axes[:, 2].T)), axis=1)
    fastest = speed_bound(parameters, np.linalg.norm(momenta, axis=1))
    slow: Mask = np.linalg.norm(omega, axis=1) < _AT_REST * fastest
    return followed & slow


def _repeats(points: Array, times: Array) -> float | None:
    """Return the time since crossings (m, 6) at times (m,) last were where the last is [s]."""
    # The latest repetition, and so the shortest period: a cycle may cross the section often.
    gaps = np.linalg.norm(points[:-1] - points[-1], axis=1)
    again = np.flatnonzero(gaps < _REACHED)
    return float(times[-1] - times[again[-1]]) if len(again) else None


def _attracting(
    parameters: Parameters, attitude: Array, momentum: Array, period: float
) -> Cycle | None:
    """Return the attracting cycle of about that period [s] near an attitude (4,), or None."""
    try:
        cycle = close(parameters, attitude, momentum, period)
    except InputError:
        return None
    # Newton's method closes repelling cycles as well, and no motion ends on one.
    return cycle if abs(cycle.multipliers[0]) < 1 else None
