"""Many runs at once: by MuJoCo's own threads, or in processes.

Where controls keep their values a run is nothing but steps, and the threads of `mujoco.rollout`
take those of many starts while the runs before are monitored from their rows. A drive that changes
calls Python at every step, which threads would wait for, and scenes that differ in more than the
start are built one by one: these go to processes. A motion is that of `run` to the last bit.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from copy import copy
from dataclasses import replace
from functools import partial
from itertools import groupby
from time import perf_counter

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from robotball.engines.mujoco.limits import check_length, precheck
from robotball.engines.mujoco.model import Model, build, carrying_depth, hinges_of, start_state
from robotball.engines.mujoco.run import held, observed, run
from robotball.engines.mujoco.settings import Resolved, Settings, resolved
from robotball.engines.mujoco.stepping import Portion, controlled, stretches
from robotball.errors import mujoco_silent
from robotball.many_motions import FromStarts, differ_in_start, of_each
from robotball.motion import ContactMotion, FaultKind
from robotball.processes import allowed
from robotball.rotations import Array
from robotball.scene import Scene

_BYTES = 2e7  # of the rows that threads write at once, twice: a dozen runs of 2000 steps
_ABREAST = 128  # runs at most, as each takes a millisecond to prepare before any can begin
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
# MuJoCo's threads stop a run that is warned of, without a word: its rows repeat the last one.
_STOPPED = {FaultKind.DIVERGED, FaultKind.RESET, FaultKind.ENGINE_WARNED}


def run_many(scenes: Sequence[Scene], settings: Settings, times: Array) -> Iterator[ContactMotion]:
    """Yield the motions of scenes at times (n,) [s] from 0, in their order.

    Runs the precheck on each scene. Of scenes that differ only in their start, only those with the
    least and the largest momentum are checked. Raises InputError as `build` and `run` do.
    """
    alike = differ_in_start(scenes)
    starts = scenes.starts if isinstance(scenes, FromStarts) else [each.start for each in scenes]
    by_size = np.argsort([np.linalg.norm(each.momentum) for each in starts], kind="stable")
    for i in by_size[:: max(1, len(scenes) - 1)] if alike else range(len(scenes)):
        precheck(scenes[int(i)], settings, times)
    model, alone = build(resolved(scenes[0], settings)), partial(_alone, settings, times)
    check_length(model.scene, model.settings, times)
    together = _Together(model, times)
    if not (together.size >= allowed() and together.steps_alone and alike):
        yield from of_each(alone, scenes)
        return
    data = [mujoco.MjData(model.compiled) for _ in range(allowed())]
    ahead = deque[tuple[Sequence[Scene], list[Model | None], Future[tuple[Array, float]]]]()

    def motions() -> Iterator[ContactMotion]:
        some, models, future = ahead.popleft()
        rows, seconds = future.result()
        left = iter(rows)
        for scene, own in zip(some, models, strict=True):
            yield (own and together.motion(own, next(left), seconds)) or alone(scene)

    with Rollout(nthread=len(data)) as pool, ThreadPoolExecutor(1) as beside:
        for i in range(0, len(scenes), together.size):
            some = scenes[i : i + together.size]
            models = [_started(model, each) for each in some]
            future = beside.submit(together.rows, pool, data, [*filter(None, models)])
            ahead.append((some, models, future))
            if len(ahead) > 1:
                yield from motions()
        yield from motions()


def _alone(settings: Settings, times: Array, scene: Scene) -> ContactMotion:
    return held(run(build(resolved(scene, settings)), times))


def _started(model: Model, scene: Scene) -> Model | None:
    """Return the model of a scene with another start; None where that turns other hinges.

    Its MjModel is that of `build`, in a fiftieth of the time; its text is not renewed.
    """
    settings, hinges = model.settings, hinges_of(scene, model.settings)
    if [each.index for each in hinges] != [each.index for each in model.hinges]:
        return None
    compiled = copy(model.compiled)
    qpos, qvel = start_state(scene, settings.root, hinges)
    mujoco.mj_normalizeQuat(compiled, qpos)  # as the compiler does
    compiled.key_qpos[0], compiled.key_qvel[0] = qpos, qvel
    if settings.start_in_equilibrium:
        compiled.pair_margin[0] = carrying_depth(Resolved(scene, settings), copy(compiled))
    started = replace(model, scene=scene, hinges=hinges)
    vars(started)["compiled"] = compiled  # the property's own place
    return started


class _Together:
    """How runs of a model from several starts are stepped together.

    size: how many at once; groups: consecutive steps of one length [s], and their number, with one
    more at the end, as sensors are those of the state before a step; steps_alone: whether MuJoCo's
    steps are all that a run consists of.
    """

    def __init__(self, model: Model, times: Array) -> None:
        settings, compiled = model.settings, model.compiled
        self.times = times
        self.parts = [*stretches(times, model.scene.breakpoints, compiled.opt.timestep)]
        spans = [(length, count) for part in self.parts for _, length, count in part]
        grouped = groupby([*spans, (spans[-1][0], 1)], key=lambda span: span[0])
        self.groups = [(length, sum(n for _, n in some)) for length, some in grouped]
        steps = sum(count for _, count in self.groups)
        self.size = min(int(_BYTES / (8 * steps * compiled.nsensordata)), _ABREAST)
        # The guess from which a solver starts is no part of the state between two groups.
        guesses = settings.warmstart != "disable" and len(self.groups) > 1
        with controlled(model) as control:
            self.steps_alone = not settings.adaptive and not guesses and control.is_plain

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
            with mujoco_silent():
                states, sensors = pool.rollout(compiled, data, state, control, nstep=count)
            state = states[:, -1]
            rows.append(sensors)
        busy = min(len(data), len(models))
        return np.concatenate(rows, axis=1), (perf_counter() - began) * busy / len(models)

    def motion(self, model: Model, sensors: Array, seconds: float) -> ContactMotion | None:
        """Return the motion of a run's sensors (steps + 1, n); None where the threads stopped."""
        motion = observed(model, self.times, self._portions(sensors, seconds))
        stopped = _STOPPED & {fault.kind for fault in motion.report.faults}
        return None if stopped else held(motion)

    def _portions(self, sensors: Array, seconds: float) -> Iterator[Portion]:
        share = seconds / len(self.parts)
        rows = np.pad(sensors, ((0, 0), (0, int(mujoco.mjtWarning.mjNWARNING))))
        for part in self.parts:
            count, samples, last = int(part.counts.sum()), part.samples, part is self.parts[-1]
            if last:
                samples = np.append(samples, count)
            longest = float(part.lengths.max())
            yield Portion(rows[: count + last], samples, count, longest, share)
            rows = rows[count:]
