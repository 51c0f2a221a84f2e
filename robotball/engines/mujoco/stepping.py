"""Steps of a model by MuJoCo's own integrators, between sample times and breakpoints.

In order: the control of a run, with what a scene needs beyond MuJoCo's steps; the stretches of its
times; the steps.
"""

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robotball.engines.mujoco.control import STATE, Control, TooManyPartsError, read_row, state_of
from robotball.engines.mujoco.model import Model
from robotball.engines.mujoco.settings import INTEGRATORS, MUJOCOS_DEFAULT
from robotball.engines.observe import spans
from robotball.errors import mujoco_silent
from robotball.motion import DIVERGED, Fault, FaultKind, pieces
from robotball.rotations import Array


@contextmanager
def controlled(model: Model) -> Iterator[Control]:
    """Put the control of the model's run in force inside the block."""
    control = Control(model)
    integrator = INTEGRATORS[model.settings.integrator or MUJOCOS_DEFAULT]
    with ExitStack() as stack:
        stack.enter_context(mujoco_silent())
        # First-order steps, and those that are chosen by their error, cross a limit at no cost.
        if model.has_torque_limits and integrator.own and integrator.order > 1:
            from robotball.engines.mujoco.torque_limits import at_limits

            control.steps = stack.enter_context(at_limits(control))
        if model.scene.friction.rolling:
            from robotball.engines.mujoco.rolling_resistance import Resistance

            resistance = Resistance(control)
            control.forward, control.stops = resistance.forward, resistance.stop
            control.step = resistance.rk4 if integrator.order > 1 else resistance.first_order
            control.steps = resistance.steps(control.steps or control.whole)
        if model.scene.plane_moves:
            # The forces of gravity are computed before the control callback.
            stack.callback(mujoco.set_mjcb_passive, mujoco.get_mjcb_passive())
            mujoco.set_mjcb_passive(control.fall)
        stack.callback(mujoco.set_mjcb_control, mujoco.get_mjcb_control())
        control.install()
        yield control


# Steps between two looks of the monitor, or parts; at most so many are taken after a fault.
_LOOK, _LOOK_IN_PARTS = 4096, 64


@dataclass(frozen=True)
class _Stretch:
    """Consecutive spans of time that are stepped before the monitor looks at them.

    ends     (m, 2)  s, the begin and end of each span
    lengths  (m,)    s, of the steps in each
    counts   (m,)    of the steps in each
    samples  (k,)    the steps, counted over the stretch, that start at a sample time
    """

    ends: Array
    lengths: Array
    counts: NDArray[np.int64]
    samples: NDArray[np.int64]

    def __iter__(self) -> Iterator[tuple[list[float], float, int]]:
        ends, lengths, counts = self.ends.tolist(), self.lengths.tolist(), self.counts.tolist()
        return zip(ends, lengths, counts, strict=True)


def stretches(times: Array, breakpoints: tuple[float, ...], timestep: float) -> Iterator[_Stretch]:
    """Yield the stretches of a run over `times` (n,) [s], each of about _LOOK steps.

    Between two sample times or breakpoints lie the fewest equal steps not longer than `timestep`.
    """
    # Piece by piece of the spans, so that a long run's stretches are not all in memory.
    every = spans(times, breakpoints, timestep)
    for piece in pieces(len(every[0])):
        yield from _stretches(times, *(each[piece] for each in every))


def _stretches(times: Array, ends: Array, lengths: Array, counts: Array) -> Iterator[_Stretch]:
    """Yield the stretches of a piece of the spans."""
    # A long span is cut into parts of _LOOK steps.
    parts = np.ceil(counts / _LOOK).astype(int)
    first = np.cumsum(parts) - parts
    part = np.arange(parts.sum()) - np.repeat(first, parts)
    lengths, begins = np.repeat(lengths, parts), np.repeat(ends[:, 0], parts)
    sizes = np.minimum(np.repeat(counts, parts) - _LOOK * part, _LOOK).astype(int)
    begins = begins + _LOOK * part * lengths
    ends = np.stack([begins, begins + sizes * lengths], axis=1)
    sampled = (part == 0) & (times[np.searchsorted(times, begins)] == begins)
    look = (np.cumsum(sizes) - 1) // _LOOK
    for which in np.split(np.arange(len(sizes)), np.flatnonzero(np.diff(look)) + 1):
        starts = np.cumsum(sizes[which]) - sizes[which]
        yield _Stretch(ends[which], lengths[which], sizes[which], starts[sampled[which]])


