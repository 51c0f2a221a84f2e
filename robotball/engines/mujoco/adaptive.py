"""Integrate a model with DOP853 and MuJoCo's forward dynamics as the right-hand side.

Over 10 s it reaches a path error of 5e-14 in the time that RK4 needs for 7e-12. Below 1e-9 it is
the cheaper of the two.
"""

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise

import mujoco
import numpy as np

from robotball.engines.mujoco.control import Control, Portion, put, read_row, right_hand_side
from robotball.engines.mujoco.settings import Resolved
from robotball.motion import Fault, FaultKind
from robotball.rotations import Array
from robotball.theory.dop853 import Compensated, one_by_one

_LOOK = 64  # steps between two looks of the monitor; each takes 13 evaluations of the forces
# A run ends if at the pace of its last 1000 steps the remaining time needs more than max_steps, and
# more than _ENDLESS. A robot that leaves its standstill slowly takes some 400 steps.
_PACE, _ENDLESS = 1000, 1_000_000
# For a varying load: the error of a step as a part of the contact's depth, and the longest step
# times the contact's damping. DOP853 is stable up to 6.
_OF_DEPTH, _DAMPED = 5e-3, 4.0


def by_forward(control: Control, data: mujoco.MjData, times: Array) -> Iterator[Portion]:
    """Run over sample `times` (n,) [s] with adaptive steps.

    The integration restarts at every breakpoint of the drives, because a step's polynomial does not
    hold across it. Rows have the states at the sample times and at the end of each step.
    """
    model = control.model
    inside = [t for t in model.scene.breakpoints if t < times[-1]]
    state = np.concatenate([data.qpos, data.qvel])
    pending, remaining = times, model.settings.max_steps
    since, taken = 0.0, 0  # the time [s] of the last look at the pace, and the steps since
    for span in pairwise((0.0, *inside, times[-1])):
        solver = _solver(control, data, state, span)
        while solver.t < solver.end:
            portion, pending = _portion(control, data, solver, pending, remaining)
            remaining, taken = remaining - portion.steps, taken + portion.steps
            if taken >= _PACE and portion.failure is None:
                passed, rest = solver.t - since, times[-1] - solver.t
                if taken * rest / passed > max(remaining, _ENDLESS):
                    failure = _endless(taken, passed, rest, model.settings.max_steps)
                    portion = replace(portion, failure=failure)
                since, taken = solver.t, 0
            yield portion
            if portion.failure is not None:
                return
            if solver.t < solver.end and _stopped(control, data, solver):
                state = np.concatenate([data.qpos, data.qvel])
                solver = _solver(control, data, state, (solver.t, span[1]))
        state = solver.state


def _endless(taken: int, passed: float, rest: float, most: int) -> Fault:
    """Return the fault of a run whose last steps covered `passed` s, with `rest` s remaining."""
    why = (
        f"{taken} cover {passed:.2g} s, and the rest needs {taken * rest / passed:.2g} more; "
        f"max_steps = {most}: shorten the motion, or take a preset with a timestep"
    )
    return Fault(FaultKind.STEP_TOO_SHORT, np.nan, why, fatal=True)


def _portion(
    control: Control, data: mujoco.MjData, solver: Compensated, pending: Array, most: int
) -> tuple[Portion, Array]:
    """Take the next steps of a smooth span, at most `most`; return the later sample times too."""
    began = time.thread_time()
    rows: list[Array] = []
    sampled: list[int] = []
    lengths: list[float] = []
    failure: Fault | None = None
    stopped = False

    def read(t: float, state: Array) -> None:
        put(data, t, state)
        control.forward(data, True)
        rows.append(read_row(data))

    while solver.t < solver.end and len(lengths) < _LOOK and failure is None and not stopped:
        if len(lengths) == most:
            limit = control.model.settings.max_steps
            failure = Fault(FaultKind.OUT_OF_STEPS, np.nan, limit=limit, fatal=True)
            break
        before = solver.t
        if (message := solver.step()) is not None:
            failure = Fault(FaultKind.STEP_TOO_SHORT, np.nan, message, fatal=True)
            break
        lengths.append(solver.t - before)
        stopped = _stopped(control, data, solver)
        # A sample at the end of a span belongs to the next span, if there is one.
        inside = solver.t < solver.end or solver.end == pending[-1]
        done = int(np.searchsorted(pending, solver.t, "right" if inside else "left"))
        sampled_end = done > 0 and pending[done - 1] == solver.t
        if done:
            sampled += range(len(rows), len(rows) + done)
            for t, state in zip(pending.tolist(), solver.within(pending[:done]), strict=False):
                read(t, state)
            pending = pending[done:]
        # The monitor reads the end of every step; a sample time has its row already.
        if solver.t < solver.end and not sampled_end:
            read(solver.t, solver.state)
    portion = Portion(
        np.array(rows).reshape(len(rows), len(read_row(data))),
        np.array(sampled, dtype=np.int64),
        len(lengths),
        max(lengths, default=0.0),
        time.thread_time() - began,
        failure,
    )
    return portion, pending


def _stopped(control: Control, data: mujoco.MjData, solver: Compensated) -> bool:
    """Return whether the plane holds the shell from now on; its rolling is then zero in `data`."""
    if control.stops is None:
        return False
    put(data, solver.t, solver.state)
    return control.stops(data)


def _solver(
    control: Control, data: mujoco.MjData, state: Array, span: tuple[float, float]
) -> Compensated:
    """Return the integrator of a smooth span [s] from a state (qpos, qvel)."""
    settings, scene = control.model.settings, control.model.scene
    assert settings.rtol is not None
    put(data, span[0], state)
    control.begin(data, span)
    # The unit of lengths is the radius; angles and rates are of order one.
    scale = np.ones_like(state)
    scale[:3] = scale[len(data.qpos) : len(data.qpos) + 3] = scene.ball.radius
    longest = settings.timestep or np.inf
    if settings.softness < 1 and scene.load_varies:
        # A hard contact magnifies the rounding of Newton's solution. With rtol as the tolerance of
        # the height a robot at rest would take endless steps. With a larger tolerance, steps must
        # be short enough to damp the error.
        resolved = Resolved(scene, settings)
        stiffness, damping = resolved.normal_reference
        give = _OF_DEPTH * resolved.equilibrium_depth / settings.rtol
        for column, rate in ((2, 1.0), (len(data.qpos) + 2, stiffness**0.5)):
            scale[column] = max(scale[column], give * rate)
        longest = min(longest, _DAMPED / damping)
    stages = partial(one_by_one, right_hand_side(control.forward, data))
    return Compensated(stages, *span, state, settings.rtol, scale, longest)
