"""The times at which a motion is sampled."""

import numpy as np

from robotball.errors import InputError, check_positive, check_size
from robotball.rotations import Array

SAMPLE_INTERVAL = 0.02  # s, of the scene's own times
MOST_SAMPLES = 1e7  # of a motion: some 200 bytes each in a file (room.py), 120 in memory


def sample_times(duration: float, interval: float = SAMPLE_INTERVAL) -> Array:
    """Equal times (n,) from 0 to `duration`, at most `interval` apart [s].

    Raises InputError unless the duration is positive and finite, and for more than MOST_SAMPLES.
    """
    check_positive("duration", duration, "s")
    if not duration / interval < MOST_SAMPLES:
        raise InputError(
            f"{duration:g} s would be {duration / interval:.3g} samples {interval:g} s apart, of "
            f"at most {MOST_SAMPLES:g}; give times of your own"
        )
    intervals = int(np.ceil(duration / interval * (1 - 1e-12)))
    return np.linspace(0.0, duration, intervals + 1)


def check_times(times: Array) -> Array:
    """`times` (n,) as floats; raises InputError unless finite, increasing and starting at 0."""
    times = np.asarray(times, dtype=float)
    if times.ndim != 1 or len(times) < 2:
        raise InputError(f"times must be a list of at least two, not of shape {times.shape}")
    if not np.all(np.isfinite(times)):
        raise InputError("times must be finite")
    check_size("the last of the times", float(times[-1]), "s")
    if times[0] != 0:
        raise InputError(f"times must start at 0, not at {times[0]:g}")
    late = np.flatnonzero(np.diff(times) <= 0)
    if len(late):
        i = int(late[0])
        raise InputError(f"times must increase: {times[i + 1]:g} follows {times[i]:g}")
    return times
