"""The error of a time step in sampling a drive, and a timestep that keeps it within a limit."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from robotball.robot.drives import Constant, Drive, Total
from robotball.rotations import uneven

_LOOKS = 256  # steps tested over a run, and as many on each side of breakpoints
_NO_STEP = 1e-9  # s: a drive that needs shorter steps is not a function of time


def sampling_error(drives: Iterable[Drive], stops: Any, timestep: float) -> float:
    """Return the largest error of a drive's mean over a step, sampled at three instants.

    It is the error of Simpson's rule with the begin, middle and end of the step, over the drive's
    largest value. RK4 makes this error, so the path of a hinge with a prescribed rate has about the
    same one. For a sine it is sin(x)/x - (2 + cos x)/3 of the amplitude with x = ω·timestep/2,
    which is zero at no frequency. Steps begin at uneven times, because a drive whose period divides
    the timestep has zero error at some phases. They end on the stops (n,) [s]: 0, breakpoints and
    the end.
    """
    sides = stops[:: -(-len(stops) // _LOOKS)]
    spread = uneven(stops[-1], stops[-1] / _LOOKS)
    looks = np.sort(np.concatenate([spread, sides, np.nextafter(sides, 0.0)]))
    piece = np.searchsorted(stops[1:-1], looks, side="right")
    length = np.diff(stops)[piece]
    step = length / np.ceil(length / timestep)
    begin = np.clip(looks - step / 2, stops[piece], stops[piece] + length - step)
    worst = 0.0
    for drive in (drive for drive in drives if not isinstance(drive, Constant)):
        instants = [begin + part * step for part in (0.0, 0.5, 1.0)]
        values = np.array([drive.rate(t) for t in instants])
        angles = np.array([drive.angle(begin), drive.angle(begin + step)])
        error = np.abs(np.diff(angles, axis=0)[0] - step * (values.T @ [1, 4, 1]) / 6)
        error -= 8 * np.finfo(float).eps * np.abs(angles).sum(axis=0)  # rounding errors
        worst = max(worst, float((error / step).max() / (_size(drive, instants) or 1.0)))
    return worst


def _size(drive: Drive, instants: list[Any]) -> float:
    """Return the largest value of a drive, or the sum of the largest values of its parts.

    If the parts cancel, the value of the sum is a meaningless rounding error.
    """
    if isinstance(drive, Total):
        return sum(_size(part, instants) for part in drive.drives)
    return max(float(np.abs(drive.rate(t)).max()) for t in instants)


def seeing_step(error_of: Callable[[float], float], timestep: float, limit: float) -> float:
    """Return a timestep [s], at most `timestep`, with a sampling error within a limit."""
    while (error := error_of(timestep)) > limit and timestep > _NO_STEP:
        # Simpson's rule is of fourth order once a step resolves the drive.
        timestep *= min(0.9, max(0.1, (limit / error) ** 0.25))
    return timestep
