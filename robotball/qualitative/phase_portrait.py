"""The phase portrait of motion from rest (4.1): fixed points, limit cycles, basins.

With M = 0 chaos is impossible: on the sphere every motion ends at a fixed point or on a cycle.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotball.engines.reduced.compiled.kernels import orbits
from robotball.parameters import Parameters
from robotball.qualitative.cycles import Cycle
from robotball.qualitative.equilibria import FixedPoint, attitude_at, fixed_points, rate_scale
from robotball.qualitative.fixed_point_formulas import name_of
from robotball.qualitative.limit_cycles import curve_of, limit_cycles, spread_points
from robotball.rotations import Array, rotation_matrix

LONGEST = 300.0  # rad, by the rates of the flow, of a cycle's period
TRIES = 5  # each four times as long, while something that must be there is not
SETTLING = 5000.0  # rad, that every start is given
STARTS = 120
TOLERANCE = 1e-9  # of a step: an attractor forgives what a path does not


@dataclass(frozen=True)
class PhasePortrait:
    """All of it for one ball.

    points; cycles, one of each pair C, -C; basins: the share of the sphere that each attractor has,
    by the name of its point, or "cycle" and its number; γ and -γ count as one.
    """

    points: tuple[FixedPoint, ...]
    cycles: tuple[Cycle, ...]
    basins: dict[str, float]


def phase_portrait(parameters: Parameters, starts: int = STARTS) -> PhasePortrait:
    """The phase portrait of a rubber ball; raises InputError where it is degenerate.

    Something must attract and something repel. Where no fixed point does, slower cycles are looked
    for; else those slower than LONGEST are not.
    """
    points = fixed_points(parameters)
    for attempt in range(TRIES):
        cycles = limit_cycles(parameters, 4**attempt * LONGEST / rate_scale(parameters))
        if complete(points, cycles):
            break
    return PhasePortrait(
        tuple(points), tuple(cycles), basin_shares(parameters, points, cycles, starts)
    )


def complete(points: Sequence[FixedPoint], cycles: Sequence[Cycle]) -> bool:
    """Whether there is something that attracts and something that repels; a centre is both."""
    kinds = " ".join(f" {point.kind}" for point in points)
    attracts = any(abs(cycle.multipliers[0]) < 1 for cycle in cycles)
    repels = any(abs(cycle.multipliers[0]) > 1 for cycle in cycles)
    centre = "centre" in kinds
    return (attracts or centre or " stable" in kinds) and (repels or centre or "unstable" in kinds)


def basin_shares(
    parameters: Parameters, points: Sequence[FixedPoint], cycles: Sequence[Cycle], starts: int
) -> dict[str, float]:
    """The share of starts, spread over the sphere, that end nearest to each attractor.

    All of them end at some attractor; near a slow focus that takes longer than anyone waits, so
    they are not asked to have arrived.
    """
    attractors: dict[str, list[Array]] = {}
    for point in points:
        if point.kind in ("stable node", "stable focus", "slow stable focus"):
            attractors.setdefault(pair_name(parameters, point), []).append(point.gamma[None])
    for number, cycle in enumerate(cycles):
        if abs(cycle.multipliers[0]) < 1:
            curve = curve_of(parameters, cycle.gamma, cycle.period)[::8]
            attractors[f"cycle {number}"] = [curve, -curve]
    if not attractors:
        return {}
    attitudes = attitude_at(spread_points(starts))
    times = np.array([0.0, SETTLING / rate_scale(parameters)])
    ends = orbits(parameters, attitudes, np.zeros((starts, 3)), times, TOLERANCE).attitudes[:, 1]
    gamma = rotation_matrix(ends)[:, 2]
    distances = np.array([distance(gamma, np.concatenate(each)) for each in attractors.values()])
    reached = distances.argmin(axis=0)
    return {name: float(np.mean(reached == i)) for i, name in enumerate(attractors)}


def pair_name(parameters: Parameters, point: FixedPoint) -> str:
    """The name of a fixed point and its opposite together, such as "θ₃,₄"."""
    names = sorted(filter(None, (name_of(parameters, s * point.gamma) for s in (1.0, -1.0))))
    if len(names) < 2:
        return "unnamed"
    return f"{names[0]},{names[1][-1]}"


def distance(gamma: Array, curve: Array) -> Array:
    """How far each γ (n, 3) is from the nearest point of a curve (m, 3): (n,)."""
    nearest: Array = (gamma @ curve.T).max(axis=1)
    return np.sqrt(np.maximum(2 - 2 * nearest, 0.0))
