"""Scene + Settings → Motion by MuJoCo."""

import time
import warnings
from collections.abc import Callable

import mujoco
import numpy as np

from robotball.bodies import imbalance
from robotball.contact.control import Control, controlled
from robotball.contact.model import Model, build
from robotball.contact.readings import Readings
from robotball.contact.timing import Stretch, longest_step, stretches
from robotball.contact.watch import find_faults
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
    progress: Progress | None = None,
) -> Motion:
    """The motion of the ball as MuJoCo's contact model rolls it, with diagnostics.

    times: (n,) s, increasing from 0; the scene's own if None. Steps end on them, and are never
    longer than the settings' timestep. settings: a preset's name or Settings. progress is called
    with the simulated fraction. A run that diverges ends there, with fewer times and the fault.
    Raises InputError on unusable times or an unknown preset, and warns of a ball that is not
    balanced: it rolls, but there are no equations to compare it with.
    """
    times = scene.times if times is None else check_times(times)
    if offset := imbalance(scene.ball):
        warnings.warn(f"{offset}; no equations describe it", SceneWarning, stacklevel=2)
    settings = preset(settings) if isinstance(settings, str) else settings
    return run(build(scene, settings), times, progress)


def run(
    model: Model, times: Array, progress: Progress | None = None, start: Start | None = None
) -> Motion:
    """`simulate` for a model that is built already and sample times (n,) [s] from 0.

    start: where to begin, if not at the scene's own start.
    """
    timestep = float(model.compiled.opt.timestep)
    rows, faults, steps, seconds = _run(model, times, progress, start)
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
            faults=tuple(sorted(faults, key=lambda fault: fault.time)),
            timestep=longest_step(times, model.scene.breakpoints, timestep),
            steps=steps,
            seconds=seconds,
        ),
    )


def _run(
    model: Model, times: Array, progress: Progress | None, start: Start | None
) -> tuple[Array, list[Fault], int, float]:
    """Sensor rows at the times (fewer if the run broke off), faults, steps and their seconds."""
    compiled, data = model.compiled, model.start_data(start)
    first_of: dict[str, Fault] = {}
    sampled: list[Array] = []
    steps, seconds, last_time = 0, 0.0, -np.inf
    with controlled(model) as control:
        for stretch in stretches(times, model.scene.breakpoints, compiled.opt.timestep):
            began = time.perf_counter()
            rows = _step(model, data, stretch, control)
            seconds += time.perf_counter() - began
            steps += len(rows)
            readings = Readings(model, rows)
            faults = find_faults(readings, last_time)
            for fault in faults:
                first_of.setdefault(fault.cause, fault)
            sampled.append(rows[stretch.samples])
            if any(fault.fatal for fault in faults):
                break
            last_time = float(readings.time[-1])
            if progress is not None:
                progress(last_time / times[-1])
        else:
            control.span = (times[-1], times[-1])
            mujoco.mj_forward(compiled, data)
            sampled.append(np.concatenate([data.sensordata, data.warning.number])[None])
    rows = np.concatenate(sampled)
    ended = min((fault.time for fault in first_of.values() if fault.fatal), default=np.inf)
    return rows[Readings(model, rows).time < ended], list(first_of.values()), steps, seconds


def _step(model: Model, data: mujoco.MjData, stretch: Stretch, control: Control) -> Array:
    """Rows for Readings, one a step of the stretch, each of the state before its step."""
    compiled, sensors, warned = model.compiled, data.sensordata, data.warning.number
    option, timestep = compiled.opt, compiled.opt.timestep
    rows = np.empty((int(stretch.counts.sum()), len(sensors) + len(warned)))
    sensor_columns, warning_columns = rows[:, : len(sensors)], rows[:, len(sensors) :]
    row = 0
    for span, length, count in stretch:
        option.timestep, control.span = length, span
        for _ in range(count):
            mujoco.mj_step(compiled, data)
            sensor_columns[row] = sensors
            warning_columns[row] = warned
            row += 1
    option.timestep = timestep
    return rows
