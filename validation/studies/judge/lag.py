"""Whether a shift in time explains how a trajectory differs from the reference."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize_scalar

from robotball import Motion
from robotball.engines.derivative import continuous, rates
from robotball.rotations import Array
from validation.studies.judge.numbers import Numbers

SHIFTS = 400  # that are tried, at most, before the best is found among its neighbours
LONGEST = 0.1  # of the time, that a trajectory is shifted by
EXPLAINS = 3.0  # times less error, from where on a shift is told


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
    path = CubicHermiteSpline(
        reference.times,
        reference.contact_point,
        rates(reference.times, reference.contact_point)[0],
    )
    q = continuous(reference.attitude)
    attitude = CubicHermiteSpline(reference.times, q, rates(reference.times, q)[0])
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
