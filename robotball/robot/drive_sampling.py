"""How the steps of a run see drives that change: the error of a step, and one that errs less."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from robotball.robot.drives import Constant, Drive, Total
from robotball.rotations import uneven

_LOOKS = 256  # steps that are looked at over a run, and as many at each side of breakpoints


def sampling_error(drives: Iterable[Drive], stops: Any, timestep: float) -> float:
    """Return the largest error of a drive's mean over a step as seen at three instants of it.

    It is Simpson's, by the step's begin, middle and end, over the drive's largest value. RK4 makes
    that error, so the path of a hinge that keeps its rate is off by about as much. Of a sine it is
    sin(x)/x - (2 + cos x)/3 of the amplitude, x = ω·timestep/2, which is zero at no frequency.
    Steps are looked at from uneven times on, as one whose period divides the timestep has an error
    of zero at some phases. They end on the stops (n,) [s], which are 0, breakpoints and the end.
    """
    sides = stops[:: -(-len(stops) // _LOOKS)]
    spread = uneven(stops[-1], stops[-1] / _LOOKS)
    looks = np.sort(np.concatenate([spread, sides, np.nextafter(sides, 0.0)]))
    piece = np.searchsorted(stops[1:-1], looks, side="right")
    length = np.diff(stops)[piece]
    step = length / np.ceil(length / timestep)
    begin = np.clip(looks - step / 2, stops[piece], stops[piece] + length - step)
    worst = 0.0
    for drive in (each for each in drives if not isinstance(each, Constant)):
        instants = [begin + part * step for part in (0.0, 0.5, 1.0)]
        values = np.array([drive.rate(t) for t in instants])
        angles = np.array([drive.angle(begin), drive.angle(begin + step)])
        error = np.abs(np.diff(angles, axis=0)[0] - step * (values.T @ [1, 4, 1]) / 6)
        error -= 8 * np.finfo(float).eps * np.abs(angles).sum(axis=0)  # their rounding
        worst = max(worst, float((error / step).max() / (_size(drive, instants) or 1.0)))
    return worst


def _size(drive: Drive, instants: list[Any]) -> float:
    """Return the largest value of a drive, or the sum of its parts' largest values.

    Parts that cancel leave their rounding, which is no measure of anything.
    """
    if isinstance(drive, Total):
        return sum(_size(part, instants) for part in drive.drives)
    return max(float(np.abs(drive.rate(t)).max()) for t in instants)


_NO_STEP = 1e-9  # s: drives that such steps do not see are no functions of time


def seeing_step(error_of: Callable[[float], float], timestep: float, limit: float) -> float:
    """Return a timestep [s], `timestep` at most, whose error about drives is within a limit."""
    while (error := error_of(timestep)) > limit and timestep > _NO_STEP:
        # Simpson's error is of fourth order, where a step sees the drive at all.
        timestep *= min(0.9, max(0.1, (limit / error) ** 0.25))
    return timestep
