"""Scene + Settings → Motion by MuJoCo."""

import time
from collections.abc import Callable, Iterator

import mujoco
import numpy as np

from robotball.model import Model, build
from robotball.motion import Diagnostics, Fault, Motion
from robotball.readings import Readings
from robotball.rotations import Array
from robotball.scene import Scene, check_times
from robotball.settings import Settings, preset
from robotball.start import Start
from robotball.watch import find_faults

STRETCH = 4096  # steps between two looks at the run

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
    Raises InputError on unusable times or an unknown preset.
    """
    times = scene.times if times is None else check_times(times)
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
        diagnostics=Diagnostics(
            slip=readings.slip,
            spin=readings.spin,
            depth=model.scene.ball.radius - readings.centre[:, 2],
            contact_force=readings.contact_force_world,
            spin_torque=readings.spin_torque,
            friction_used=readings.friction_used,
            hinge_rate_error=readings.hinge_rate_error,
            faults=tuple(sorted(faults, key=lambda fault: fault.time)),
            timestep=float(_steps_between(times, timestep)[0].max()),
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
    for lengths, counts, samples in _stretches(times, compiled.opt.timestep):
        began = time.perf_counter()
        rows = _step(compiled, data, lengths, counts)
        seconds += time.perf_counter() - began
        steps += len(rows)
        readings = Readings(model, rows)
        faults = find_faults(readings, last_time)
        for fault in faults:
            first_of.setdefault(fault.cause, fault)
        sampled.append(rows[samples])
        if any(fault.fatal for fault in faults):
            break
        last_time = float(readings.time[-1])
        if progress is not None:
            progress(last_time / times[-1])
    else:
        mujoco.mj_forward(compiled, data)
        sampled.append(np.concatenate([data.sensordata, data.warning.number])[None])
    rows = np.concatenate(sampled)
    ended = min((fault.time for fault in first_of.values() if fault.fatal), default=np.inf)
    return rows[Readings(model, rows).time < ended], list(first_of.values()), steps, seconds


def _steps_between(times: Array, timestep: float) -> tuple[Array, Array]:
    """Each interval's fewest equal steps not longer than `timestep`: lengths (n-1,) and counts."""
    intervals = np.diff(times)
    counts = np.ceil(intervals / timestep * (1 - 1e-9))
    return np.minimum(intervals / counts, timestep), counts


def _stretches(times: Array, timestep: float) -> Iterator[tuple[Array, Array, Array]]:
    """The run in parts of about STRETCH steps, however far apart the times are.

    Yields step lengths, how many steps of each, and which steps start at one of the times.
    """
    lengths, counts = _steps_between(times, timestep)
    parts = np.ceil(counts / STRETCH).astype(int)
    first = np.cumsum(parts) - parts
    begins = np.isin(np.arange(parts.sum()), first)
    lengths = np.repeat(lengths, parts)
    sizes = np.full(len(lengths), STRETCH)
    sizes[first + parts - 1] = counts - STRETCH * (parts - 1)
    stretch = (np.cumsum(sizes) - 1) // STRETCH
    for which in np.split(np.arange(len(sizes)), np.flatnonzero(np.diff(stretch)) + 1):
        starts = np.cumsum(sizes[which]) - sizes[which]
        yield lengths[which], sizes[which], starts[begins[which]]


def _step(model: mujoco.MjModel, data: mujoco.MjData, lengths: Array, counts: Array) -> Array:
    """Rows (sum(counts), …) for Readings, each of the state before its step."""
    option, timestep, sensors = model.opt, model.opt.timestep, data.sensordata
    warnings = data.warning.number
    rows = np.empty((int(counts.sum()), len(sensors) + len(warnings)))
    sensor_columns, warning_columns = rows[:, : len(sensors)], rows[:, len(sensors) :]
    row = 0
    for length, count in zip(lengths.tolist(), counts.tolist(), strict=True):
        option.timestep = length
        for _ in range(count):
            mujoco.mj_step(model, data)
            sensor_columns[row] = sensors
            warning_columns[row] = warnings
            row += 1
    option.timestep = timestep
    return rows
