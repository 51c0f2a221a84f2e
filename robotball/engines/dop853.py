"""DOP853 of scipy with compensated summation of the state.

Steps of the least tolerance err by less than rounding does when they are added. Kahan's summation
keeps that rounding from growing with the number of steps.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from robotball.rotations import Array

Rate = Callable[[float, Array], Array]
LEAST_RTOL = 1e-15  # of one step, relative; a smaller one only makes more steps
OF_DISPLACEMENT = 100 * float(np.finfo(float).eps)  # the least that scipy takes without a warning


class Compensated:
    """A motion from a state (n,) over a span of time, in steps of an error held to a tolerance.

    rate(t, state) is its derivative. A step's error in each number is held to rtol times its
    scale (n,) and its size; max_step is the longest step. DOP853 integrates the displacement from
    a base. Before every step it is added to the base, and the next displacement begins at the part
    that rounding cut off the sum (Kahan).
    """

    def __init__(
        self,
        rate: Rate,
        span: Sequence[float],
        state: Array,
        rtol: float,
        scale: Array,
        max_step: float = np.inf,
    ) -> None:
        self._base = np.array(state, dtype=float)
        self._rtol, self._scale = rtol, scale
        self._inside: Any = None
        solver: Any = DOP853  # its types want complex functions and a float atol
        self._solver = solver(
            lambda t, displacement: rate(t, self._base + displacement),
            span[0],
            np.zeros_like(self._base),
            span[1],
            max_step=max_step,
            rtol=OF_DISPLACEMENT,
            atol=self._tolerance,
        )

    @property
    def t(self) -> float:
        return float(self._solver.t)

    @property
    def running(self) -> bool:
        """Whether the end of the span is not reached yet."""
        return self._solver.status == "running"

    @property
    def state(self) -> Array:
        """The state (n,) at time `t`."""
        return self._base + self._solver.y

    @property
    def derivative(self) -> Array:
        """The derivative (n,) of the state at time `t`."""
        return np.array(self._solver.f)

    @property
    def _tolerance(self) -> Array:
        """The absolute error (n,) that a step may make."""
        return self._rtol * (self._scale + np.abs(self._base))

    def step(self) -> str | None:
        """Take a step. Returns scipy's message where that fails, else None."""
        displacement, before = self._solver.y, self._base
        self._base = before + displacement
        displacement += before - self._base
        self._solver.atol, self._inside = self._tolerance, None
        message: str | None = self._solver.step()
        return message

    def within(self, times: Array) -> Array:
        """Return states (m, n) at times (m,) in the last step."""
        if self._inside is None:
            self._inside = self._solver.dense_output()  # takes three more evaluations
        displacements: Array = self._inside(times).T
        return self._base + displacements
