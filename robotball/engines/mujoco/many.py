"""Many runs at once: by MuJoCo's own threads, or in processes.

Where controls keep their values a run is nothing but steps, and the threads of `mujoco.rollout`
take those of many starts while the runs before are monitored from their rows. A drive that changes
calls Python at every step, which threads would wait for, and scenes that differ in more than the
start are built one by one: these go to processes. A motion is that of `run` to the last bit.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import groupby
from time import perf_counter

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from robotball.engines.mujoco.limits import check_length
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.run import Record, monitored, recorded, run
from robotball.engines.mujoco.settings import Settings
from robotball.engines.mujoco.stepping import Portion, is_plain, stretches
from robotball.motion import ContactMotion, FaultKind
from robotball.processes import allowed, in_processes
from robotball.rotations import Array
from robotball.scene import Scene

_BYTES = 2e7  # of the rows that threads write at once, twice: a dozen runs of 2000 steps
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
# MuJoCo's threads stop a run that is warned of, without a word: its rows repeat the last one.
_STOPPED = {FaultKind.DIVERGED, FaultKind.RESET, FaultKind.ENGINE_WARNED}


@dataclass(frozen=True)
class _Alone:
    """Scene → its motion at times (n,) [s], in any process."""

    settings: Settings
    times: Array

    def __call__(self, scene: Scene) -> ContactMotion:
        return run(build(scene, self.settings), self.times)


def run_many(scenes: Sequence[Scene], settings: Settings, times: Array) -> Iterator[ContactMotion]:
    """Yield the motions of scenes at times (n,) [s] from 0, in their order.

    Raises InputError as `build` and `run` do.
    """
    alone = _Alone(settings, times)
    first = build(scenes[0], settings)
    check_length(first.scene, first.settings, times)
    rolling = _Rolling(first, times)
    if rolling.size >= allowed() and all(map(rolling.takes, scenes)):
        yield from _in_threads(rolling, scenes, alone)
        return
    yield from in_processes(alone, scenes, or_here=True)


def _in_threads(
    rolling: "_Rolling", scenes: Sequence[Scene], alone: _Alone
) -> Iterator[ContactMotion]:
    """Yield the motions of scenes that the threads take."""
    first, threads = rolling.model, allowed()
    data = [mujoco.MjData(first.compiled) for _ in range(threads)]
    ahead = deque[tuple[Sequence[Scene], list[Model | None], Future[tuple[Array, float]]]]()

    def motions() -> Iterator[ContactMotion]:
        some, models, future = ahead.popleft()
        rows, seconds = future.result()
        left = iter(rows)
        for scene, model in zip(some, models, strict=True):
            yield (model and rolling.motion(model, next(left), seconds)) or alone(scene)

    with Rollout(nthread=threads) as pool, ThreadPoolExecutor(1) as beside:
        for i in range(0, len(scenes), rolling.size):
            some = scenes[i : i + rolling.size]
            models = [first.started(each) for each in some]
            future = beside.submit(rolling.rows, pool, data, [*filter(None, models)])
            ahead.append((some, models, future))
            if len(ahead) > 1:
                yield from motions()
        yield from motions()


class _Rolling:
    """How runs of a model from several starts are stepped together.

    size: how many at once; groups: consecutive steps of one length [s], and their number, with one
    more at the end, as sensors are those of the state before a step.
    """

    def __init__(self, model: Model, times: Array) -> None:
        self.model, self.times, compiled = model, times, model.compiled
        self.parts = [*stretches(times, model.scene.breakpoints, compiled.opt.timestep)]
        each = [(length, count) for part in self.parts for _, length, count in part]
        grouped = groupby(each, key=lambda some: some[0])
        self.groups = [(length, sum(n for _, n in some)) for length, some in grouped]
        self.groups[-1] = (self.groups[-1][0], self.groups[-1][1] + 1)
        steps = sum(count for _, count in self.groups)
        self.size = int(_BYTES / (8 * steps * compiled.nsensordata))

    def takes(self, scene: Scene) -> bool:
        """Return whether a scene is that of the model but for its start, and a run steps alone."""
        settings = self.model.settings
        # The guess from which a solver starts is no part of the state between two groups.
        guesses = settings.warmstart != "disable" and len(self.groups) > 1
        same = replace(scene, start=self.model.scene.start) == self.model.scene
        return same and not settings.adaptive and not guesses and is_plain(self.model)

    def rows(
        self, pool: Rollout, data: list[mujoco.MjData], models: list[Model]
    ) -> tuple[Array, float]:
        """Return the sensors (b, steps + 1, n) of b runs, and the processor time of each [s]."""
        if not models:
            return np.empty(0), 0.0
        began, compiled = perf_counter(), [each.compiled for each in models]
        state = np.empty((len(models), mujoco.mj_stateSize(compiled[0], _STATE)))
        for model, place in zip(models, state, strict=True):
            mujoco.mj_getState(model.compiled, model.start_data(), place, _STATE)
        control = compiled[0].key_ctrl[0] if compiled[0].nu else None
        rows = []
        for length, count in self.groups:
            for each in compiled:
                each.opt.timestep = length
            states, sensors = pool.rollout(compiled, data, state, control, nstep=count)
            state = states[:, -1]
            rows.append(sensors)
        busy = min(len(data), len(models))
        return np.concatenate(rows, axis=1), (perf_counter() - began) * busy / len(models)

    def motion(self, model: Model, sensors: Array, seconds: float) -> ContactMotion | None:
        """Return the motion of a run's sensors (steps + 1, n); None where the threads stopped."""
        record = Record(keeps_window=False, seconds=seconds)
        readings = monitored(model, self.times, self._portions(sensors), record)
        motion = recorded(self.times, readings, record)
        return None if _STOPPED & {kind for kind, _ in record.faults} else motion

    def _portions(self, sensors: Array) -> Iterator[Portion]:
        rows = np.zeros((len(sensors), sensors.shape[1] + int(mujoco.mjtWarning.mjNWARNING)))
        rows[:, : sensors.shape[1]] = sensors
        begin = 0
        for part in self.parts:
            count, samples = int(part.counts.sum()), part.samples
            end = begin + count
            if part is self.parts[-1]:
                samples, end = np.append(samples, count), end + 1
            longest = float(part.lengths.max())
            yield Portion(rows[begin:end], samples, count, longest, again=list)
            begin = end
