"""Measure the cost of work, and the order of convergence of errors.

Costs are relative to a bare loop of mj_step in the same process, because seconds depend on the
machine, its speed, and other work. The ratio of two successive measurements is reproducible.

The order is the slope of a straight line through points (ln(step), ln(error)). Long steps, at which
the leading term does not dominate, and short steps, at which the error stalls, are left out.
"""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np

from robotball import PRESETS, load_scene
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import run
from robotball.motion import measured_time
from robotball.rotations import Array

_MINIMAL = PRESETS["accurate"]  # settings of the bare loop, on fig12
_LEAST = 3  # points of a line
_STALLED = 0.5  # errors stall if they fall with a lower power of the step than this
_SOUND = 5.0  # the line uses errors above this multiple of the stalled error
_STRAIGHT = 0.04  # largest root mean square distance of the points from a line, in ln(step)
_STEPS = 250  # steps of the bare loop per measurement

_Work = Callable[[], float]
"""Do a piece of work and return its processor time [s], without the set-up."""


@dataclass(frozen=True)
class Cost:
    """Cost of a piece of work.

    Attributes
    ----------
    ratios : tuple of float
        For each round, the processor time divided by the bare loop's time, for a simulated second.
    baseline : float, s
        The median processor time of a simulated second of the bare loop.
    """

    ratios: tuple[float, ...]
    baseline: float

    @property
    def ratio(self) -> float:
        """The median ratio."""
        return statistics.median(self.ratios)

    @property
    def spread(self) -> tuple[float, float]:
        """The smallest and the largest ratio."""
        return min(self.ratios), max(self.ratios)

    @property
    def seconds(self) -> float:
        """The processor time [s] at the median speed of the machine."""
        return self.ratio * self.baseline

    def over(self, other: "Cost") -> "Cost":
        """Return the cost relative to another cost of the same rounds, the new baseline."""
        ratios = zip(self.ratios, other.ratios, strict=True)
        return Cost(tuple(own / unit for own, unit in ratios), other.seconds)


def bare_loop() -> float:
    """Measure the processor time [s] of a simulated second of mj_step without a monitor."""
    compiled = _baseline_model().compiled
    return one_step(compiled) / compiled.opt.timestep


@cache
def _baseline_model() -> Model:
    return build(load_scene("fig12"), _MINIMAL)


def one_step(compiled: mujoco.MjModel, steps: int = _STEPS) -> float:
    """Measure the mean processor time of an mj_step [s] over the first `steps` of a model."""
    data = mujoco.MjData(compiled)
    mujoco.mj_resetDataKeyframe(compiled, data, 0)
    # Thread time excludes the other threads of the process.
    began = time.thread_time()
    for _ in range(steps):
        mujoco.mj_step(compiled, data)
    return measured_time((time.thread_time() - began) / steps)


def simulated_second(model: Model, times: Array) -> _Work:
    """Return the work of a simulated second of a run over `times` (n,) [s], with its readings."""

    def work() -> float:
        motion = run(model, times)
        report = motion.report
        # A run that fails has continued up to the next sample time.
        broken = len(motion.times) < len(times)
        return report.seconds / (report.steps * report.timestep if broken else float(times[-1]))

    return work


def measure_costs(
    works: Sequence[_Work], rounds: int = 5, show: Callable[[int], object] = lambda done: None
) -> list[Cost]:
    """Measure all works in each round, every work between two bare loops, after a warm-up.

    `show` is called with the number of works done, out of (rounds + 1) * len(works).
    """
    ratios: list[list[float]] = [[] for _ in works]
    loops: list[float] = []
    before = bare_loop()
    for turn in range(rounds + 1):
        for i, work in enumerate(works):
            seconds, after = work(), bare_loop()
            if turn:  # the first round fills the caches
                loops.append(after)
                # The mean of the loops before and after cancels a linear drift of the speed.
                ratios[i].append(2 * seconds / (before + after))
            before = after
            show(turn * len(works) + i + 1)
    baseline = statistics.median(loops)
    return [Cost(tuple(rounds_of_work), baseline) for rounds_of_work in ratios]


@dataclass(frozen=True)
class Order:
    """Power law error ~ stepᵒʳᵈᵉʳ.

    Attributes
    ----------
    order, stderr : float
        The order and its standard error.
    ln_step, ln_error : float
        The middle of the line.
    shortest, longest : float
        The range of the steps.
    points : int
        The number of points of the line.
    """

    order: float
    stderr: float
    ln_step: float
    ln_error: float
    shortest: float
    longest: float
    points: int

    def error_at(self, step: Array) -> Array:
        """Return the error on the line at steps (n,), of shape (n,)."""
        return np.exp(self.ln_error + self.order * (np.log(step) - self.ln_step))


def fit_order(
    steps: Sequence[float], errors: Sequence[float | None], floor: float = 0.0
) -> Order | None:
    """Fit the order over the longest straight part of the errors. None if there is no such part.

    Parameters
    ----------
    steps : (n,)
        Positive steps in any order and unit.
    errors : (n,)
        The errors; None for a run that failed.
    floor : float
        The uncertainty of the errors; smaller errors are ignored.
    """
    h, e = _sound(steps, errors)
    # Near the stall the errors fall more slowly than the power law.
    clear = e > max(floor, _SOUND * (stalled_at(steps, errors) or 0.0))
    x, y = np.log(h[clear]), np.log(e[clear])
    # The longest straight part, not the straightest part: any two points are on a line.
    for length in range(len(x), _LEAST - 1, -1):
        # Try parts with short steps first, because there the leading term dominates.
        for begin in range(len(x) - length, -1, -1):
            part = slice(begin, begin + length)
            if (line := _fitted_line(x[part], y[part])) is not None:
                return line
    return None


def stalled_at(steps: Sequence[float], errors: Sequence[float | None]) -> float | None:
    """Return the smallest error at which the errors stop falling; None if they never stop."""
    h, e = _sound(steps, errors)
    for i in range(len(h) - 1):
        if np.all(e[i + 1 :] > e[i] * (h[i + 1 :] / h[i]) ** _STALLED):
            return float(e[i:].min())
    return None


def _sound(steps: Sequence[float], errors: Sequence[float | None]) -> tuple[Array, Array]:
    """Return steps, the longest first, and errors, of complete runs with a nonzero error."""
    pairs = ((h, e) for h, e in zip(steps, errors, strict=True) if e and np.isfinite(e))
    h, e = np.array(sorted(pairs, reverse=True)).reshape(-1, 2).T
    return h, e


def _fitted_line(x: Array, y: Array) -> Order | None:
    """Return the least-squares line if it rises and the points are near it."""
    if x[0] == x[-1]:  # a single step has no slope
        return None
    (slope, height), covariance = np.polyfit(x, y, 1, cov=True)
    off = np.sqrt(np.mean((y - slope * x - height) ** 2))
    # Dividing by the slope converts the distance to ln(step), so one bound serves all orders.
    if slope < _STALLED or off > _STRAIGHT * slope:
        return None
    stderr = float(np.sqrt(covariance[0, 0]))
    ends = float(np.exp(x.min())), float(np.exp(x.max()))
    return Order(float(slope), stderr, float(x.mean()), float(y.mean()), *ends, len(x))
