"""Scene + Settings → Motion by MuJoCo."""

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robotball.bodies import imbalance
from robotball.contact.adaptive import by_forward
from robotball.contact.check import check_length, warn
from robotball.contact.control import controlled
from robotball.contact.dump import Window, window_around, write
from robotball.contact.model import Model, build
from robotball.contact.readings import Readings
from robotball.contact.stepping import Portion, by_steps
from robotball.contact.watch import Found, Watch
from robotball.errors import SceneWarning
from robotball.motion import Diagnostics, Fault, Motion
from robotball.rotations import Array
from robotball.scene import Scene, check_times
from robotball.settings import Settings, preset
from robotball.start import Start

Progress = Callable[[float], None]


def simulate(
    scene: Scene,
    times: Array | None = None,
    settings: Settings | str = "balanced",
    *,
    strict: bool = False,
    dump: Path | None = None,
    progress: Progress | None = None,
) -> Motion:
    """The motion of the ball as MuJoCo's contact model rolls it, with diagnostics.

    times: (n,) s, increasing from 0; the scene's own if None. Steps end on them, and are never
    longer than the settings' timestep. settings: a preset's name or Settings. A run that faults
    ends there, with fewer times; with stop_at_fault off, only one that has no state any more does.
    dump: where a window of states around the first fault goes, if there is one, for
    `robotball replay`. progress is called with the simulated fraction. Warns of a ball that is not
    balanced: it rolls, but there are no equations to compare it with; and of settings that are
    predicted to fail, which are an InputError if `strict`. Raises InputError on unusable times, an
    unknown preset and a run of more steps than the settings allow.
    """
    times = scene.times if times is None else check_times(times)
    if offset := imbalance(scene.ball):
        warnings.warn(f"{offset}; no equations describe it", SceneWarning, stacklevel=2)
    settings = preset(settings) if isinstance(settings, str) else settings
    warn(scene, settings, times, strict=strict)
    return run(build(scene, settings), times, progress, dump=dump)


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
