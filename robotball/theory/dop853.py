"""Integrate differential equations: DOP853 with compensated summation.

The method is DOP853 (Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, II.5),
with its table in dop853.csv, scipy's step control, and compensated (Kahan) summation of the state.
At the least tolerance, the error of a step is smaller than the rounding error of adding the step to
the state. These rounding errors must therefore not accumulate. scipy's solver is not used, because
it evaluates each stage from Python, which takes longer than the compiled equations.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from robotball.errors import InputError, too_many_steps
from robotball.motion import Progress
from robotball.rotations import Array

Rate = Callable[[float, Array], Array]
# (times (s,), length [s], weights (s, n), base, displacement, slopes) -> the last displacement.
# Appends the slopes at s stages of a step to the earlier slopes. Each is the slope at the state
# base + displacement + length·weights@slopes.
Stages = Callable[[Array, float, Array, Array, Array, Array], Array]
# `progress` is called when the number of steps, times the length of the state, reaches this: every
# tenth of a second for most robots, and every step or two for a robot with hundreds of hinges.
_SHOWN = 2000
LEAST_RTOL = 1e-15  # relative error of one step; a smaller value would only cost more steps

# Relative error allowed in the displacement of a step, which is small compared with the state.
_OF_DISPLACEMENT = 100 * float(np.finfo(float).eps)
STAGES = 12  # stages after the begin of a step; the last stage is at the end of the step
# Each row of the table has a node and 16 weights. The rows are for the stages of a step, for three
# further stages of the interpolant, for the errors of orders 5 and 3, and for four coefficients of
# the interpolant.
_TABLE = np.loadtxt(Path(__file__).with_suffix(".csv"), delimiter=",")
NODES, WEIGHTS = _TABLE[:STAGES, 0].copy(), _TABLE[:STAGES, 1 : STAGES + 1].copy()
MORE_NODES, MORE = _TABLE[STAGES:15, 0].copy(), _TABLE[STAGES:15, 1:].copy()
_ERRORS, INTERPOLANT = _TABLE[15:17, 1 : STAGES + 2], _TABLE[17:, 1:]
_SAFETY, _LEAST, _MOST, _EXPONENT = 0.9, 0.2, 10.0, -1 / 8  # for the length of the next step


def one_by_one(
    rate: Rate, times: Array, step: float, weights: Array, base: Array, begin: Array, slopes: Array
) -> Array:
    """Compute the stages, as `Stages` does, for a derivative that takes a time and a state."""
    displacement, first = begin, len(slopes) - len(times)
    for s, (t, row) in enumerate(zip(times.tolist(), weights, strict=True), start=first):
        displacement = begin + np.dot(slopes[:s].T, row[:s]) * step
        slopes[s] = rate(t, base + displacement)
    return displacement


@dataclass
class Compensated:
    """Adaptive integration from a state (n,) at t to `end` [s].

    DOP853 integrates the displacement from a base. Before every step the displacement is added to
    the base, and the next displacement begins with the rounding error of the sum. `t`, `state` and
    `derivative` (n,) are the current values.

    Attributes
    ----------
    stages : callable
        The derivative at the stages of a step.
    rtol : float
        The error of a step in each number of the state is at most rtol times the sum of the
        number's scale and absolute value.
    scale : (n,)
        The scales of the numbers in the state.
    longest : float, s
        The longest allowed step.
    next_step : float, s
        The length of the next trial step, which follows from the error of the last step. It grows
        at most tenfold.
    """

    stages: Stages
    t: float
    end: float
    state: Array
    rtol: float
    scale: Array
    longest: float = np.inf
    next_step: float = 100 * 1e-6  # scipy's rule for a displacement of zero

    def __post_init__(self) -> None:
        self._base = self.state = np.array(self.state, dtype=float)
        self._displacement = np.zeros_like(self.state)
        self._slopes = np.empty((STAGES + 1 + len(MORE), len(self.state)))
        self.derivative = self._slopes[STAGES]
        first = np.array([self.t]), 0.0, np.empty((1, 0))
        self.stages(*first, self._base, self._displacement, self.derivative[None])

    def step(self) -> str | None:
        """Take a step. Returns None, or the reason why this was impossible."""
        t, slopes, base = self.t, self._slopes[: STAGES + 1], self.state
        # The last slope stays valid, because the sum of base and displacement is still the same.
        begin, slopes[0] = self._displacement + (self._base - base), self.derivative
        self._base, tolerance = base, self.rtol * (self.scale + np.abs(base))
        shortest, most = 10 * float(np.spacing(t)), _MOST
        length = max(min(self.next_step, self.longest), shortest)
        while length >= shortest:
            new = min(t + length, self.end)
            length = new - t
            end = self.stages(t + NODES * length, length, WEIGHTS, base, begin, slopes)
            allowed = tolerance + np.maximum(np.abs(begin), np.abs(end)) * _OF_DISPLACEMENT
            sums = [np.dot(slopes.T, weights) / allowed for weights in _ERRORS]
            fifth, third = (np.sqrt(np.dot(errors, errors)) ** 2 for errors in sums)
            error = float(length * fifth / (np.sqrt((fifth + 0.01 * third) * len(base)) or 1.0))
            factor = _SAFETY * error**_EXPONENT if error else _MOST
            if error < 1:
                self._last, self._inside = (t, length, begin), list[Array]()
                self.t, self._displacement, self.state = new, end, base + end
                self.next_step = length * min(most, factor)
                return None
            length, most = length * max(_LEAST, factor), 1.0
        return "the tolerance needs steps below the spacing of floating-point numbers"

    def within(self, times: Array) -> Array:
        """Return states (m, n) at times (m,) in the last step."""
        (began, length, begin), slopes = self._last, self._slopes
        change = self._displacement - begin
        if len(times) == 1 and times[0] == self.t:  # here the interpolant has the state's value
            return (self._base + (change + begin))[None]
        if not self._inside:
            self.stages(began + MORE_NODES * length, length, MORE, self._base, begin, slopes)
            more = length * np.dot(INTERPOLANT, slopes)
            curve = length * (self.derivative + slopes[0])
            self._inside = [*more[::-1], 2 * change - curve, length * slopes[0] - change, change]
        part, displacements = ((times - began) / length)[:, None], np.zeros((len(times), 1))
        for i, coefficient in enumerate(self._inside):
            displacements = (displacements + coefficient) * (1 - part if i % 2 else part)
        return self._base + (displacements + begin)


class Steps(Protocol):
    """Steps along a motion, with `Compensated` or with another method."""

    t: float
    state: Array
    derivative: Array
    next_step: float

    def step(self) -> str | None:
        """Take a step. Returns None, or the reason why this was impossible."""

    def within(self, times: Array) -> Array:
        """Return states (m, n) at times (m,) in the last step."""


def take_step(
    solver: Steps, taken: int, most: int, end: float, progress: Progress | None = None
) -> int:
    """Take a step of a ball whose state begins with its quaternion. Return the number of steps.

    taken: the number of steps so far; most: the number allowed up to `end` [s]; progress: called
    from time to time with the fraction of `end` that is reached. Raises InputError if no more steps
    are allowed, or if a step becomes too short.
    """
    if taken >= most:
        speed = 2 * float(np.linalg.norm(solver.derivative[:4]))  # dq/dt = q∘ω/2
        raise too_many_steps(most, solver.t, end, speed)
    if why := solver.step():
        raise InputError(f"the equations could not be integrated past t = {solver.t:g} s: {why}")
    if progress is not None and taken % max(1, _SHOWN // len(solver.state)) == 0:
        progress(solver.t / end)
    return taken + 1
