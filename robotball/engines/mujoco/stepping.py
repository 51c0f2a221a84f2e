"""Steps of a model by MuJoCo's own integrators, between sample times and breakpoints.

In order: the control of a run, with what a scene needs beyond MuJoCo's steps; the stretches of its
times; the steps.
"""

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import chain, pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray

from robotball.engines.mujoco.control import STATE, Control, read_row, state_of
from robotball.engines.mujoco.model import Model
from robotball.engines.mujoco.settings import INTEGRATORS, MUJOCOS_DEFAULT
from robotball.engines.observe import spans
from robotball.errors import mujoco_silent
from robotball.motion import Fault, pieces
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
            control.forces.append(resistance.apply)
            control.steps = resistance.steps(control.steps or _whole)
            control.stops = resistance.stop
        if model.scene.plane_moves:
            # Controls come too late: forces of gravity are known before they are set.
            mujoco.set_mjcb_passive(control.fall)
            stack.callback(mujoco.set_mjcb_passive, None)
        if control.forces:
            mujoco.set_mjcb_control(control)
            stack.callback(mujoco.set_mjcb_control, None)
        yield control


def _whole(data: mujoco.MjData, length: float) -> Iterator[float]:
    data.model.opt.timestep = length
    mujoco.mj_step(data.model, data)
    yield length


_LOOK = 4096  # steps between two looks of the monitor; at most so many are taken after a fault


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
    """Run over sample `times` (n,) [s] by mj_step, in steps not longer than the timestep."""
    compiled, scene = control.model.compiled, control.model.scene
    step = _step if control.steps is None else _step_in_parts
    timestep = compiled.opt.timestep
    parts = stretches(times, scene.breakpoints, timestep)
    for stretch, following in pairwise(chain(parts, (None,))):
        assert stretch is not None
        began = time.thread_time()
        rows, firsts, longest = step(control, data, stretch)
        compiled.opt.timestep = timestep
        samples, steps = firsts[stretch.samples], len(rows) - 1
        if following is not None:
            rows = rows[:steps]
        else:
            control.span = (float(times[-1]), float(times[-1]))
            # After a step the sensors are those of the state before it.
            mujoco.mj_forward(compiled, data)
            rows[steps] = read_row(data)
            samples = np.append(samples, steps)
        yield Portion(rows, samples, steps, longest, time.thread_time() - began)


def _step(
    control: Control, data: mujoco.MjData, stretch: _Stretch
) -> tuple[Array, NDArray[np.int64], float]:
    """Return the rows of a stretch, the indices of its planned steps in them, the longest step.

    A row is of the state before its step. There is room for one row more.
    """
    compiled, sensors, warned = control.model.compiled, data.sensordata, data.warning.number
    start, warned_before = state_of(data), warned.copy()
    count = int(stretch.counts.sum())
    rows = np.empty((count + 1, len(sensors) + len(warned)))
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
        return _step_in_parts(control, data, stretch)
    return rows, np.arange(count, dtype=np.int64), float(stretch.lengths.max())


def _step_in_parts(
    control: Control, data: mujoco.MjData, stretch: _Stretch
) -> tuple[Array, NDArray[np.int64], float]:
    """Return the same as `_step`, with a row for every part of a step."""
    steps = control.steps or _whole
    rows: list[Array] = []
    firsts: list[int] = []
    longest = 0.0
    for span, length, count in stretch:
        control.begin(data, span)
        for _ in range(count):
            firsts.append(len(rows))
            for taken in steps(data, length):
                rows.append(read_row(data))
                longest = max(longest, taken)
    return np.array([*rows, np.empty_like(rows[0])]), np.array(firsts, np.int64), longest
