"""Steps of a model by MuJoCo's own integrators, between sample times and breakpoints.

Controls are computed at every evaluation of the forces, so that RK4 keeps its order; held over a
step they would cost it two. In order: the control of a run, the stretches of its times, its steps.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import chain, pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray

from robotball.engines.mujoco.model import Model, controls_at
from robotball.engines.mujoco.settings import INTEGRATORS, MUJOCOS_DEFAULT
from robotball.motion import Fault, pieces
from robotball.rotations import Array
from robotball.scene import spans

FREE_QPOS, FREE_QVEL = 7, 6  # coordinates and velocities of the free joint; hinges follow
STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def read_row(data: mujoco.MjData) -> Array:
    """Return the sensors of a state, which are up to date, followed by the warning counters."""
    return np.concatenate([data.sensordata, data.warning.number])


def state_of(data: mujoco.MjData) -> Array:
    """Return all that a step depends on (n,)."""
    state = np.empty(mujoco.mj_stateSize(data.model, STATE))
    mujoco.mj_getState(data.model, data, state, STATE)
    return state


Steps = Callable[[mujoco.MjData, float], Iterator[float]]
"""Takes one step of a length [s], in parts where it has to. Yields the length of each part."""

# s: a drive's value at the end of a span is taken this long before it, where a breakpoint's other
# side begins.
_INSIDE = 1e-9


class Control:
    """The control of a run: what is set at every evaluation of the forces, and how steps are taken.

    span: the smooth span of time that the run is in [s], as its steps set it; forces: functions
    that set controls or forces in MjData; steps: of a run whose steps are not simply MuJoCo's, else
    None; stops: stops a ball that is at rest, and returns whether it did, where a run can stop.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.span: Sequence[float] = (0.0, 0.0)
        # Constant controls are in the keyframe; a call of Python at each evaluation costs 8 µs.
        self.forces = [] if model.scene.steady else [self.set]
        self.steps: Steps | None = None
        self.stops: Callable[[mujoco.MjData], bool] | None = None

    @property
    def is_plain(self) -> bool:
        """True if a run is nothing but MuJoCo's steps."""
        return not self.forces and self.steps is None

    def inside(self, t: float) -> float:
        """Return the time [s] of the span that is nearest to t."""
        begin, end = self.span
        return max(begin, min(t, end - _INSIDE))

    def set(self, data: mujoco.MjData) -> None:
        """Set the controls of the hinges at the time of `data`."""
        data.ctrl[:] = controls_at(self.model.scene, self.model.hinges, self.inside(data.time))

    def __call__(self, _: mujoco.MjModel, data: mujoco.MjData) -> None:
        for each in self.forces:
            each(data)


@contextmanager
def controlled(model: Model) -> Iterator[Control]:
    """Put the control of the model's run in force inside the block."""
    control = Control(model)
    integrator = INTEGRATORS[model.settings.integrator or MUJOCOS_DEFAULT]
    with ExitStack() as stack:
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
    """Yield the stretches of a run over `times` (n,) [s], each of about LOOK steps.

    Between two sample times or breakpoints lie the fewest equal steps not longer than `timestep`.
    """
    # Piece by piece of the spans, so that a long run's stretches are not all in memory.
    every = spans(times, breakpoints, timestep)
    for piece in pieces(len(every[0])):
        yield from _stretches(times, *(each[piece] for each in every))


def _stretches(times: Array, ends: Array, lengths: Array, counts: Array) -> Iterator[_Stretch]:
    """Yield the stretches of a piece of the spans."""
    # A long span is cut into parts of LOOK steps.
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
    for control.span, option.timestep, taken in stretch:
        for _ in range(taken):
            step(compiled, data)
            to[place : place + size] = read
            place += width
    if (warned != warned_before).any():
        rows[:count, size:] = _warnings(control, start, stretch, warned_before)
    return rows, np.arange(count, dtype=np.int64), float(stretch.lengths.max())


def _warnings(control: Control, start: Array, stretch: _Stretch, before: Array) -> Array:
    """Return MuJoCo's counters (m, 7) after each step of a stretch, which is repeated.

    To read them at every step would slow all runs for the few in which one changes.
    """
    compiled = control.model.compiled
    data = mujoco.MjData(compiled)
    mujoco.mj_setState(compiled, data, start, STATE)
    data.warning.number[:] = before
    counters = []
    for control.span, compiled.opt.timestep, count in stretch:
        for _ in range(count):
            mujoco.mj_step(compiled, data)
            counters.append(data.warning.number.copy())
    return np.array(counters)


def _step_in_parts(
    control: Control, data: mujoco.MjData, stretch: _Stretch
) -> tuple[Array, NDArray[np.int64], float]:
    """Return the same as `_step`, with a row for every part of a step."""
    assert control.steps is not None
    rows: list[Array] = []
    firsts: list[int] = []
    longest = 0.0
    for control.span, length, count in stretch:
        for _ in range(count):
            firsts.append(len(rows))
            for taken in control.steps(data, length):
                rows.append(read_row(data))
                longest = max(longest, taken)
    return np.array([*rows, np.empty_like(rows[0])]), np.array(firsts, np.int64), longest
