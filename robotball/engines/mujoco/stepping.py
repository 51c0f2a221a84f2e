"""Steps of a model with MuJoCo's integrators, between sample times and breakpoints."""

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import mujoco
import numpy as np

from robotball.engines.mujoco.control import STATE, Control, Portion, Stretch, read_row, state_of
from robotball.engines.mujoco.model import NO_ROWS, Model
from robotball.engines.mujoco.settings import INTEGRATORS, MUJOCOS_DEFAULT, ORDER_8
from robotball.engines.observe import spans
from robotball.errors import mujoco_silent
from robotball.motion import pieces
from robotball.robot.drives import Constant
from robotball.rotations import Array

_LOOK = 4096  # steps between two checks of the monitor; at most this many follow a fault


@contextmanager
def controlled(model: Model) -> Iterator[Control]:
    """Install the control of a run inside the block, and restore MuJoCo's callbacks after it."""
    control = Control(model)
    integrator = INTEGRATORS[model.settings.integrator or MUJOCOS_DEFAULT]
    with ExitStack() as stack:
        stack.enter_context(mujoco_silent())
        if model.settings.integrator == ORDER_8:
            from robotball.engines.mujoco.order8 import Order8

            control.order_8 = order_8 = Order8(control)
            control.step, control.steps = order_8.step, control.whole
        # First-order steps lose no accuracy by crossing a limit.
        if model.has_torque_limits and integrator.order > 1:
            from robotball.engines.mujoco.parts import at_limits

            control.steps = stack.enter_context(at_limits(control))
        if model.scene.friction.rolling:
            from robotball.engines.mujoco.rolling_resistance import Resistance

            resistance = Resistance(control)
            control.forward = resistance.forward
            if control.order_8 is None:
                control.step = resistance.rk4 if integrator.order > 1 else resistance.first_order
            control.steps = resistance.steps(control.steps or control.whole)
        if model.dry_friction is not None:
            from robotball.engines.mujoco.dry_friction import Parts

            option = model.compiled.opt
            stack.callback(setattr, option, "disableflags", option.disableflags)
            option.disableflags |= NO_ROWS
            parts = Parts(control, model.dry_friction)
            control.friction, control.step = parts.torques, parts.step
            control.steps = control.steps or control.whole
        if model.scene.plane_moves or not isinstance(model.scene.plane_turn, Constant):
            # Gravity and the slip are computed before the control callback.
            stack.callback(mujoco.set_mjcb_passive, mujoco.get_mjcb_passive())
            mujoco.set_mjcb_passive(control.fall)
        stack.callback(mujoco.set_mjcb_control, mujoco.get_mjcb_control())
        control.install()
        yield control


def stretches(times: Array, breakpoints: tuple[float, ...], timestep: float) -> Iterator[Stretch]:
    """Yield the stretches of a run over `times` (n,) [s], each of about _LOOK steps.

    Steps between two sample times or breakpoints are equal, not longer than `timestep`, and as few
    as possible.
    """
    # In pieces, so that the stretches of a long run are not all in memory.
    columns = spans(times, breakpoints, timestep)
    for piece in pieces(len(columns[0])):
        yield from _stretches(times, *(column[piece] for column in columns))


def _stretches(times: Array, ends: Array, lengths: Array, counts: Array) -> Iterator[Stretch]:
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
        yield Stretch(ends[which], lengths[which], sizes[which], starts[sampled[which]])


def by_steps(control: Control, data: mujoco.MjData, times: Array) -> Iterator[Portion]:
    """Run over sample `times` (n,) [s] with steps not longer than the timestep.

    A row is the state before a step or inside it. Only the last row is the state at the end.
    """
    compiled, scene = control.model.compiled, control.model.scene
    step = _step if control.steps is None else _step_in_parts
    stops, of_model = times, compiled.opt.timestep
    # The parts of steps with dry friction are not known here, so steps end at the samples.
    if control.order_8 is not None and control.friction is None:
        control.order_8.pending, stops = times[1:-1], times[[0, -1]]
    for stretch in stretches(stops, scene.breakpoints, control.timestep):
        for portion in step(control, data, stretch):
            compiled.opt.timestep = of_model
            yield portion
            if portion.failure is not None:
                return
    control.span = (float(times[-1]), float(times[-1]))
    # After a step the sensors still show the state before it.
    control.forward(data, True)
    yield Portion(read_row(data)[None], np.zeros(1, np.int64), 0, 0.0, 0.0)


def _step(control: Control, data: mujoco.MjData, stretch: Stretch) -> Iterator[Portion]:
    """Take the steps of a stretch with MuJoCo."""
    compiled, sensors, warned = control.model.compiled, data.sensordata, data.warning.number
    began, start, warned_before = time.thread_time(), state_of(data), warned.copy()
    count = int(stretch.counts.sum())
    rows = np.empty((count, len(sensors) + len(warned)))
    rows[:, len(sensors) :] = warned_before
    # Slices of memoryviews copy 50 numbers faster than NumPy: a run takes 1.05 times as long as a
    # bare loop of mj_step.
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
        # A counter has changed, which is rare, so the stretch is repeated with one row per step.
        mujoco.mj_setState(compiled, data, start, STATE)
        warned[:] = warned_before
        yield from _step_in_parts(control, data, stretch)
        return
    seconds = time.thread_time() - began
    yield Portion(rows, stretch.samples, count, float(stretch.lengths.max()), seconds)


def _step_in_parts(control: Control, data: mujoco.MjData, stretch: Stretch) -> Iterator[Portion]:
    from robotball.engines.mujoco.parts import step_in_parts  # few runs need it

    return step_in_parts(control, data, stretch)
