"""Many runs at once, in threads with `mujoco.rollout` or in processes.

A run with constant controls consists of steps only. Each thread steps one start after another with
`mujoco.rollout`, and reads the rows while they are in its cache. Other runs are distributed to
processes: runs with changing drives, because they call Python at every step and would block each
other's threads, and scenes that differ in more than their start, because they are built one by one.
A motion equals that of `run` to the last bit.
"""

import math
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from copy import copy
from functools import partial
from itertools import groupby
from queue import SimpleQueue
from time import thread_time
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco.rollout import rollout

from robotball.engines.many_motions import FromStarts, differ_in_start, of_each
from robotball.engines.mujoco.accuracy import checked
from robotball.engines.mujoco.control import Portion
from robotball.engines.mujoco.limits import PlannedRun
from robotball.engines.mujoco.model import Model, build, carrying_depth, start_state
from robotball.engines.mujoco.run import check_length, observed, precheck, run
from robotball.engines.mujoco.settings import Resolved, Settings
from robotball.engines.mujoco.stepping import controlled, stretches
from robotball.errors import mujoco_silent
from robotball.motion import ContactMotion, FaultKind
from robotball.processes import allowed
from robotball.robot.scene import Scene
from robotball.rotations import Array

_BYTES = 4e7  # bytes of the rows of all started runs: fifty runs of 2000 steps
_ABREAST = 64  # largest number of started runs; the first motion is yielded after this many
_LONG = 10  # least mean number of steps of a group; the call itself takes as long as two steps
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
# `mujoco.rollout` stops a run without notice if MuJoCo warns: its rows repeat the last one.
_STOPPED = {FaultKind.DIVERGED, FaultKind.RESET, FaultKind.ENGINE_WARNED}


def run_many(scenes: Sequence[Scene], settings: Settings, times: Array) -> Iterator[ContactMotion]:
    """Yield the motions of scenes at times (n,) [s] from 0, in order.

    Each scene is prechecked. If scenes differ only in their start, only the scenes with the
    smallest and the largest momentum are prechecked. Raises InputError if `build` or `run` raises
    it.
    """
    alike = differ_in_start(scenes)
    starts = scenes.starts if isinstance(scenes, FromStarts) else [s.start for s in scenes]
    sizes = np.linalg.norm([start.momentum for start in starts], axis=1)
    by_size = np.argsort(sizes, kind="stable")
    for i in by_size[:: max(1, len(scenes) - 1)] if alike else range(len(scenes)):
        precheck(scenes[int(i)], settings, times)
    model, alone = build(scenes[0], settings), partial(_alone, settings, times)
    check_length(PlannedRun(model.scene, model.settings, float(times[-1])), times)
    together = _Together(model, times)
    # Whether a ball slips depends on its start, and the contact depends on whether it slips.
    same = alike and not model.scene.may_slip
    if not (together.size >= 2 * allowed() and together.steps_alone and same):
        yield from of_each(alone, scenes)
        return
    if isinstance(scenes, FromStarts):
        # The scene of the model has cached the numbers of the ball and its drives.
        scenes = FromStarts(model.scene, scenes.starts)
    ahead = deque[tuple[Scene, Future[ContactMotion | None] | None]]()

    def motion() -> ContactMotion:
        scene, future = ahead.popleft()
        result = future and future.result()
        return checked(result) if result else alone(scene)

    threads = ThreadPoolExecutor(allowed())
    try:
        for scene in scenes:
            started = together.started(scene)
            ahead.append((scene, started and threads.submit(together.motion, started)))
            if len(ahead) == together.size:
                yield motion()
        while ahead:
            yield motion()
    finally:
        threads.shutdown(cancel_futures=True)


def _alone(settings: Settings, times: Array, scene: Scene) -> ContactMotion:
    return checked(run(build(scene, settings), times))


class _Started(NamedTuple):
    """A run before its first step, with the margin of its contact [m]."""

    model: Model
    state: Array
    margin: float


