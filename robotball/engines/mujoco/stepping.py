"""A model stepped by its own integrators between sample times and breakpoints, every step read."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np

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
    sampled = np.isin(begins, times)
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
    with switched(control) as switches:
        for stretch in stretches(times, scene.breakpoints, compiled.opt.timestep):
            sides = switches.sides if switches else []
            again = partial(_again, control, switches, state_of(data), sides, stretch)
            if switches:
                yield _step_to_switches(control, switches, data, stretch, again)
                continue
            rows = _step(control, data, stretch)
            yield Portion(rows, stretch.samples, len(rows), float(stretch.lengths.max()), again)
        control.span = (times[-1], times[-1])
        mujoco.mj_forward(compiled, data)
        sides = switches.sides if switches else []
        end = Steps(state_of(data)[None], np.zeros(1), np.array([control.span]), [sides])
        yield Portion(read_row(data)[None], np.array([0]), 0, 0.0, lambda: end)


def _step(control: Control, data: mujoco.MjData, stretch: Stretch) -> Array:
    """Rows, one a step of the stretch, each of the state before its step."""
    compiled, sensors, warned = control.model.compiled, data.sensordata, data.warning.number
    rows = np.empty((int(stretch.counts.sum()), len(sensors) + len(warned)))
    sensor_columns, warning_columns = rows[:, : len(sensors)], rows[:, len(sensors) :]
    for row, _ in enumerate(_set_for_each(control, stretch)):
        mujoco.mj_step(compiled, data)
        sensor_columns[row] = sensors
        warning_columns[row] = warned
    return rows


def _step_to_switches(
    control: Control,
    switches: Switches,
    data: mujoco.MjData,
    stretch: Stretch,
    again: Callable[[], Steps],
) -> Portion:
    """A stretch with a step more at every switch of a servo's torque limit."""
    rows: list[Array] = []
    firsts: list[int] = []
    longest = 0.0
    for length, _ in _set_for_each(control, stretch):
        firsts.append(len(rows))
        for taken, _ in switches.steps(data, length):
            rows.append(read_row(data))
            longest = max(longest, taken)
    return Portion(np.array(rows), np.array(firsts)[stretch.samples], len(rows), longest, again)


def _again(
    control: Control, switches: Switches | None, start: Array, sides: list[int], stretch: Stretch
) -> Steps:
    """The steps of a stretch, taken once more from the state that it began from."""
    compiled = control.model.compiled
    data = mujoco.MjData(compiled)
    mujoco.mj_setState(compiled, data, start, STATE)
    states, lengths, spans, all_sides = [], [], [], []
    if switches:
        switches.set(sides)
    for length, span in _set_for_each(control, stretch):
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
    return Steps(np.array(states), np.array(lengths), np.array(spans), all_sides)


def _set_for_each(control: Control, stretch: Stretch) -> Iterator[tuple[float, Sequence[float]]]:
    """Sets model and control for every step of a stretch, and gives its length and span."""
    option = control.model.compiled.opt
    timestep = option.timestep
    for span, length, count in stretch:
        option.timestep, control.span = length, span
        for _ in range(count):
            yield length, span
    option.timestep = timestep
