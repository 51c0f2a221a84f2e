"""A model stepped by its own integrators between sample times and breakpoints, every step read."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray

from robotball.engines.mujoco.control import Control
from robotball.engines.mujoco.states import STATE, read_row, state_of
from robotball.engines.mujoco.switches import Switches, switched
from robotball.engines.spans import spans
from robotball.faults import Fault
from robotball.motion import pieces
from robotball.rotations import Array

LOOK = 4096  # steps between two looks at the run


@dataclass(frozen=True)
class Stretch:
    """Consecutive spans of time that are stepped before the run is looked at.

    ends    (m, 2)  s, where the spans begin and end
    lengths  (m,)    s, of the steps in each
    counts   (m,)    how many there are
    samples  (k,)    which steps, counted over the stretch, start at a sample time
    """

    ends: Array
    lengths: Array
    counts: Array
    samples: Array

    def __iter__(self) -> Iterator[tuple[list[float], float, int]]:
        spans = zip(self.ends.tolist(), self.lengths.tolist(), self.counts.tolist(), strict=True)
        yield from spans


def stretches(times: Array, breakpoints: tuple[float, ...], timestep: float) -> Iterator[Stretch]:
    """A run over `times` (n,) [s], in stretches of about LOOK steps however far apart they are.

    Between two sample times or breakpoints go the fewest equal steps not longer than `timestep`.
    """
    for piece in pieces(len(times) - 1):
        some = times[piece.start : piece.stop + 1]
        later = tuple(t for t in breakpoints if t > some[0])
        yield from _stretches(some, later, timestep)


def _stretches(times: Array, breakpoints: tuple[float, ...], timestep: float) -> Iterator[Stretch]:
    """The same for a part of the samples."""
    ends, lengths, counts = spans(times, breakpoints, timestep)
    # A long span is cut into parts of LOOK steps.
    parts = np.ceil(counts / LOOK).astype(int)
    first = np.cumsum(parts) - parts
    part = np.arange(parts.sum()) - np.repeat(first, parts)
    lengths, begins = np.repeat(lengths, parts), np.repeat(ends[:, 0], parts)
    sizes = np.minimum(np.repeat(counts, parts) - LOOK * part, LOOK).astype(int)
    begins = begins + LOOK * part * lengths
    ends = np.stack([begins, begins + sizes * lengths], axis=1)
    sampled = part == 0
    if breakpoints:
        sampled &= np.isin(begins, times)
    look = (np.cumsum(sizes) - 1) // LOOK
    for which in np.split(np.arange(len(sizes)), np.flatnonzero(np.diff(look)) + 1):
        starts = np.cumsum(sizes[which]) - sizes[which]
        yield Stretch(ends[which], lengths[which], sizes[which], starts[sampled[which]])


@dataclass(frozen=True)
class Steps:
    """What each row of a portion began from, so that it can be done again.

    states   (m, n)  MuJoCo's integration states
    lengths  (m,)    s, of the step from each; 0 where there was none
    spans    (m, 2)  s, the smooth span of time that each is in
    sides    m       of their torque limits, on which the servos are that have one
    """

    states: Array
    lengths: Array
    spans: Array
    sides: list[list[int]]


@dataclass(frozen=True)
class Portion:
    """A part of a run, between two looks at it.

    rows     (m, columns of Readings)  in the order of time
    sampled  which of them, as an index, are at the run's sample times
    steps    how many were taken
    longest  of them [s]
    again    gives what its rows began from; deferred, as only faulty runs need it
    failure  why the run can't go on, if it can't
    """

    rows: Array
    sampled: Array
    steps: int
    longest: float
    again: Callable[[], Steps]
    failure: Fault | None = None


def by_steps(control: Control, data: mujoco.MjData, times: Array) -> Iterator[Portion]:
    """The run over sample `times` (n,) [s] by mj_step, in steps not longer than the timestep."""
    compiled, scene = control.model.compiled, control.model.scene
    parts = stretches(times, scene.breakpoints, compiled.opt.timestep)
    with switched(control) as switches:
        for stretch, following in pairwise(chain(parts, (None,))):
            assert stretch is not None
            end = float(times[-1]) if following is None else None
            sides = switches.sides if switches else []
            again = partial(_again, control, switches, state_of(data), sides, stretch, end)
            if switches:
                rows, firsts, longest = _step_to_switches(control, switches, data, stretch)
            else:
                rows, firsts, longest = _step(control, data, stretch)
            samples = firsts[stretch.samples]
            steps = len(rows) - 1
            if end is None:
                rows = rows[:steps]
            else:
                control.span = (end, end)
                mujoco.mj_forward(compiled, data)
                rows[steps] = read_row(data)
                samples = np.append(samples, steps)
            yield Portion(rows, samples, steps, longest, again)


def _step(
    control: Control, data: mujoco.MjData, stretch: Stretch
) -> tuple[Array, NDArray[np.int64], float]:
    """Rows, one a step of the stretch, each of the state before its step, and room for one more.

    Also which of them begins each planned step, and the longest step.
    """
    compiled, sensors, warned = control.model.compiled, data.sensordata, data.warning.number
    start, warned_before = state_of(data), warned.copy()
    count = int(stretch.counts.sum())
    rows = np.empty((count + 1, len(sensors) + len(warned)))
    rows[:, len(sensors) :] = warned_before
    # Few of the ways to copy 50 numbers are as quick as this.
    step, read, to = mujoco.mj_step, sensors.data, rows.reshape(-1).data
    place, size, width = 0, len(sensors), rows.shape[1]
    for _, _, taken in _set_for_each(control, stretch):
        for _ in range(taken):
            step(compiled, data)
            to[place : place + size] = read
            place += width
    if (warned != warned_before).any():
        rows[:count, size:] = _warnings(control, start, stretch, warned_before)
    return rows, np.arange(count, dtype=np.int64), float(stretch.lengths.max())


def _warnings(control: Control, start: Array, stretch: Stretch, before: Array) -> Array:
    """MuJoCo's counters (m, 7) after each step of a stretch, which is taken once more."""
    data = _data_at(control, start)
    data.warning.number[:] = before
    rows = []
    for _, _, count in _set_for_each(control, stretch):
        for _ in range(count):
            mujoco.mj_step(control.model.compiled, data)
            rows.append(data.warning.number.copy())
    return np.array(rows)


