"""Many runs of one scene, from one start after another, on all cores.

Where the controls keep their values a run is nothing but steps, and MuJoCo's own threads
(`mujoco.rollout`) take those of many runs at once; each run is monitored meanwhile from its rows.
A drive that changes calls Python at every step, which threads would wait for, so such runs go to
processes. Either way a motion is that of `run` to the last bit, and one with a fault is that run's.
"""

import pickle
import time
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from robotball.engines.mujoco.limits import check_length
from robotball.engines.mujoco.model import Model, build, hinges_of
from robotball.engines.mujoco.readings import Readings
from robotball.engines.mujoco.run import Record, monitored, recorded, run
from robotball.engines.mujoco.settings import Settings
from robotball.engines.mujoco.stepping import Portion, Stretch, is_plain, stretches
from robotball.motion import ContactMotion
from robotball.processes import allowed, in_processes
from robotball.rotations import Array
from robotball.scene import Scene, Start

_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
_BYTES = 64e6  # of the rows that are held at once, twice: some hundred runs of 10 s


@dataclass(frozen=True)
class _Alone:
    """A run from a start, in any process."""

    scene: Scene
    settings: Settings
    times: Array

    def __call__(self, start: Start) -> ContactMotion:
        return run(build(replace(self.scene, start=start), self.settings), self.times)


def run_many(
    scene: Scene, settings: Settings, times: Array, starts: Sequence[Start]
) -> Iterator[ContactMotion]:
    """Yield the motions at times (n,) [s] from 0 from each start, in their order.

    Raises InputError as `build` and `run` do.
    """
    alone = _Alone(scene, settings, times)
    first = build(replace(scene, start=starts[0]), settings)
    check_length(first.scene, first.settings, times)
    if not _in_threads(first):
        yield from in_processes(alone, starts) if _goes_elsewhere(alone) else map(alone, starts)
        return
    threads, parts = allowed(), [*_stretches(first, times)]
    steps = max(int(each.counts.sum()) for each in parts)
    size = max(threads, int(_BYTES / (8 * (steps + 1) * first.compiled.nsensordata)))
    data = [mujoco.MjData(first.compiled) for _ in range(threads)]
    with Rollout(nthread=threads) as pool, ThreadPoolExecutor(1) as beside:
        waiting: deque[tuple[_Batch, Future[_Rolled]]] = deque()
        for i in range(0, len(starts), size):
            batch = _Batch(alone, first, starts[i : i + size], data)
            for part in parts:
                waiting.append((batch, beside.submit(batch.roll, pool, part, part is parts[-1])))
                # While the threads are at this part, the one before is looked at.
                if len(waiting) > 1:
                    yield from _looked_at(*waiting.popleft())
        yield from _looked_at(*waiting.popleft())


def _in_threads(model: Model) -> bool:
    """Return whether MuJoCo's threads can run a model: by steps alone that start from no guess."""
    settings = model.settings
    return not settings.adaptive and settings.warmstart == "disable" and is_plain(model)


def _goes_elsewhere(work: _Alone) -> bool:
    """Return whether work can be done in another process, which no function of a user's can."""
    try:
        return bool(pickle.dumps(work))
    except (pickle.PicklingError, AttributeError, TypeError):
        return False


def _stretches(model: Model, times: Array) -> Iterator[Stretch]:
    return stretches(times, model.scene.breakpoints, model.compiled.opt.timestep)


@dataclass(frozen=True)
class _Rolled:
    """The rows (b, m, columns of Readings) of a stretch of b runs, as a Portion has them.

    last: whether the runs end with it; seconds: of a processor's time for each run.
    """

    rows: Array
    stretch: Stretch
    last: bool
    seconds: float


class _Batch:
    """Runs that are stepped together, each by an MjModel with its own start."""

    def __init__(
        self, alone: _Alone, first: Model, starts: Sequence[Start], data: list[mujoco.MjData]
    ) -> None:
        self.runs, self.data = [_Run(alone, first, start) for start in starts], data
        self.models = [each.model.compiled for each in self.runs]
        self.states = np.empty((len(starts), mujoco.mj_stateSize(first.compiled, _STATE)))
        for model, state in zip(self.models, self.states, strict=True):
            mujoco.mj_resetDataKeyframe(model, data[0], 0)
            mujoco.mj_getState(model, data[0], state, _STATE)

    def roll(self, pool: Rollout, stretch: Stretch, last: bool) -> _Rolled:
        """Step all runs over a stretch."""
        began, count = time.perf_counter(), int(stretch.counts.sum())
        columns = self.models[0].nsensordata + len(self.data[0].warning.number)
        rows = np.zeros((len(self.runs), count + last, columns))
        done = 0
        for _, length, steps in stretch:
            self.states = self._step(pool, length, rows[:, done : done + steps])
            done += steps
        if last:  # sensors are those of the state before a step
            self._step(pool, length, rows[:, done:])
        threads = min(len(self.data), len(self.runs))
        seconds = (time.perf_counter() - began) * threads / len(self.runs)
        return _Rolled(rows, stretch, last, seconds)

    def _step(self, pool: Rollout, length: float, rows: Array) -> Array:
        """Fill rows (b, m, columns) by m steps of a length [s], and return the states after."""
        (b, m, _), (model, *_) = rows.shape, self.models
        for each in self.models:
            each.opt.timestep = length
        control = np.tile(model.key_ctrl[0], (b, m, 1)) if model.nu else None
        states, sensors = (
            np.empty((b, m, self.states.shape[1])),
            np.empty((b, m, model.nsensordata)),
        )
        pool.rollout(
            self.models, self.data, self.states, control,
            skip_checks=True, nstep=m, state=states, sensordata=sensors,
        )  # fmt: skip
        rows[:, :, : model.nsensordata] = sensors
        return np.ascontiguousarray(states[:, -1])


class _Run:
    """A run of a batch: its model, and what has been read of it so far."""

    def __init__(self, alone: _Alone, first: Model, start: Start) -> None:
        scene = replace(alone.scene, start=start)
        # A start at an angle may turn a hinge that the first one's model has not.
        self.apart = hinges_of(scene, first.settings) != first.hinges
        self.model = first.started(first.scene if self.apart else scene)
        self.alone, self.start = alone, start
        self.record, self.portions = Record(keeps_window=False), deque[Portion | None]()
        stream = iter(self.portions.popleft, None)
        self.stream = monitored(self.model, alone.times, stream, self.record)
        self.readings: list[Readings] = []

    def look(self, rolled: _Rolled, rows: Array) -> None:
        """Read a stretch's rows (m, columns)."""
        if self.apart:
            return
        samples, steps = rolled.stretch.samples, len(rows) - rolled.last
        if rolled.last:
            samples = np.append(samples, steps)
        longest = float(rolled.stretch.lengths.max())
        self.portions.append(Portion(rows, samples, steps, longest, again=list))
        self.readings.append(next(self.stream))
        self.record.seconds += rolled.seconds
        # MuJoCo's threads stop a run that is warned of, and say no more of it.
        self.apart = bool(self.record.faults)

    def motion(self) -> ContactMotion:
        """Return the motion, once all is read."""
        if self.apart:
            return self.alone(self.start)
        return recorded(self.alone.times, self.readings, self.record)


def _looked_at(batch: _Batch, rolling: Future[_Rolled]) -> Iterator[ContactMotion]:
    """Look at the rows of a stretch, and yield the motions that end with it."""
    rolled = rolling.result()
    for each, rows in zip(batch.runs, rolled.rows, strict=True):
        each.look(rolled, rows)
    if rolled.last:
        yield from (each.motion() for each in batch.runs)
