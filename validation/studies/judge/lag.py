"""Whether a shift in time explains how a trajectory differs from the reference."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize_scalar

from robotball import Motion
from robotball.engines.derivative import continuous, rates
from robotball.rotations import Array
from validation.studies.judge.numbers import Numbers, Truth, errors_at, typical

EXPLAINS = 3.0  # times less error, from where on a shift is told
SHIFTS = 400  # that are tried, at most, before the best is found among its neighbours
LONGEST = 0.1  # of the time, that a trajectory is shifted by, or stretched


@dataclass(frozen=True)
class Lag:
    """The shift [s] by which a trajectory comes after the reference, and the errors without it.

    before, after: typical errors, the root mean square of path and attitude together, relative.
    """

    shift: float
    before: float
    after: float

    @property
    def explains(self) -> bool:
        return self.after * EXPLAINS < self.before


def lag_of(times: Array, numbers: Numbers, reference: Motion) -> Lag:
    """The lag of numbers at times (n,) [s] behind a reference that is sampled as finely."""
    path, attitude = _between(reference)
    end = float(reference.times[-1])

    def error(shift: float) -> float:
        at = times - shift
        inside = (at >= 0) & (at <= end)
        ours, theirs = numbers.position[inside, :2], path(at[inside])
        turn = attitude(at[inside])
        # 2|sin(half the angle)| between them, whatever the signs.
        cosine = np.abs((turn * numbers.attitude[inside]).sum(axis=1)) / np.linalg.norm(
            turn, axis=1
        )
        apart = ((ours - theirs) ** 2).sum(axis=1) / reference.path_scale**2
        return float(np.sqrt(np.mean(apart + 2 * (1 - np.minimum(cosine, 1.0)))))

    most = min(LONGEST * end, end - float(times[0]))
    step = max(2 * most / SHIFTS, min(most, float(np.median(np.diff(times)))) / 4)
    tried = np.arange(-most, most + step / 2, step)
    best = float(min(tried, key=error))
    found = minimize_scalar(
        error, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-9}
    )
    return Lag(float(found.x), error(0.0), float(found.fun))


def stretch_of(numbers: Numbers, truth: Truth, reference: Motion) -> float:
    """How many times too long the times of the numbers seem, by what lessens their errors most.

    reference: the motion of the truth, in fine samples, until after the trajectory's end.
    """
    path, attitude = _between(reference)

    def error(stretch: float) -> float:
        at = truth.times / stretch
        q = attitude(at)
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        other = replace(truth, contact_point=path(at), attitude=q)
        return float(typical(errors_at(replace(numbers, rate=None), other), truth.times).sum())

    tried = np.linspace(1 - LONGEST, 1 + LONGEST, SHIFTS + 1)
    best, step = float(min(tried, key=error)), float(tried[1] - tried[0])
    found = minimize_scalar(
        error, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-7}
    )
    return float(found.x)


def _between(reference: Motion) -> tuple[CubicHermiteSpline, CubicHermiteSpline]:
    """Path and attitude, as a quaternion of about unit length, between a motion's samples."""
    times, q = reference.times, continuous(reference.attitude)
    path, turn = rates(times, reference.contact_point)[0], rates(times, q)[0]
    return (
        CubicHermiteSpline(times, reference.contact_point, path),
        CubicHermiteSpline(times, q, turn),
    )
