"""Scene + Settings → Motion by MuJoCo."""

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robotball.bodies import imbalance
from robotball.engines.mujoco.accuracy import Reached, asked, reach
from robotball.engines.mujoco.adaptive import by_forward
from robotball.engines.mujoco.control import controlled
from robotball.engines.mujoco.fault_window import Window, window_around, write
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.monitor import Found, Watch
from robotball.engines.mujoco.precheck import check_length, warn
from robotball.engines.mujoco.readings import Readings
from robotball.engines.mujoco.settings import Settings
from robotball.engines.mujoco.stepping import Portion, by_steps
from robotball.errors import SceneWarning
from robotball.motion import Diagnostics, Fault, Loads, Motion
from robotball.rotations import Array
from robotball.scene import Scene, check_times
from robotball.start import Start

Progress = Callable[[float], None]


def simulate(
    scene: Scene,
    times: Array | None = None,
    settings: Settings | str | None = None,
    *,
    accuracy: float | None = None,
    strict: bool = False,
    dump: Path | None = None,
    progress: Progress | None = None,
) -> Motion:
    """The motion of the ball as MuJoCo's contact model rolls it, with diagnostics.

    times: (n,) s, increasing from 0; the scene's own if None. Steps end on them, and are never
    longer than the settings' timestep. settings: a preset's name or Settings, balanced if None.
    accuracy: instead of settings, the path error to reach, relative to the path's length. A run
    that faults ends there, with fewer times; with stop_at_fault off, only one that has no state
    any more does. dump: where a window of states around the first fault goes, if there is one, for
    `robotball replay`. progress is called with the simulated fraction.

    Warns of an accuracy that is not reached; of a ball that is not balanced: it rolls, but there
    are no equations to compare it with; and of settings that are predicted to fail, which are an
    InputError if `strict`. Raises InputError on unusable times, an unknown preset, an accuracy that
    rounding forbids and a run of more steps than the settings allow.
    """
    wanted = asked(settings, accuracy)
    return simulate_with(scene, times, wanted, strict=strict, dump=dump, progress=progress).motion


def simulate_with(
    scene: Scene,
    times: Array | None,
    wanted: Settings | float,
    *,
    loads: Loads | None = None,
    strict: bool = False,
    dump: Path | None = None,
    progress: Progress | None = None,
) -> Reached:
    """`simulate` by settings or to an accuracy, with the settings that were run in the end.

    loads: of the whole motion, where they are known, for the check of the friction.
    """
    times = scene.times if times is None else check_times(times)
    if offset := imbalance(scene.ball):
        warnings.warn(f"{offset}; no equations describe it", SceneWarning, stacklevel=3)
    if not isinstance(wanted, float):
        warn(scene, wanted, times, loads, strict=strict)
        motion = run(build(scene, wanted), times, progress, dump=dump)
        assert motion.diagnostics is not None
        return Reached(wanted, motion, motion.diagnostics.seconds)
    part = 1.0  # of the work left before each run; none knows how many follow it

    def another(settings: Settings, at: Array) -> Motion:
        nonlocal part
        part /= 2
        told = _told(progress, 1 - 2 * part, part)
        # The pilot runs are coarse, and go on whatever they find.
        return run(build(scene, settings), at, told, dump=dump if settings.stop_at_fault else None)

    reached = reach(scene, times, wanted, another)
    warn(scene, reached.settings, times, loads, strict=strict)
    return reached


def _told(progress: Progress | None, done: float, part: float) -> Progress | None:
    """Progress of a run that is a part of the whole."""
    return None if progress is None else lambda fraction: progress(done + part * fraction)


def run(
    model: Model,
    times: Array,
    progress: Progress | None = None,
    start: Start | None = None,
    dump: Path | None = None,
) -> Motion:
    """`simulate` for a model that is built already and sample times (n,) [s] from 0, unchecked.

    start: where to begin, if not at the scene's own start. Raises InputError for a run of more
    steps than the settings allow.
    """
    check_length(model.scene, model.settings, times)
    rows, record = _run(model, times, progress, start, wanted=dump is not None)
    if dump is not None and record.window is not None:
        write(dump, model, record.window)
    readings = Readings(model, rows)
    return Motion(
        times=times[: len(rows)],
        contact_point=readings.centre[:, :2],
        attitude=readings.attitude,
        momentum=readings.momentum,
        angular_velocity=readings.angular_velocity,
        hinge_angles=readings.hinge_angles,
        hinge_rates=readings.hinge_rates,
        loads=readings.loads,
        diagnostics=Diagnostics(
            slip=readings.slip,
            spin=readings.spin,
            depth=model.scene.ball.radius - readings.centre[:, 2],
            friction_used=readings.friction_used,
            hinge_rate_error=readings.hinge_rate_error(model.hinges),
            faults=tuple(record.faults.values()),
            timestep=record.longest,
            steps=record.steps,
            seconds=record.seconds,
        ),
    )


@dataclass
class _Record:
    """What a run leaves besides its rows: the first fault of each cause, and what it took."""

    faults: dict[str, Fault] = field(default_factory=dict)
    window: Window | None = None
    steps: int = 0
    longest: float = 0.0
    seconds: float = 0.0

    def add(self, portion: Portion, found: list[Found]) -> int | None:
        """The row at which the run ends, if it does."""
        self.steps += portion.steps
        self.longest = max(self.longest, portion.longest)
        ends = next((each.row for each in found if each.fault.fatal), None)
        for row, fault in found:
            if ends is None or row <= ends:
                self.faults.setdefault(fault.cause, fault)
        return ends


def _run(
    model: Model, times: Array, progress: Progress | None, start: Start | None, wanted: bool
) -> tuple[Array, _Record]:
    """Sensor rows at the times, fewer if the run broke off, and its record.

    wanted: whether it is to hold the window around the first fault.
    """
    record, sampled, watch = _Record(), [], Watch(model)
    data = model.start_data(start)
    march = by_forward if model.settings.adaptive else by_steps
    before: Portion | None = None
    with controlled(model) as control:
        portions = march(control, data, times)
        while True:
            began = time.thread_time()
            portion = next(portions, None)
            record.seconds += time.thread_time() - began
            if portion is None:
                break
            found = watch.look(Readings(model, portion.rows), portion.failure)
            ends = record.add(portion, found)
            if wanted and found and record.window is None:
                record.window = window_around(found, portion, before)
            kept = portion.sampled if ends is None else portion.sampled[portion.sampled < ends]
            sampled.append(portion.rows[kept])
            if ends is not None:
                break
            before = portion
            if progress is not None:
                progress(watch.last_time / times[-1])
    return np.concatenate(sampled), record
