"""Long motions: Lyapunov exponents and basins of attraction.

With M ≠ 0 the motion is a flow on the three-dimensional rotation group. The small rotation ξ to a
neighbouring motion obeys dξ/dt = Dω·ξ - ω×ξ, and its mean growth rate is λ₁ (Benettin, Galgani,
Giorgilli and Strelcyn, Meccanica 15, 1980). The exponent along the motion is 0, and the three
exponents of the group add up to the mean divergence ⟨div⟩, so λ₆ = ⟨div⟩ - λ₁. The other three of
the six exponents in (M, γ) belong to the constants γ², M² and (M, γ), and are 0.

Attractors: after a transient, a ball that hardly rotates is on a straight line; a motion whose
section points repeat is on a cycle; otherwise λ₁ separates tori from chaos.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.distance import cdist

from robotball.dynamics.cycles import Cycle, close
from robotball.dynamics.sections import sections_of, starts_of
from robotball.errors import InputError
from robotball.robot.ball import Value
from robotball.robot.formulas import Parameters, speed_bound
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array, Mask, rotation_matrix
from robotball.theory.ensembles.orbits import LONG_RUN_TOLERANCE, Balls, Integers, Starts, orbits
from robotball.theory.ensembles.steppers import DEVIATION

# An arbitrary initial deviation: the transient turns it into the direction of fastest growth.
ANY_TURN = (0.6, 0.48, 0.64)
TORUS, CHAOS, LOST, LINE = -1, -2, -3, -4  # labels of `Basins`, below the numbers of cycles
_CROSSINGS = 64  # analysed after the transient; cycles with at most half as many are recognized
_REACHED = 1e-3  # distance of unit vectors below which a point is on a cycle
_AT_REST = 1e-4  # of the largest angular speed that |M| allows; below it the path is straight
# Within _CHAOS_TIME [s], neighbours separate by about e^7 on a torus and by over e^30 in chaos.
_CHAOS_TIME, _CHAOTIC_GROWTH = 1000.0, 30.0


@dataclass(frozen=True)
class Exponents(Value):
    """Lyapunov exponents of n motions, and their mean if all belong to one attractor.

    On a regular motion λ₁ is 0, the exponent along the motion, and λ₆ is the sum of the other two.

    Attributes
    ----------
    halves : (n, 2), 1/s, λ₁ over each half of the duration
    divergence : (n,), 1/s, ⟨div⟩
    duration : s, over which the means are taken
    """

    halves: Array
    divergence: Array
    duration: float

    @property
    def largest(self) -> Array:
        """λ₁ (n,) of each motion [1/s]."""
        return self.halves.mean(axis=1)

    @property
    def smallest(self) -> Array:
        """λ₆ (n,) of each motion [1/s]."""
        return self.divergence - self.largest

    @property
    def mean(self) -> tuple[float, float]:
        """λ₁ and λ₆, averaged over all motions [1/s]."""
        return float(self.largest.mean()), float(self.smallest.mean())

    @property
    def error(self) -> tuple[float, float]:
        """Standard errors of `mean` from the scatter of the motions; NaN for a single one."""
        return standard_error(self.largest), standard_error(self.smallest)

    @property
    def dimension(self) -> float:
        """Kaplan–Yorke dimension of the attractor's section, as in the paper.

        The dimension in phase space is larger by one.
        """
        return _kaplan_yorke(*self.mean)

    @property
    def dimension_error(self) -> float:
        """Standard error of `dimension` from the scatter of the motions."""
        return standard_error(np.array([*map(_kaplan_yorke, self.largest, self.smallest)]))


def exponents(
    scene: Scene | str | Path,
    duration: float = 1e4,
    *,
    starts: Sequence[Start] | None = None,
    transient: float = 1000.0,
) -> Exponents:
    """Integrate motions and estimate their Lyapunov exponents.

    The scene must be balanced, with constant rates and M ≠ 0. If the largest exponent is positive,
    the motion is chaotic. In a regular motion the estimate falls to 0 in proportion to ln(t)/t.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    duration : float, default 1e4, s
        The time over which the growth of a deviation is averaged.
    starts : sequence of Start, optional
        The starts of the motions. The default is the start of the scene.
    transient : float, default 1000, s
        The time before `duration`, in which the motion settles.

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
    balls: Balls, attitudes: Array, momenta: Array, duration: float, transient: float = 1000.0
) -> Exponents:
    """Estimate the Lyapunov exponents of n motions over `duration` after a `transient` [s].

    balls: one ball, or several balls with equally many starts each. attitudes (n, 4), momenta (n,
    3): as for `orbits`. Raises InputError for invalid starts or durations, and if an integration
    fails.
    """
    starts = Starts(balls, attitudes, momenta)
    if not (starts.size > 0).all():
        raise InputError("exponents need a nonzero momentum M")
    if not (duration > 0 and transient > 0):
        raise InputError("duration and transient must be positive")
    rest = np.tile([*ANY_TURN, 0.0, 0.0], (len(starts.rows), 1))
    times = transient + duration * np.array([0.0, 0.5, 1.0])
    states, status = starts.march(DEVIATION, rest, times, LONG_RUN_TOLERANCE)
    if status.any():
        raise InputError(f"{np.count_nonzero(status)} motions could not be integrated")
    # Differences between the ends of each half: growth during the transient does not count.
    halves = np.diff(states, axis=1) / (duration / 2)
    return Exponents(halves[..., 7], halves[..., 8].mean(axis=1), duration)


