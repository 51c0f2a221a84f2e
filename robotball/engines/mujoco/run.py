"""One run of a built model: stepped over its times, monitored at every step, and recorded."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from robotball.engines import Progress
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.limits import check_length
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.monitor import Found, Monitor
from robotball.engines.mujoco.readings import Readings
from robotball.engines.mujoco.stepping import Control, Portion, by_steps, controlled
from robotball.files.replacing import discard
from robotball.motion import PIECE, ContactMotion, ContactReport, Fault, FaultKind, joined
from robotball.rotations import Array
from robotball.scene import Start

if TYPE_CHECKING:
    from robotball.engines.mujoco.fault_window import FaultWindow


def run(
    model: Model,
    times: Array,
    progress: Progress | None = None,
    fault_window: Path | None = None,
    start: Start | None = None,
) -> ContactMotion:
    """Return the motion of a built model at sample times (n,) [s] from 0, which are not checked.

    start: where to begin, if not at the scene's own start; fault_window: the file for the states
    around the first fault, which is taken away if there is none. Raises InputError for a run of
    more steps than the settings allow.
    """
    check_length(model.scene, model.settings, times)
    record = Record(keeps_window=fault_window is not None)
    with controlled(model) as control:
        portions = _march(control, model.start_data(start), times)
        motion = recorded(times, monitored(model, times, portions, record, progress), record)
    if fault_window is not None:
        if record.window is None:
            discard(fault_window)  # a former run's would pass for this one's
        else:
            from robotball.engines.mujoco.fault_window import write

            write(fault_window, record.window)
    return motion


def held(motion: ContactMotion) -> ContactMotion:
    """Return the motion of a run, held against runs in other steps where its M is no witness."""
    if motion.scene.not_reduced is None:
        return motion
    from robotball.engines.mujoco.accuracy import checked

    return checked(motion, lambda other, at: run(build(motion.scene, other), at))


def recorded(times: Array, readings: Iterable[Readings], record: "Record") -> ContactMotion:
    """Return the motion of a run's readings at sample times (n,), and of its record."""
    motion = joined(_parts(times, _in_pieces(readings)), len(times))
    # A note is an event of the motion, as a motor at the limit that its scene gives it.
    report = replace(
        motion.report,
        faults=tuple(each for each in record.faults.values() if not each.note),
        notes=tuple(each for each in record.faults.values() if each.note),
        timestep=record.longest,
        steps=record.steps,
        seconds=record.seconds,
        total_seconds=record.seconds,
    )
    return replace(motion, times=times[: len(motion.times)], report=report)


def _parts(times: Array, some: Iterator[Readings]) -> Iterator[ContactMotion]:
    """Return the motion of consecutive readings, its report filled as far as these go."""
    done = 0
    for readings in some:
        model, count = readings.model, len(readings.rows)
        yield ContactMotion(
            scene=model.scene, engine=LABEL, times=times[done : done + count],
            contact_point=readings.centre[:, :2], attitude=readings.attitude,
            momentum=readings.momentum, angular_velocity=readings.angular_velocity,
            hinge_angles=readings.hinge_angles, hinge_rates=readings.hinge_rates,
            loads=readings.loads,
            report=ContactReport(
                settings=model.settings, slip=readings.slip, spin=readings.spin,
                depth=model.scene.ball.radius - readings.centre[:, 2],
                friction_used=readings.friction_used,
                hinge_rate_error=readings.hinge_rate_error(model.hinges),
                # Of the whole run; `run` fills them in once it has ended.
                faults=(), timestep=0.0, steps=0, seconds=0.0, total_seconds=0.0,
            ),
        )  # fmt: skip
        done += count


def _in_pieces(readings: Iterable[Readings]) -> Iterator[Readings]:
    """Join consecutive readings, so that each piece is long enough to be converted cheaply."""
    waiting: list[Readings] = []
    for some in readings:
        waiting.append(some)
        if sum(len(each.rows) for each in waiting) >= PIECE:
            yield _together(waiting)
            waiting = []
    if waiting:
        yield _together(waiting)


def _together(readings: list[Readings]) -> Readings:
    """Join readings. A single one is returned itself, with what the monitor has cached in it."""
    if len(readings) == 1:
        return readings[0]
    return Readings(readings[0].model, np.concatenate([each.rows for each in readings]))


@dataclass
class Record:
    """The record of a run besides its rows: the first fault of each kind, and its cost.

    keeps_window: whether the window around the first fault is kept.
    """

    keeps_window: bool
    faults: dict[tuple[FaultKind, str], Fault] = field(default_factory=dict)
    window: "FaultWindow | None" = None
    steps: int = 0
    longest: float = 0.0
    seconds: float = 0.0

    def add(self, portion: Portion, found: list[Found]) -> int | None:
        """Add a portion with its faults, and return the row at which the run ends, if it does."""
        self.steps += portion.steps
        self.longest = max(self.longest, portion.longest)
        ends = next((each.row for each in found if each.fault.fatal), None)
        for row, fault in found:
            if ends is None or row <= ends:
                self.faults.setdefault((fault.kind, fault.subject), fault)
        return ends


def monitored(
    model: Model,
    times: Array,
    portions: Iterator[Portion],
    record: Record,
    progress: Progress | None = None,
) -> Iterator[Readings]:
    """Yield the readings of portions at the times, until the run breaks off; fill the record."""
    monitor = Monitor(model)
    before: Portion | None = None
    while True:
        # Processor time of this thread: a busy machine makes no run look slow.
        began = time.thread_time()
        portion = next(portions, None)
        record.seconds += time.thread_time() - began
        if portion is None:
            break
        readings = Readings(model, portion.rows)
        found = monitor.look(readings, portion.failure)
        ends = record.add(portion, found)
        wrong = [each for each in found if not each.fault.note]
        if record.keeps_window and wrong and record.window is None:
            from robotball.engines.mujoco.fault_window import window_around

            record.window = window_around(model, wrong, portion, before)
        # The row of the fatal fault is bad itself, so the motion ends before it.
        kept = portion.sampled if ends is None else portion.sampled[portion.sampled < ends]
        whole = len(kept) == len(portion.rows)
        yield readings if whole else Readings(model, portion.rows[kept])
        if ends is not None:
            break
        before = portion  # a window may reach back into it
        if progress is not None:
            progress(monitor.last_time / times[-1])


def _march(control: Control, data: mujoco.MjData, times: Array) -> Iterator[Portion]:
    """Return the portions of a run, by MuJoCo's own steps or by those of DOP853."""
    if not control.model.settings.adaptive:
        return by_steps(control, data, times)
    from robotball.engines.mujoco.adaptive import by_forward

    return by_forward(control, data, times)
