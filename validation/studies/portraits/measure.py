"""Which phase portrait (4.1) has at each (K₃, Ω): the maps, a cell's record, and the sweep.

(4.1) is linear in K and Ω together, so that of (K₃, Ω) only three ratios count: the size of both
scales time alone. Each map is a plane through the ball of Figs 6 to 8.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robotball import InputError
from robotball.equations import Vector
from robotball.parameters import Parameters
from robotball.qualitative.fixed_point_formulas import name_of
from validation.progress import Show
from validation.sweeps import Cell, Result, sweep

A: Vector = (0.5, 0.4, 0.3)  # of Figs 5 to 8, 1/(kg m²)
OMEGA: Vector = (4.0, 2.0, 1.0)  # rad/s
COUNT, QUICK_COUNT = 24, 4  # values of an axis
LIMIT = 300.0  # s of one cell


@dataclass(frozen=True)
class Plane:
    """A map: K₃ across from -K3 to K3 [kg m²/s]; up is `y`, from `low` to `high`."""

    name: str
    label: str
    held: str
    K3: float
    low: float
    high: float
    Omega: Callable[[float], Vector]

    def ball(self, K3: float, y: float) -> Parameters:
        """The ball at a place of the map."""
        d = 1.0
        I = (1 / A[0] - d, 1 / A[1] - d, 1 / A[2] - d)
        return Parameters("rubber", I, d, 1.0, self.Omega(y), (0.0, 0.0, K3))

    def axes(self, count: int) -> tuple[list[float], list[float]]:
        """The values of K₃ and of y; with an even count none falls on a line of symmetry."""
        return tuple(
            [float(f"{value:.6g}") for value in np.linspace(low, high, count)]
            for low, high in ((-self.K3, self.K3), (self.low, self.high))
        )  # type: ignore[return-value]


def turned(degrees: float) -> Vector:
    """OMEGA with its part across e₃ turned to this angle from e₁."""
    size, angle = np.hypot(OMEGA[0], OMEGA[1]), np.radians(degrees)
    return (float(size * np.cos(angle)), float(size * np.sin(angle)), OMEGA[2])


PLANES = {
    plane.name: plane
    for plane in (
        Plane("axial", "Ω₃ [rad/s]", "Ω₁ = 4, Ω₂ = 2 rad/s", 3.0, -4.0, 4.0,
              lambda y: (OMEGA[0], OMEGA[1], y)),
        Plane("azimuth", "angle of (Ω₁, Ω₂) from e₁ [degrees]",
              "√(Ω₁² + Ω₂²) = √20, Ω₃ = 1 rad/s", 3.0, -85.0, 85.0, turned),
    )
}  # fmt: skip


def chosen(names: Sequence[str]) -> list[Plane]:
    """The maps named, or all for none; raises InputError for one that there is not."""
    for name in names:
        if name not in PLANES:
            raise InputError(f"no map is called {name!r}; there are {', '.join(PLANES)}")
    return [PLANES[name] for name in names or PLANES]


def cells_of(plane: Plane, count: int) -> list[Cell]:
    """The cells of a map, row by row."""
    across, up = plane.axes(count)
    return [{"map": plane.name, "K3": K3, "y": y} for y in up for K3 in across]


def survey(
    planes: Sequence[Plane],
    count: int,
    file: Path,
    show: Show,
    *,
    workers: int | None = None,
    cluster: str | None = None,
) -> dict[str, list[Result]]:
    """The results of the maps' cells by the map's name; `file` keeps them for another time."""
    results: dict[str, list[Result]] = {}
    for done, plane in enumerate(planes):
        results[plane.name] = sweep(
            measure,
            cells_of(plane, count),
            file,
            workers=workers,
            cluster=cluster,
            limit=LIMIT,
            show=partial(_show, show, done * count**2, plane.name),
        )
    return results


def measure(cell: Mapping[str, Any]) -> dict[str, Any]:
    """The phase portrait of a cell {map, K3, y}.

    points: the type of each fixed point by its name; cycles: period s and multiplier of each, and
    whether it is its own opposite; basins: the share of the sphere of each attractor.
    """
    # The compiled code takes a while to come, and only who measures needs it.
    from robotball.qualitative.limit_cycles import curve_of, lies_on
    from robotball.qualitative.phase_portrait import phase_portrait

    ball = PLANES[cell["map"]].ball(cell["K3"], cell["y"])
    found = phase_portrait(ball)
    return {
        "points": {name_of(ball, point.gamma): point.kind for point in found.points},
        "cycles": [
            {
                "period": cycle.period,
                "multiplier": float(cycle.multipliers[0].real),
                "symmetric": lies_on(-cycle.gamma, curve_of(ball, cycle.gamma, cycle.period)),
            }
            for cycle in found.cycles
        ],
        "basins": found.basins,
    }


def _show(show: Show, done: int, name: str, part: float, words: str) -> None:
    show(done + part, f"{name}: {words}")