@dataclass(frozen=True)
class Portion:
    """A part of a run, between two looks of the monitor.

    rows     (m, columns of `read_row`)  in the order of time
    sampled  the indices of the rows at the run's sample times
    steps    the number of steps taken
    longest  s, the longest of them
    seconds  of this thread's processor time that they took; a busy machine makes no run look slow
    failure  why the run cannot go on, if it cannot
    """

    rows: Array
    sampled: NDArray[np.int64]
    steps: int
    longest: float
    seconds: float
    failure: Fault | None = None


def by_steps(control: Control, data: mujoco.MjData, times: Array) -> Iterator[Portion]:
    """Run over sample `times` (n,) [s] in steps not longer than the timestep.

    A row is of the state before its step; the last one, alone, is of the end.
    """
    compiled, scene = control.model.compiled, control.model.scene
    step = _step if control.steps is None else _step_in_parts
    timestep = compiled.opt.timestep
    for stretch in stretches(times, scene.breakpoints, timestep):
        for portion in step(control, data, stretch):
            compiled.opt.timestep = timestep
            yield portion
            if portion.failure is not None:
                return
    control.span = (float(times[-1]), float(times[-1]))
    # After a step the sensors are those of the state before it.
    control.forward(data, True)
    yield Portion(read_row(data)[None], np.zeros(1, np.int64), 0, 0.0, 0.0)


def _step(control: Control, data: mujoco.MjData, stretch: _Stretch) -> Iterator[Portion]:
    """Take the steps of a stretch with MuJoCo."""
    compiled, sensors, warned = control.model.compiled, data.sensordata, data.warning.number
    began, start, warned_before = time.thread_time(), state_of(data), warned.copy()
    count = int(stretch.counts.sum())
    rows = np.empty((count, len(sensors) + len(warned)))
    rows[:, len(sensors) :] = warned_before
    # Slices of memoryviews copy 50 numbers faster than NumPy does: a run takes 1.05 times as long
    # as a bare loop of mj_step.
    step, read, to = mujoco.mj_step, sensors.data, rows.reshape(-1).data
    place, size, width = 0, len(sensors), rows.shape[1]
    option = compiled.opt
    for span, option.timestep, taken in stretch:
        control.begin(data, span)
        for _ in range(taken):
            step(compiled, data)
            to[place : place + size] = read
            place += width
    if (warned != warned_before).any():
        # To read the counters at every step would slow all runs for the few in which one changes.
        mujoco.mj_setState(compiled, data, start, STATE)
        warned[:] = warned_before
        yield from _step_in_parts(control, data, stretch)
        return
    seconds = time.thread_time() - began
    yield Portion(rows, stretch.samples, count, float(stretch.lengths.max()), seconds)


def _step_in_parts(control: Control, data: mujoco.MjData, stretch: _Stretch) -> Iterator[Portion]:
    """Take the steps of a stretch, with a row for every part of a step."""
    rows: list[Array] = []
    sampled: list[int] = []
    longest, began = 0.0, time.thread_time()

    def portion(failure: Fault | None = None) -> Portion:
        table = np.array(rows).reshape(len(rows), len(data.sensordata) + len(data.warning.number))
        at, seconds = np.array(sampled, dtype=np.int64), time.thread_time() - began
        return Portion(table, at[at < len(rows)], len(rows), longest, seconds, failure)

    samples, step = {*stretch.samples.tolist()}, 0
    for span, length, count in stretch:
        control.begin(data, span)
        for _ in range(count):
            if step in samples:
                sampled.append(len(rows))
            step += 1
            control.planned += 1
            # A diverged state has no switches and no standstill to be found.
            steps = control.steps if _is_sound(data) else None
            try:
                for taken in (steps or control.whole)(data, length):
                    rows.append(read_row(data))
                    longest = max(longest, taken)
                    if len(rows) == _LOOK_IN_PARTS:
                        yield portion()
                        rows, sampled, longest, began = [], [], 0.0, time.thread_time()
            except TooManyPartsError as error:
                yield portion(Fault(FaultKind.STEP_TOO_SHORT, np.nan, str(error), fatal=True))
                return
    yield portion()


def _is_sound(data: mujoco.MjData) -> bool:
    """Return whether all coordinates and velocities are finite and below DIVERGED."""
    return bool(max(np.abs(data.qpos).max(), np.abs(data.qvel).max()) < DIVERGED)
