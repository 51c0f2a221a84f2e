"""The ball made ready in an engine of another package, and marched over its sample times."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator

import numpy as np

from robotball.engines.links import State, start_state
from robotball.engines.spans import spans
from robotball.errors import InputError
from robotball.rotations import Array
from robotball.scene import Scene

IDLE_STEPS = 200  # of Python's part that are timed


class World(ABC):
    """A ball in an engine, at its start; what it takes to make one is set-up.

    steps, longest [s]: taken so far.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene, self.now = scene, start_state(scene)
        self.steps, self.longest = 0, 0.0

    @abstractmethod
    def march(self, times: Array, timestep: float) -> Iterator[State]:
        """The states at sample times (n,) after the first, in steps of `timestep` at most [s]."""

    @abstractmethod
    def python_seconds(self) -> float:
        """Processor time of what Python did in all steps so far [s]."""

    def stretches(
        self, times: Array, timestep: float
    ) -> Iterator[tuple[float, float, int, float | None]]:
        """The steps that lead over sample times (n,) and breakpoints, `timestep` long at most [s].

        Of each stretch of equal ones its begin [s], their length [s] and number, and the sample
        time that it ends at, if it does. Counts them as taken.
        """
        sampled = set(times.tolist())
        cut = spans(times, self.scene.breakpoints, timestep)
        for (begin, end), length, count in zip(*(each.tolist() for each in cut), strict=True):
            self.steps, self.longest = self.steps + int(count), max(self.longest, length)
            yield begin, length, int(count), end if end in sampled else None


class SteppedWorld(World):
    """An engine that Python steps, one call a step."""

    any_step = False  # whether the steps of one world may differ in length

    @abstractmethod
    def control(self, t: float, step: float) -> None:
        """Sets the hinges' motors for a step that begins at t [s]; called where rates change."""

    @abstractmethod
    def step(self, step: float) -> None:
        """One step of the engine [s]."""

    @abstractmethod
    def state(self) -> State:
        """Where the ball is now."""

    def march(self, times: Array, timestep: float) -> Iterator[State]:
        lengths = spans(times, self.scene.breakpoints, timestep)[1]
        if not self.any_step and not np.allclose(lengths, lengths[0], rtol=1e-9, atol=0.0):
            raise InputError(
                f"{self.scene.name}: this engine's steps are all equal, and they have to end on "
                "every sample and wherever a rate breaks: sample it at equal intervals that do"
            )
        for begin, length, count, sample in self.stretches(times, timestep):
            self._loop(self.step, begin, length, count)
            if sample is not None:
                yield self.state()

    def python_seconds(self) -> float:
        count = min(IDLE_STEPS, self.steps)
        began = time.process_time()
        self._loop(_no_step, 0.0, self.longest, count)
        return (time.process_time() - began) / count * self.steps

    def _loop(self, take: Callable[[float], None], begin: float, step: float, count: int) -> None:
        if self.scene.steady:
            for _ in range(count):
                take(step)
            return
        for i in range(count):
            self.control(begin + i * step, step)
            take(step)


def _no_step(_: float) -> None:
    return
