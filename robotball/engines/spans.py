"""How a run is cut into steps that end on its sample times and on the drives' breakpoints."""

import numpy as np

from robotball.rotations import Array


def spans(
    times: Array, breakpoints: tuple[float, ...], timestep: float
) -> tuple[Array, Array, Array]:
    """Ends (m, 2), step lengths (m,) and counts (m,) between the times and breakpoints [s].

    Between two of them go the fewest equal steps not longer than `timestep`.
    """
    inside = [t for t in breakpoints if t < times[-1]]
    stops = np.union1d(times, inside) if inside else times
    ends = np.stack([stops[:-1], stops[1:]], axis=1)
    lengths = np.diff(stops)
    counts = np.ceil(lengths / timestep * (1 - 1e-9))
    return ends, np.minimum(lengths / counts, timestep), counts


def step_count(times: Array, breakpoints: tuple[float, ...], timestep: float) -> float:
    """How many steps such a run takes."""
    with np.errstate(over="ignore"):
        return float(spans(times, breakpoints, timestep)[2].sum())