def _kaplan_yorke(largest: float, smallest: float) -> float:
    """Return the dimension 1 + λ₁/|λ₆| of an attractor's section, without the flow direction."""
    if largest <= 0:
        return 0.0
    # If the sum is not negative, areas do not contract and the section is filled.
    return 2.0 if largest + smallest >= 0 else 1 + largest / -smallest


def standard_error(values: Array) -> float:
    """Return the standard error of the mean of values (n,); NaN for one value."""
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else float("nan")


@dataclass(frozen=True)
class Basins(Value):
    """Attractors reached from n starts.

    labels (n,): number of the cycle in `cycles`, or TORUS, CHAOS, LINE (straight line, section 5.1)
    or LOST (integration failed, or no more crossings of g = 0). Each of these labels stands for all
    attractors of its kind.
    """

    labels: Integers
    cycles: tuple[Cycle, ...]

    def share(self, label: int) -> float:
        """Return the fraction of the starts with a label."""
        return float(np.mean(self.labels == label))


def basins(
    parameters: Parameters, attitudes: Array, momenta: Array, transient: float = 3000.0
) -> Basins:
    """Find the attractor reached from each of n starts after a transient [s].

    attitudes (n, 4), momenta (n, 3): as for `orbits`. A start that approaches a cycle too slowly
    for the transient counts as a torus. Raises InputError for invalid starts.
    """
    momenta = np.asarray(momenta, dtype=float)
    # Cheap tests first; expensive ones only for the starts that are still undecided.
    settled = orbits(parameters, attitudes, momenta, np.array([0.0, transient]), LONG_RUN_TOLERANCE)
    labels = np.where(settled.status > 0, LOST, TORUS)
    at_end = settled.attitudes[:, 1]
    labels[_resting(parameters, at_end, momenta)] = LINE
    followed = np.flatnonzero(labels == TORUS)
    if not len(followed):
        return Basins(labels, ())
    ends, tolerance = (at_end[followed], momenta[followed]), LONG_RUN_TOLERANCE
    crossings = sections_of(parameters, *ends, _CROSSINGS, tolerance=tolerance)
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
        # Label all starts on this cycle at once, so that it is closed only once.
        on_cycle = sections_of(parameters, cycle.attitude[None], cycle.momentum[None], _CROSSINGS)
        nearest = cdist(points[:, -1], on_cycle.states[0]).min(axis=1)
        reached: Mask = nearest < _REACHED
        if reached[i]:
            labels[followed[reached & (labels[followed] == TORUS)]] = len(cycles)
            cycles.append(cycle)
    # A motion that repeats too slowly to be recognized is regular, and counts as a torus.
    undecided = np.flatnonzero(labels == TORUS)
    if len(undecided):
        begin = settled.attitudes[undecided, 1]
        growth = exponents_of(parameters, begin, momenta[undecided], _CHAOS_TIME, transient=100.0)
        labels[undecided[growth.largest * _CHAOS_TIME > _CHAOTIC_GROWTH]] = CHAOS
    return Basins(labels, tuple(cycles))


def _resting(parameters: Parameters, attitudes: Array, momenta: Array) -> Mask:
    """Return where (n,) the frame hardly rotates; attitudes (n, 4), momenta (n, 3) world."""
    # Failed integrations are NaN; substitute an arbitrary attitude for them.
    followed: Mask = np.asarray(np.isfinite(attitudes).all(axis=1))
    axes = rotation_matrix(np.where(followed[:, None], attitudes, [1.0, 0.0, 0.0, 0.0]))
    M = np.einsum("nij,ni->nj", axes, momenta)
    omega = np.stack(parameters.angular_velocity(tuple(M.T), tuple(axes[:, 2].T)), axis=1)
    fastest = speed_bound(parameters, np.linalg.norm(momenta, axis=1))
    slow: Mask = np.linalg.norm(omega, axis=1) < _AT_REST * fastest
    return followed & slow


def _repeats(points: Array, times: Array) -> float | None:
    """Return the time [s] from the previous visit to the last of crossings (m, 6), or None."""
    # The latest visit gives the shortest period, in which the cycle may cross several times.
    gaps = np.linalg.norm(points[:-1] - points[-1], axis=1)
    again = np.flatnonzero(gaps < _REACHED)
    return float(times[-1] - times[again[-1]]) if len(again) else None


def _attracting(
    parameters: Parameters, attitude: Array, momentum: Array, period: float
) -> Cycle | None:
    """Return the attracting cycle near an attitude (4,), with about that period [s], or None."""
    try:
        cycle = close(parameters, attitude, momentum, period)
    except InputError:
        return None
    # Newton's method also finds repelling cycles, which no motion approaches.
    return cycle if abs(cycle.multipliers[0]) < 1 else None
