"""Scene + Settings → Motion by MuJoCo."""

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from robotball.accuracy import Reached, asked, reach
from robotball.bodies import imbalance
from robotball.contact.adaptive import by_forward
from robotball.contact.control import controlled
from robotball.contact.model import Model, build
from robotball.contact.readings import Readings
from robotball.contact.stepping import by_steps
from robotball.contact.watch import find_faults
from robotball.errors import SceneWarning
from robotball.motion import Diagnostics, Fault, Motion
from robotball.rotations import Array
from robotball.scene import Scene, check_times
from robotball.settings import Settings
from robotball.start import Start

Progress = Callable[[float], None]


def simulate(
    scene: Scene,
    times: Array | None = None,
    settings: Settings | str | None = None,
    *,
    accuracy: float | None = None,
    progress: Progress | None = None,
) -> Motion:
    """The motion of the ball as MuJoCo's contact model rolls it, with diagnostics.

    times: (n,) s, increasing from 0; the scene's own if None. Steps end on them, and are never
    longer than the settings' timestep. settings: a preset's name or Settings, balanced if None.
    accuracy: instead of settings, the path error to reach, relative to the path's length.
    progress is called with the simulated fraction. A run that diverges ends there, with fewer
    times and the fault. Raises InputError on unusable times, an unknown preset or an accuracy that
    rounding forbids, and warns of an accuracy that is not reached, and of a ball that is not
    balanced: it rolls, but there are no equations to compare it with.
    """
    return simulate_with(scene, times, asked(settings, accuracy), progress=progress).motion


def simulate_with(
    scene: Scene,
    times: Array | None,
    wanted: Settings | float,
    *,
    progress: Progress | None = None,
) -> Reached:
    """`simulate` by settings or to an accuracy, with the settings that were run in the end."""
    times = scene.times if times is None else check_times(times)
    if offset := imbalance(scene.ball):
        warnings.warn(f"{offset}; no equations describe it", SceneWarning, stacklevel=3)
    if isinstance(wanted, float):
        part = 1.0  # of the work left before each run; none knows how many follow it

        def another(settings: Settings, at: Array) -> Motion:
            nonlocal part
            part /= 2
            return run(build(scene, settings), at, _told(progress, 1 - 2 * part, part))

        return reach(scene, times, wanted, another)
    motion = run(build(scene, wanted), times, progress)
    assert motion.diagnostics is not None
    return Reached(wanted, motion, motion.diagnostics.seconds)


def _told(progress: Progress | None, done: float, part: float) -> Progress | None:
    """Progress of a run that is a part of the whole."""
    return None if progress is None else lambda fraction: progress(done + part * fraction)


def run(
    model: Model, times: Array, progress: Progress | None = None, start: Start | None = None
) -> Motion:
    """`simulate` for a model that is built already and sample times (n,) [s] from 0.

    start: where to begin, if not at the scene's own start.
    """
    rows, record = _run(model, times, progress, start)
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
            faults=tuple(sorted(record.faults.values(), key=lambda fault: fault.time)),
            timestep=record.longest,
            steps=record.steps,
            seconds=record.seconds,
        ),
    )


@dataclass
class _Record:
    """What a run leaves besides its rows: the first fault of each cause, and what it took."""

    faults: dict[str, Fault] = field(default_factory=dict)
    steps: int = 0
    longest: float = 0.0
    seconds: float = 0.0

    @property
    def ended(self) -> float:
        """When the run broke off [s]; infinite if it did not."""
        return min((fault.time for fault in self.faults.values() if fault.fatal), default=np.inf)


def _run(
    model: Model, times: Array, progress: Progress | None, start: Start | None
) -> tuple[Array, _Record]:
    """Sensor rows at the times, fewer if the run broke off, and its record."""
    record, sampled, last_time = _Record(), [], -np.inf
    data = model.start_data(start)
    march = by_forward if model.settings.adaptive else by_steps
    with controlled(model) as control:
        portions = march(control, data, times)
        while True:
            began = time.thread_time()
            portion = next(portions, None)
            record.seconds += time.thread_time() - began
            if portion is None:
                break
            readings = Readings(model, portion.rows)
            for fault in find_faults(readings, last_time, portion.failure):
                record.faults.setdefault(fault.cause, fault)
            sampled.append(portion.rows[portion.sampled])
            record.steps += portion.steps
            record.longest = max(record.longest, portion.longest)
            if record.ended < np.inf:
                break
            last_time = float(readings.time[-1])
            if progress is not None:
                progress(last_time / times[-1])
    rows = np.concatenate(sampled)
    return rows[Readings(model, rows).time < record.ended], record
