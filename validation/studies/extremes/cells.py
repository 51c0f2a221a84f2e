"""The cells of a map: all integrators and values, or a few of them."""

from dataclasses import dataclass

import numpy as np

from robotball.engines.mujoco.integrators import ADAPTIVE, INTEGRATORS
from validation.studies.extremes.maps import Axis, Map
from validation.sweeps import Cell

QUICK_INTEGRATORS = ("Euler", "RK4", ADAPTIVE)
QUICK_COUNT = 3  # values of an axis
QUICK_DURATION = 10.0  # s, at most


@dataclass(frozen=True)
class Cut:
    """How much of the maps to run: all integrators and values, or a few."""

    integrators: tuple[str, ...] = tuple(INTEGRATORS)
    count: int | None = None

    def values(self, axis: Axis) -> tuple[float, ...]:
        """Those of the axis that are in the cut, its ends among them."""
        values = axis.values
        if self.count is None or self.count >= len(values):
            return values
        if "duration" in axis.label:
            values = tuple(v for v in values if v <= QUICK_DURATION)
        chosen = np.linspace(0, len(values) - 1, self.count).round().astype(int)
        return tuple(values[i] for i in np.unique(chosen))


WHOLE, QUICK = Cut(), Cut(QUICK_INTEGRATORS, QUICK_COUNT)


def cells_of(chosen: Map, cut: Cut = WHOLE) -> list[Cell]:
    """The cells of a map; those of one ball follow each other."""
    return [
        {"map": chosen.name, "rolling": rolling, "integrator": integrator, "x": x, "y": y}
        for rolling in chosen.rollings
        for integrator in cut.integrators
        for y in cut.values(chosen.y)
        for x in cut.values(chosen.x_of(integrator))
    ]
