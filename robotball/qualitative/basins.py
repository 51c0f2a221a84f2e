"""Basins of attraction: which attractor each of many starts reaches.

After a transient a motion is on a straight line if it hardly turns. Else its crossings of a section
repeat, on a cycle, or do not: then its largest Lyapunov exponent parts tori from chaos.
"""

from dataclasses import dataclass

import numpy as np

from robotball.engines.ensembles.orbits import LONG_RUN_TOLERANCE, Integers, orbits
from robotball.equations import Parameters, speed_bound
from robotball.errors import InputError
from robotball.qualitative.cycles import Cycle, close, nearest
from robotball.qualitative.long_run import exponents
from robotball.qualitative.sections import section
from robotball.rotations import Array, Mask, rotation_matrix

TORUS, CHAOS, LOST, LINE = -1, -2, -3, -4
_CROSSINGS = 64  # looked at after the transient; cycles that cross half as often are recognised
_NEAR = 1e-3  # of unit vectors: a point that near to a cycle has reached it
_AT_REST = 1e-4  # of the speed that |M| allows: a frame that slow has settled on a straight line
# Over CHAOS_TIME a neighbour on a torus departs as the time does, by e^7; in chaos past e^30.
_CHAOS_TIME, _CHAOTIC_GROWTH = 1000.0, 30.0


@dataclass(frozen=True)
class Basins:
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
    crossings = section(
        parameters, ends, momenta[followed], _CROSSINGS, tolerance=LONG_RUN_TOLERANCE
    )
    labels[followed[crossings.status > 0]] = LOST
    # What does not cross is somewhere, but nowhere that counts.
    crossed = np.where(np.isnan(crossings.attitudes), ends[:, None], crossings.attitudes)
    points = level_points(crossed, momenta[followed])
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
        own = section(parameters, cycle.attitude[None], cycle.momentum[None], _CROSSINGS)
        through = level_points(own.attitudes, cycle.momentum[None])[0]
        reached: Mask = nearest(points[:, -1], through) < _NEAR
        if reached[i]:
            labels[followed[reached & (labels[followed] == TORUS)]] = len(cycles)
            cycles.append(cycle)
    # An orbit that repeats too slowly to be seen is regular, and counts as a torus.
    undecided = np.flatnonzero(labels == TORUS)
    if len(undecided):
        begin = settled.attitudes[undecided, 1]
        growth = exponents(parameters, begin, momenta[undecided], _CHAOS_TIME, transient=100.0)
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
    again = np.flatnonzero(gaps < _NEAR)
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


def level_points(attitudes: Array, momenta: Array) -> Array:
    """Return γ and M/|M| (n, m, 6) at attitudes (n, m, 4), with world momenta (n, 3)."""
    axes = rotation_matrix(attitudes.reshape(-1, 4)).reshape(*attitudes.shape[:2], 3, 3)
    M = np.einsum("nmij,ni->nmj", axes, momenta)
    size = np.linalg.norm(momenta, axis=1)[:, None, None]
    return np.concatenate([axes[:, :, 2], M / size], axis=2)
