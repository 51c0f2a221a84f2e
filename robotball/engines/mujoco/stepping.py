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
            # Controls come too late: forces of gravity are known before they are set.
            mujoco.set_mjcb_passive(control.fall)
            stack.callback(mujoco.set_mjcb_passive, None)
        # Constant controls are in the keyframe; a call of Python at each evaluation costs 8 µs.
        if not control.steady:
            mujoco.set_mjcb_control(control.set)
            stack.callback(mujoco.set_mjcb_control, None)
        yield control


# Steps between two looks of the monitor, which are at most taken after a fault; fewer of those that
# have parts, as each takes longer.
_LOOK, _LOOK_IN_PARTS = 4096, 64
# Parts of one step; a robot that leaves a standstill took up to 1409 (W5 with *accurate*).
_MOST_PARTS = 4000


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


def stretches(
    times: Array, breakpoints: tuple[float, ...], timestep: float, look: int = _LOOK
) -> Iterator[_Stretch]:
    """Yield the stretches of a run over `times` (n,) [s], each of about `look` steps.

    Between two sample times or breakpoints lie the fewest equal steps not longer than `timestep`.
    """
    # Piece by piece of the spans, so that a long run's stretches are not all in memory.
    every = spans(times, breakpoints, timestep)
    for piece in pieces(len(every[0])):
        yield from _stretches(look, times, *(each[piece] for each in every))


def _stretches(
    most: int, times: Array, ends: Array, lengths: Array, counts: Array
) -> Iterator[_Stretch]:
    """Yield the stretches of a piece of the spans."""
    # A long span is cut into parts of `most` steps.
    parts = np.ceil(counts / most).astype(int)
    first = np.cumsum(parts) - parts
    part = np.arange(parts.sum()) - np.repeat(first, parts)
    lengths, begins = np.repeat(lengths, parts), np.repeat(ends[:, 0], parts)
    sizes = np.minimum(np.repeat(counts, parts) - most * part, most).astype(int)
    begins = begins + most * part * lengths
    ends = np.stack([begins, begins + sizes * lengths], axis=1)
    sampled = (part == 0) & (times[np.searchsorted(times, begins)] == begins)
    look = (np.cumsum(sizes) - 1) // most
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
    """Run over sample `times` (n,) [s] in steps not longer than the timestep."""
    compiled, scene = control.model.compiled, control.model.scene
    plain = control.steps is None
    step, look = (_step, _LOOK) if plain else (_step_in_parts, _LOOK_IN_PARTS)
    timestep = compiled.opt.timestep
    parts = stretches(times, scene.breakpoints, timestep, look)
    for stretch, following in pairwise(chain(parts, (None,))):
        assert stretch is not None
        began = time.thread_time()
        rows, firsts, longest, failure = step(control, data, stretch)
        compiled.opt.timestep = timestep
        taken = stretch.samples[stretch.samples < len(firsts)]
        samples, steps = firsts[taken], len(rows) - 1
        if following is not None or failure is not None:
            rows = rows[:steps]
        else:
            control.span = (float(times[-1]), float(times[-1]))
            # After a step the sensors are those of the state before it.
            control.forward(data, True)
            rows[steps] = read_row(data)
            samples = np.append(samples, steps)
        yield Portion(rows, samples, steps, longest, time.thread_time() - began, failure)
        if failure is not None:
            return


_Taken = tuple[Array, NDArray[np.int64], float, Fault | None]


def _step(control: Control, data: mujoco.MjData, stretch: _Stretch) -> _Taken:
    """Return the rows of a stretch, the indices of its planned steps, the longest step, a failure.

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
    return rows, np.arange(count, dtype=np.int64), float(stretch.lengths.max()), None


def _step_in_parts(control: Control, data: mujoco.MjData, stretch: _Stretch) -> _Taken:
    """Return the same as `_step`, with a row for every part of a step."""
    rows: list[Array] = []
    firsts: list[int] = []
    longest = 0.0
    for span, length, count in stretch:
        control.begin(data, span)
        for _ in range(count):
            firsts.append(len(rows))
            # A diverged state has no switches and no standstill to be found.
            steps = control.steps if _is_sound(data) else None
            for taken in (steps or control.whole)(data, length):
                rows.append(read_row(data))
                longest = max(longest, taken)
                if len(rows) - firsts[-1] == _MOST_PARTS:
                    failure = _too_many_parts(length)
                    return np.array([*rows, rows[-1]]), np.array(firsts, np.int64), longest, failure
    return np.array([*rows, np.empty_like(rows[0])]), np.array(firsts, np.int64), longest, None


def _is_sound(data: mujoco.MjData) -> bool:
    """Return whether all coordinates and velocities are finite and below DIVERGED."""
    return bool(max(np.abs(data.qpos).max(), np.abs(data.qvel).max()) < DIVERGED)


def _too_many_parts(length: float) -> Fault:
    subject = (
        f"{_MOST_PARTS} parts of one step of {length:g} s, with the plane's resistance near a "
        "standstill; leave friction.rolling out, or take the equations alone"
    )
    return Fault(FaultKind.STEP_TOO_SHORT, np.nan, subject, fatal=True)
