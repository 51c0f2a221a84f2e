"""Integrate differential equations: DOP853 with compensated summation, and steps of RK4.

The integrator is scipy's DOP853 (Hairer, Nørsett and Wanner, Solving Ordinary Differential
Equations I, II.5) with compensated summation of the state (Kahan): at the least tolerance a step
errs by less than rounding does when steps are added up, and that rounding must not grow with their
number.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from robotball.engines import Progress
from robotball.errors import InputError, too_many_steps
from robotball.rotations import Array

Rate = Callable[[float, Array], Array]
_SHOWN = 200  # steps, a tenth of a second's, between two calls of `progress`
LEAST_RTOL = 1e-15  # of one step, relative; a smaller one only makes more steps

# scipy takes no smaller one without a warning. It multiplies the displacement of a single step,
# where it weighs nothing beside the tolerance by the whole state.
_OF_DISPLACEMENT = 100 * float(np.finfo(float).eps)


class Compensated:
    """A motion from a state (n,) over a span of time, in steps whose error is held to a tolerance.

    rate(t, state) is its derivative. A step's error in each number is held to rtol times the sum of
    its scale (n,) and its size; max_step is the longest step, first_step the one that is tried
    first, by the derivative's size if None. DOP853 integrates the displacement
    from a base. Before every step it is added to the base, and the next displacement begins at the
    part that rounding cut off the sum.
    """

    def __init__(
        self,
        rate: Rate,
        span: Sequence[float],
        state: Array,
        rtol: float,
        scale: Array,
        max_step: float = np.inf,
        first_step: float | None = None,
    ) -> None:
        self._base = np.array(state, dtype=float)
        self._rtol, self._scale = rtol, scale
        self._inside: Any = None
        solver: Any = DOP853  # its types want complex functions and a float atol
        self._solver = solver(
            # Of plain numbers drives are computed faster than of NumPy's.
            lambda t, displacement: rate(float(t), self._base + displacement),
            span[0],
            np.zeros_like(self._base),
            span[1],
            max_step=max_step,
            first_step=first_step,
            rtol=_OF_DISPLACEMENT,
            atol=self._tolerance,
        )

    @property
    def t(self) -> float:
        return float(self._solver.t)

    @property
    def next_step(self) -> float:
        """The length [s] of the next step by the error of the last one."""
        return float(self._solver.h_abs)

    @property
    def running(self) -> bool:
        """True until the end of the span is reached."""
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
        # In place, as scipy goes on from its own array. The slope that it keeps stays right: base
        # and displacement still add up to the same state.
        displacement += before - self._base
        # The tolerance goes with the state, and scipy's own rtol would take it from the
        # displacement.
        self._solver.atol, self._inside = self._tolerance, None
        return message if (message := self._solver.step()) is None else str(message)

    def within(self, times: Array) -> Array:
        """Return states (m, n) at times (m,) in the last step."""
        if len(times) == 1 and times[0] == self.t:  # what the interpolant is there
            before = self._solver.y_old
            return np.asarray(self._base + (self._solver.y - before + before))[None]
        if self._inside is None:
            self._inside = self._solver.dense_output()  # takes three more evaluations
        return np.asarray(self._base + self._inside(times).T)


def take_step(
    solver: Compensated, taken: int, most: int, end: float, progress: Progress | None = None
) -> int:
    """Take a step of a ball whose state begins with its quaternion. Returns the steps so far.

    taken, most: the steps before this one, and those allowed up to `end` [s]; progress: called now
    and then with the fraction of `end` that is reached. Raises InputError where the steps are used
    up, or where one shrinks to nothing.
    """
    if taken >= most:
        speed = 2 * float(np.linalg.norm(solver.derivative[:4]))  # dq/dt = q∘ω/2
        raise too_many_steps(most, solver.t, end, speed)
    if (message := solver.step()) is not None:
        raise InputError(
            f"the equations could not be integrated past t = {solver.t:g} s: {message}"
        )
    if progress is not None and taken % _SHOWN == 0:
        progress(solver.t / end)
    return taken + 1


def rk4(rate: Rate, t: float, y: Array, h: float) -> Array:
    """Return the state after a step of the classical Runge-Kutta method from y at t, h long [s]."""
    k1 = rate(t, y)
    k2 = rate(t + h / 2, y + h / 2 * k1)
    k3 = rate(t + h / 2, y + h / 2 * k2)
    k4 = rate(t + h, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