class _Together:
    """Step the runs of a model from several starts, each run in one of several threads.

    size: number of started runs. groups: length [s] and number of equal steps; the last group has
    one more step, because sensors show the state before a step. shape: of a run's rows.
    steps_alone: whether a run consists only of long groups of steps. idle: unused data, each with
    an MjModel.
    """

    def __init__(self, model: Model, times: Array) -> None:
        compiled = model.compiled
        self.model, self.times, self.trial = model, times, model.start_data()
        self.parts = [*stretches(times, model.scene.breakpoints, compiled.opt.timestep)]
        spans = [(length, count) for part in self.parts for _, length, count in part]
        grouped = groupby([*spans, (spans[-1][0], 1)], key=lambda span: span[0])
        self.groups = [(length, sum(n for _, n in group)) for length, group in grouped]
        columns = compiled.nsensordata + int(mujoco.mjtWarning.mjNWARNING)
        self.shape = sum(count for _, count in self.groups), columns
        self.size = min(int(_BYTES / (8 * math.prod(self.shape))), _ABREAST)
        long = self.shape[0] >= _LONG * len(self.groups)
        with controlled(model) as control:
            self.steps_alone = long and control.is_plain
        self.idle: SimpleQueue[mujoco.MjData] = SimpleQueue()
        for _ in range(allowed()):
            self.idle.put(mujoco.MjData(copy(compiled)))

    def started(self, scene: Scene) -> _Started | None:
        """Return the run of a scene with another start; None if other hinges turn."""
        model, settings = self.model.of(scene), self.model.settings
        if [h.index for h in model.hinges] != [h.index for h in self.model.hinges]:
            return None
        data, compiled = self.trial, model.compiled
        qpos, qvel = start_state(scene, settings.root, model.hinges)
        mujoco.mj_normalizeQuat(compiled, qpos)  # as in MuJoCo's compiler
        compiled.key_qpos[0], compiled.key_qvel[0] = qpos, qvel
        margin = float(compiled.pair_margin[0])
        if settings.start_in_equilibrium:
            margin = carrying_depth(Resolved(scene, settings), data)
        mujoco.mj_resetDataKeyframe(compiled, data, 0)
        state = np.empty(mujoco.mj_stateSize(compiled, _STATE))
        mujoco.mj_getState(compiled, data, state, _STATE)
        return _Started(model, state, margin)

    def motion(self, started: _Started) -> ContactMotion | None:
        """Return the motion of a run, before it is checked; None if the rollout stopped early."""
        motion = observed(started.model, self.times, self._portions(*self._rows(started)))
        stopped = _STOPPED & {fault.kind for fault in motion.report.faults}
        return None if stopped else motion

    def _rows(self, started: _Started) -> tuple[Array, float]:
        """Return the rows (steps + 1, n) of a run, and the processor time of its steps [s]."""
        began, data, rows, begin = thread_time(), self.idle.get(), np.zeros(self.shape), 0
        compiled, state, guess = data.model, started.state, None
        compiled.pair_margin[0] = started.margin
        control = compiled.key_ctrl[0] if compiled.nu else None
        with mujoco_silent():
            for compiled.opt.timestep, count in self.groups:
                states, sensors = rollout(
                    compiled, data, state, control, nstep=count, initial_warmstart=guess
                )
                # The state does not include the solver's initial guess.
                state, guess = states[0, -1], data.qacc_warmstart.copy()
                rows[begin : begin + count, : compiled.nsensordata] = sensors[0]
                begin += count
        self.idle.put(data)
        return rows, thread_time() - began

    def _portions(self, rows: Array, seconds: float) -> Iterator[Portion]:
        share = seconds / len(self.parts)
        for part in self.parts:
            count, samples, last = int(part.counts.sum()), part.samples, part is self.parts[-1]
            if last:
                samples = np.append(samples, count)
            longest = float(part.lengths.max())
            yield Portion(rows[: count + last], samples, count, longest, share)
            rows = rows[count:]
