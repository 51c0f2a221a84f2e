"""How a run is stepped: between sample times and the drives' breakpoints, in bounded parts."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robotball.rotations import Array

LOOK = 4096  # steps between two looks at the run


@dataclass(frozen=True)
class Stretch:
    """Consecutive spans of time that are stepped before the run is looked at.

    ends    (m, 2)  s, where the spans begin and end
    lengths  (m,)    s, of the steps in each
    counts   (m,)    how many there are
    samples  (k,)    which steps, counted over the stretch, start at a sample time
    """

    ends: Array
    lengths: Array
    counts: Array
    samples: Array

    def __iter__(self) -> Iterator[tuple[list[float], float, int]]:
        spans = zip(self.ends.tolist(), self.lengths.tolist(), self.counts.tolist(), strict=True)
        yield from spans


def stretches(times: Array, breakpoints: tuple[float, ...], timestep: float) -> Iterator[Stretch]:
    """A run over `times` (n,) [s], in stretches of about LOOK steps however far apart they are.

    Between two sample times or breakpoints go the fewest equal steps not longer than `timestep`.
    """
    ends, lengths, counts = _spans(times, breakpoints, timestep)
    # A long span is cut into parts of LOOK steps.
    parts = np.ceil(counts / LOOK).astype(int)
    first = np.cumsum(parts) - parts
    part = np.arange(parts.sum()) - np.repeat(first, parts)
    lengths, begins = np.repeat(lengths, parts), np.repeat(ends[:, 0], parts)
    sizes = np.minimum(np.repeat(counts, parts) - LOOK * part, LOOK).astype(int)
    begins = begins + LOOK * part * lengths
    ends = np.stack([begins, begins + sizes * lengths], axis=1)
    sampled = np.isin(begins, times)
    look = (np.cumsum(sizes) - 1) // LOOK
    for which in np.split(np.arange(len(sizes)), np.flatnonzero(np.diff(look)) + 1):
        starts = np.cumsum(sizes[which]) - sizes[which]
        yield Stretch(ends[which], lengths[which], sizes[which], starts[sampled[which]])


def longest_step(times: Array, breakpoints: tuple[float, ...], timestep: float) -> float:
    """The longest step of such a run [s]."""
    return float(_spans(times, breakpoints, timestep)[1].max())


def step_count(times: Array, breakpoints: tuple[float, ...], timestep: float) -> float:
    """How many steps such a run takes."""
    with np.errstate(over="ignore"):
        return float(_spans(times, breakpoints, timestep)[2].sum())


def _spans(
    times: Array, breakpoints: tuple[float, ...], timestep: float
) -> tuple[Array, Array, Array]:
    """Ends (m, 2), step lengths (m,) and counts (m,) between the times and breakpoints."""
    inside = [t for t in breakpoints if t < times[-1]]
    stops = np.union1d(times, inside)
    ends = np.stack([stops[:-1], stops[1:]], axis=1)
    counts = np.ceil(np.diff(stops) / timestep * (1 - 1e-9))
    return ends, np.minimum(np.diff(stops) / counts, timestep), counts
