"""The cost of work as a ratio to a bare loop of mj_step, taken in turn with it in one run.

A machine's speed wanders, and other work shares its caches: seconds are one machine's at one time.
The ratio of two neighbours in time is what lasts; seconds are derived from it.
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

_MINIMAL = PRESETS["accurate"]  # the model of the bare loop, on fig12
_STEPS = 250  # of it, at every turn

_Work = Callable[[], float]
"""Does a piece of work, set-up excluded, and returns its processor time [s]."""


@dataclass(frozen=True)
class Cost:
    """The cost of a piece of work, over rounds.

    ratios    of its processor time to the bare loop's of one simulated second, one a round
    baseline  s, processor time of the bare loop for one simulated second, the rounds' median
    """

    ratios: tuple[float, ...]
    baseline: float

    @property
    def ratio(self) -> float:
        """Return the rounds' median."""
        return statistics.median(self.ratios)

    @property
    def spread(self) -> tuple[float, float]:
        """Return the least and the largest of the rounds' ratios."""
        return min(self.ratios), max(self.ratios)

    @property
    def seconds(self) -> float:
        """Return the processor time [s] at the baseline's median speed."""
        return self.ratio * self.baseline

    def over(self, other: "Cost") -> "Cost":
        """Return the cost relative to another's of the same rounds, which becomes the baseline."""
        ratios = zip(self.ratios, other.ratios, strict=True)
        return Cost(tuple(ours / theirs for ours, theirs in ratios), other.seconds)


def bare_loop() -> float:
    """Return the processor time [s] of one simulated second of mj_step alone, unmonitored."""
    compiled = _baseline_model().compiled
    return one_step(compiled) / compiled.opt.timestep


@cache
def _baseline_model() -> Model:
    return build(load_scene("fig12"), _MINIMAL)


def one_step(compiled: mujoco.MjModel, steps: int = _STEPS) -> float:
    """Return the processor time of one mj_step [s], the mean of `steps` from the model's start."""
    data = mujoco.MjData(compiled)
    mujoco.mj_resetDataKeyframe(compiled, data, 0)
    # The thread's own time, as other threads of the process must not count.
    began = time.thread_time()
    for _ in range(steps):
        mujoco.mj_step(compiled, data)
    return measured_time((time.thread_time() - began) / steps)


def simulated_second(model: Model, times: Array) -> _Work:
    """Return the work of a simulated second of a run over `times` (n,) [s]: stepping, reading."""

    def work() -> float:
        motion = run(model, times)
        done = motion.report
        # A run that breaks off has stepped on to where it was looked at next.
        broken = len(motion.times) < len(times)
        return done.seconds / (done.steps * done.timestep if broken else float(times[-1]))

    return work


def measure_costs(
    works: Sequence[_Work], rounds: int = 5, show: Callable[[int], object] = lambda done: None
) -> list[Cost]:
    """Measure every work, all in turn, each between two bare loops; one round more warms up.

    show: called with the number of works done, of (rounds + 1) times as many.
    """
    ratios: list[list[float]] = [[] for _ in works]
    loops: list[float] = []
    before = bare_loop()
    for turn in range(rounds + 1):
        for i, work in enumerate(works):
            seconds, after = work(), bare_loop()
            # The first round brings code and data into the caches.
            if turn:
                loops.append(after)
                # By the mean of the loops on both sides, so that a machine that slows down evenly
                # cancels.
                ratios[i].append(2 * seconds / (before + after))
            before = after
            show(turn * len(works) + i + 1)
    baseline = statistics.median(loops)
    return [Cost(tuple(each), baseline) for each in ratios]
