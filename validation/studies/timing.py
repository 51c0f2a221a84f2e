"""Cost of work relative to a bare loop of mj_step, measured alternately in one process.

Seconds depend on the machine, its current speed, and other work on it. The ratio of two successive
measurements is reproducible, and seconds are derived from this ratio.
"""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import mujoco

from robotball import PRESETS, load_scene
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import run
from robotball.motion import measured_time
from robotball.rotations import Array

_MINIMAL = PRESETS["accurate"]  # settings of the bare loop, on fig12
_STEPS = 250  # steps of the bare loop per measurement

_Work = Callable[[], float]
"""Do a piece of work and return its processor time [s], without the set-up."""


@dataclass(frozen=True)
class Cost:
    """Cost of a piece of work.

    Attributes
    ----------
    ratios : tuple of float
        For each round, the processor time over the bare loop's time of a simulated second.
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
        # A run that breaks off has continued up to the next sample time.
        broken = len(motion.times) < len(times)
        return report.seconds / (report.steps * report.timestep if broken else float(times[-1]))

    return work


def measure_costs(
    works: Sequence[_Work], rounds: int = 5, show: Callable[[int], object] = lambda done: None
) -> list[Cost]:
    """Measure all works in each round, each between two bare loops, after a warm-up round.

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
