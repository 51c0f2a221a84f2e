"""A model stepped by MuJoCo's own integrators, every step read."""

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from robotball.contact.control import Control
from robotball.contact.timing import Stretch, stretches
from robotball.rotations import Array


@dataclass(frozen=True)
class Portion:
    """A part of a run, between two looks at it.

    rows     (m, columns of Readings)  in the order of time
    sampled  which of them, as an index, are at the run's sample times
    steps    how many were taken
    longest  of them [s]
    failure  why the run can't go on, if it can't
    """

    rows: Array
    sampled: Array
    steps: int
    longest: float
    failure: str | None = None


def read_row(data: mujoco.MjData) -> Array:
    """The row of Readings of a state whose sensors are up to date."""
    return np.concatenate([data.sensordata, data.warning.number])


def by_steps(control: Control, data: mujoco.MjData, times: Array) -> Iterator[Portion]:
    """The run over sample `times` (n,) [s] by mj_step, in steps not longer than the timestep."""
    compiled, scene = control.model.compiled, control.model.scene
    for stretch in stretches(times, scene.breakpoints, compiled.opt.timestep):
        rows = _step(control, data, stretch)
        yield Portion(rows, stretch.samples, len(rows), float(stretch.lengths.max()))
    control.span = (times[-1], times[-1])
    mujoco.mj_forward(compiled, data)
    yield Portion(read_row(data)[None], np.array([0]), 0, 0.0)


def _step(control: Control, data: mujoco.MjData, stretch: Stretch) -> Array:
    """Rows, one a step of the stretch, each of the state before its step."""
    compiled, sensors, warned = control.model.compiled, data.sensordata, data.warning.number
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
