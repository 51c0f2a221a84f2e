"""Logs of real robots: sensor readings and motor commands.

A log is a table with any subset of the sensors. Each sensor has its own times: empty or `nan` cells
are not readings. Column names and units are recognized as in `trajectories`; columns of a hinge
start with the hinge's name: "frame_angle", "frame_rate", "frame_torque", "frame_command".
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robotball.engines.equations import scene_of
from robotball.errors import LARGEST, InputError, named
from robotball.files import as_path
from robotball.files.columns import VALUES, Table, read_table
from robotball.files.trajectories import (
    LENGTHS,
    RATES,
    TAU,
    Units,
    check_increasing,
    recognized,
    to_unit,
    together,
)
from robotball.robot.ball import Value, read_only
from robotball.robot.scene import Scene
from robotball.rotations import Array

_SENSORS = {
    "position": ("x", "y", "z"),
    "attitude": ("qw", "qx", "qy", "qz"),
    "gyro": ("wx", "wy", "wz"),
    "shell_gyro": ("shell_wx", "shell_wy", "shell_wz"),
    "accelerometer": ("ax", "ay", "az"),
}
_OF_HINGES = ("angle", "rate", "torque", "current")
_COMMAND = "command"
# By the last word of a sensor's name.
_UNITS: dict[str, Units] = {
    "position": LENGTHS,
    "attitude": {"1": 1.0},
    "gyro": RATES,
    "accelerometer": {"m/s²": 1.0, "m/s^2": 1.0, "g": 9.80665},
    "angle": {"rad": 1.0, "deg": TAU / 360, "rev": TAU, "°": TAU / 360},
    "rate": RATES,
    "torque": {"N m": 1.0, "Nm": 1.0, "N*m": 1.0, "N·m": 1.0, "mN m": 1e-3, "mNm": 1e-3},
    "current": {"A": 1.0, "mA": 1e-3},
}
_COMMANDS: Units = dict.fromkeys(VALUES, 1.0)  # units that need no conversion
_FEWEST = 4  # readings of a sensor; estimating its noise takes more
_SPARSEST = 30.0  # largest mean interval of readings, in units of √(radius/gravity)


@dataclass(frozen=True)
class Sensor(Value):
    """Hold the readings of one sensor.

    Attributes
    ----------
    name : str
        "position", "attitude", "gyro", "shell_gyro", "accelerometer", or the name of a hinge with
        "_angle", "_rate", "_torque" or "_current".
    times : (n,), s
        Increasing times.
    values : (n, k)
        The readings, SI units; unit quaternions (w, x, y, z) for an attitude.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> rb.Sensor("frame_angle", np.array([0.0, 0.1]), np.array([[0.0], [0.2]])).values.shape
    (2, 1)
    """

    name: str
    times: Array
    values: Array


@dataclass(frozen=True)
class Log(Value):
    """Hold the readings of a robot's sensors and the commands of its motors.

    Attributes
    ----------
    name : str
        The name of the file.
    sensors : tuple of Sensor
        The sensors in the file, each with its own times.
    commands : mapping of str to (times (n,), values (n,))
        The commands of motors by hinge name, each held until the next.
    notes : tuple of str
        One line for each interpretation made while reading, such as of a unit.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.integrate("pendulum_robot", 0.5).save("run.csv")
    >>> log = rb.read_log("run.csv", "pendulum_robot")
    >>> [sensor.name for sensor in log.sensors][:3]
    ['position', 'attitude', 'gyro']
    """

    name: str
    sensors: tuple[Sensor, ...]
    commands: Mapping[str, tuple[Array, Array]]
    notes: tuple[str, ...] = ()

    @property
    def end(self) -> float:
        """The time of the last reading [s]."""
        return max(float(sensor.times[-1]) for sensor in self.sensors)


def read_log(path: str | Path, scene: Scene | str | Path) -> Log:
    """Read the log of a robot.

    Parameters
    ----------
    path : str or Path
        A CSV, NPZ or Parquet file with a time column and columns of any sensors.
    scene : Scene, str or Path
        The robot, for the names of its hinges: a scene, a catalog name, or the path of a TOML, MJCF
        or URDF file.

    Returns
    -------
    Log
        The sensors and the commands.

    Raises
    ------
    InputError
        If the file has no times or sensors, columns of a sensor are missing, a unit is unknown, a
        number is not finite, times do not increase or are too far apart, or a quaternion is not a
        unit quaternion. The message names the file. Also if `load_scene` raises it.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.integrate("pendulum_robot", 0.5).save("run.csv")
    >>> rb.read_log("run.csv", "pendulum_robot").end
    0.5
    """
    path, scene = as_path("a log", path), scene_of(scene)
    table = read_table(path, gaps=True)
    with named(path):
        return _log_of(table, path.name, scene)


def logs_of(logs: Log | str | Path | Sequence[Log | str | Path], scene: Scene) -> list[Log]:
    """Return one or several logs, after reading the files among them."""
    several = [logs] if isinstance(logs, Log | str | Path) else logs
    return [log if isinstance(log, Log) else read_log(log, scene) for log in several]


def _log_of(table: Table, name: str, scene: Scene) -> Log:
    columns_of = _columns_of(scene)
    motors = {hinge.name: hinge.motor is not None for hinge in scene.hinges}
    motors |= {actuator.name: True for actuator in scene.actuators}
    units = dict.fromkeys((f"{motor}_{_COMMAND}" for motor in motors), _COMMANDS)
    for sensor, needed in columns_of.items():
        units |= dict.fromkeys(needed, _UNITS[sensor.rpartition("_")[2]])
    columns, _, notes = recognized(table, units)
    if "t" not in columns:
        raise InputError(f"no column of times; the file has {', '.join(table.columns)}")
    times = columns["t"]
    if not np.isfinite(times).all():
        raise InputError(f"t is {times[~np.isfinite(times)][0]} in a row; every row needs a time")
    check_increasing(times)
    sensors = tuple(_sensors(columns, times, columns_of))
    if not sensors:
        titles = [",".join(columns) for columns in _SENSORS.values()]
        titles += [f"{scene.hinges[0].name}_{kind}" for kind in _OF_HINGES]
        raise InputError(
            f"no sensor; the file has {', '.join(table.columns)}; known columns are "
            f"{', '.join(titles)}, and the same for each hinge"
        )
    _check_dense(sensors, scene)
    commands = {}
    for motor, has_motor in motors.items():
        column = columns.get(f"{motor}_{_COMMAND}")
        if column is None:
            continue
        if not has_motor:
            raise InputError(
                f"{motor}_command: {motor} has no motor, its rate is prescribed; add a motor in "
                "the scene file"
            )
        finite = np.isfinite(column)
        if not finite.any():
            raise InputError(f"{motor}_command has no values: remove the column")
        commands[motor] = read_only(times[finite]), read_only(column[finite])
    return Log(name, sensors, commands, tuple(notes))


def _check_dense(sensors: tuple[Sensor, ...], scene: Scene) -> None:
    most = max(len(sensor.times) for sensor in sensors)
    end = max(sensor.times[-1] for sensor in sensors)
    falls = float(np.sqrt(scene.ball.radius / scene.gravity)) if scene.gravity else np.inf
    if end / most > _SPARSEST * falls:
        raise InputError(
            f"{most} readings until t = {end:.6g} s are one per {end / most:.3g} s; at least one "
            f"per {_SPARSEST * falls:.2g} s is needed; check t, which must be in s and count from "
            "the scene's start"
        )


def _columns_of(scene: Scene) -> dict[str, tuple[str, ...]]:
    of_links = {
        f"{link.name}_{kind}": tuple(f"{link.name}_{column}" for column in _SENSORS[kind])
        for link in scene.ball.links
        for kind in ("attitude", "gyro")
    }
    of_hinges = (f"{hinge.name}_{kind}" for hinge in scene.hinges for kind in _OF_HINGES)
    return _SENSORS | of_links | {sensor: (sensor,) for sensor in of_hinges}


def _sensors(
    columns: Mapping[str, Array], times: Array, columns_of: Mapping[str, tuple[str, ...]]
) -> Iterator[Sensor]:
    for name, needed in columns_of.items():
        if name == "position" and "z" not in columns:
            needed = ("x", "y")
        if (values := together(columns, needed)) is None:
            continue
        is_reading = ~np.isnan(values).any(axis=1)
        if (sizes := np.abs(values[is_reading])).size and not sizes.max() <= LARGEST:
            raise InputError(f"{name} has a reading of {sizes.max():g}; check its unit")
        if is_reading.sum() < _FEWEST:
            raise InputError(
                f"{name} has {is_reading.sum()} readings, at least {_FEWEST} are needed: remove "
                "its columns"
            )
        at, values = times[is_reading], values[is_reading]
        if name.endswith("attitude"):
            values, _ = to_unit(values, at)
        yield Sensor(name, at, values)
