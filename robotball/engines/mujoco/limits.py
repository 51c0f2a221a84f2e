"""A limit of a run, and how near to it the run is."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robotball.engines.mujoco.planned_run import PlannedRun


@dataclass(frozen=True)
class LimitCheck:
    """A number of a planned run beside the limit beyond which the run is predicted to fail.

    what   the number, named; value and limit are in `unit`
    least  whether the limit is the least that the value may be, and not the most
    fix    what to change
    """

    what: str
    value: float
    limit: float
    fix: str
    unit: str = ""
    least: bool = False

    @property
    def nearness(self) -> float:
        """How much of the limit is used: 1 is at the limit, more is beyond it."""
        over, under = (self.limit, self.value) if self.least else (self.value, self.limit)
        if np.isnan(over) or np.isnan(under):
            return np.inf
        if under == 0:
            return np.inf if over > 0 else 0.0
        return float(over / under)

    @property
    def exceeded(self) -> bool:
        return self.nearness > 1

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        bound = "least" if self.least else "most"
        return (
            f"{self.what} is {self.value:.4g}{unit}, and {self.limit:.4g}{unit} the {bound} "
            f"that works: {self.fix}"
        )


Prediction = Callable[[PlannedRun], LimitCheck | None]
"""A planned run beside one limit; None where the limit does not concern it."""
Laws = dict[Prediction, str]