def _step_to_switches(
    control: Control, switches: Switches, data: mujoco.MjData, stretch: Stretch
) -> tuple[Array, NDArray[np.int64], float]:
    """The same with a step more at every switch of a servo's torque limit."""
    rows: list[Array] = []
    firsts: list[int] = []
    longest = 0.0
    for length, _, count in _set_for_each(control, stretch):
        for _ in range(count):
            firsts.append(len(rows))
            for taken, _ in switches.steps(data, length):
                rows.append(read_row(data))
                longest = max(longest, taken)
    return np.array([*rows, np.empty_like(rows[0])]), np.array(firsts, np.int64), longest


def _again(
    control: Control,
    switches: Switches | None,
    start: Array,
    sides: list[int],
    stretch: Stretch,
    end: float | None,
) -> Steps:
    """The steps of a stretch, taken once more from the state that it began from.

    end: of the run [s], where the stretch is its last; then the last row is of the state there.
    """
    compiled = control.model.compiled
    data = _data_at(control, start)
    states, lengths, spans, all_sides = [], [], [], []
    if switches:
        switches.set(sides)
    for length, span, count in _set_for_each(control, stretch):
        for _ in range(count):
            if switches:
                for taken, (before, side) in switches.steps(data, length):
                    states.append(before)
                    lengths.append(taken)
                    spans.append(span)
                    all_sides.append(side)
                continue
            states.append(state_of(data))
            lengths.append(length)
            spans.append(span)
            all_sides.append(sides)
            mujoco.mj_step(compiled, data)
    if end is not None:
        states.append(state_of(data))
        lengths.append(0.0)
        spans.append((end, end))
        all_sides.append(switches.sides if switches else [])
    return Steps(np.array(states), np.array(lengths), np.array(spans), all_sides)


def _data_at(control: Control, state: Array) -> mujoco.MjData:
    data = mujoco.MjData(control.model.compiled)
    mujoco.mj_setState(control.model.compiled, data, state, STATE)
    return data


def _set_for_each(
    control: Control, stretch: Stretch
) -> Iterator[tuple[float, Sequence[float], int]]:
    """Sets model and control for every span of a stretch, and gives its step, itself and how many
    steps it has.
    """
    option = control.model.compiled.opt
    timestep = option.timestep
    for span, length, count in stretch:
        option.timestep, control.span = length, span
        yield length, span, count
    option.timestep = timestep
