"""Logs of real robots: sensor readings and motor commands.

A log is a table with any subset of the sensors. Each sensor has its own times: empty or `nan` cells
are not readings. Column names and units are recognized as in `trajectories`; columns of a hinge
start with the hinge's name: "frame_angle", "frame_rate", "frame_torque", "frame_command".
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robotball.engines.equations import scene_of
from robotball.errors import LARGEST, InputError, named
from robotball.files import as_path
from robotball.files.columns import VALUES, Table, read_table
from robotball.files.trajectories import (
    DEGREES,
    LENGTHS,
    RATES,
    Recognized,
    Units,
    check_increasing,
    from_first,
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
_OF_HINGES = ("angle", "rate", "torque")
_COMMAND = "command"
_G = 9.80665  # m/s²
# The key is the last word of a sensor's name.
_UNITS: dict[str, Units] = {
    "position": LENGTHS,
    "attitude": {"1": 1.0},
    "gyro": RATES,
    "accelerometer": {"m/s²": 1.0, "m/s^2": 1.0, "g": _G},
    "angle": DEGREES,
    "rate": RATES,
    "torque": {"N m": 1.0, "Nm": 1.0, "N*m": 1.0, "N·m": 1.0, "mN m": 1e-3, "mNm": 1e-3},
}
_COMMANDS: Units = dict.fromkeys(VALUES, 1.0)  # units that need no conversion
# Largest readings that are plausible if no unit is given, 4000 deg/s and 40 g; the assumed unit;
# another possible unit.
_MOST = {"gyro": (70.0, "rad/s", "deg/s"), "accelerometer": (400.0, "m/s²", "g")}
_FEWEST = 4  # readings of a sensor; to estimate its noise takes more
_SPARSEST = 30.0  # largest mean interval of readings, in units of √(radius/gravity)


@dataclass(frozen=True)
class Sensor(Value):
    """Hold the readings of one sensor.

    Attributes
    ----------
    name : str
        "position", "attitude", "gyro", "shell_gyro", "accelerometer", or the name of a hinge with
        "_angle", "_rate" or "_torque".
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
        The commands of motors by hinge name. Each command is held until the next one.
    notes : tuple of str
        One line for each assumption made while reading, such as the unit of a column.

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


def read_log(
    path: str | Path, scene: Scene | str | Path, names: Mapping[str, str] | None = None
) -> Log:
    """Read the log of a robot.

    Parameters
    ----------
    path : str or Path
        A CSV, NPZ, Parquet, JSON lines or MATLAB file or a ROS bag, with times and at least one
        sensor.
    scene : Scene, str or Path
        The robot, for the names of its hinges: a scene, a catalog name, or the path of a TOML, MJCF
        or URDF file.
    names : mapping of str to str, optional
        A mapping from a column's title in the file, or the end of this title, to the column's name,
        such as {"roll_joint.position": "frame_angle [deg]"}.

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
        return _log_of(table, path.name, scene, names or {})


def logs_of(logs: Log | str | Path | Sequence[Log | str | Path], scene: Scene) -> list[Log]:
    """Return a list of logs. Reads the logs that are given as files."""
    several = [logs] if isinstance(logs, Log | str | Path) else logs
    return [log if isinstance(log, Log) else read_log(log, scene) for log in several]


def reordered(log: Log) -> Log:
    """Return a log whose quaternions are read in the order x, y, z, w."""
    rolled = [np.roll(s.values, s.name.endswith("attitude"), axis=1) for s in log.sensors]
    pairs = zip(log.sensors, rolled, strict=True)
    return replace(log, sensors=tuple(replace(s, values=values) for s, values in pairs))


def _log_of(table: Table, name: str, scene: Scene, names: Mapping[str, str]) -> Log:
    columns_of = _columns_of(scene)
    motors = {hinge.name: hinge.motor is not None for hinge in scene.hinges}
    motors |= {actuator.name: True for actuator in scene.actuators}
    units = dict.fromkeys((f"{motor}_{_COMMAND}" for motor in motors), _COMMANDS)
    for sensor, needed in columns_of.items():
        units |= dict.fromkeys(needed, _UNITS[sensor.rpartition("_")[2]])
    found = recognized(table, units, names)
    columns, notes = found.columns, found.notes
    if "t" not in columns:
        there, title = ", ".join(table.columns), next(iter(found.others), "TITLE")
        raise InputError(
            f"no column of times; the file has {there}: name it with --map '{title}=t [ms]'"
        )
    times = columns["t"]
    for sensor, needed in columns_of.items():
        if (kind := sensor.rpartition("_")[2]) in _MOST and all(c in columns for c in needed):
            notes += _check_unit(found, needed, *_MOST[kind], scene)
    if not np.isfinite(times).all():
        raise InputError(f"t is {times[~np.isfinite(times)][0]} in a row: every row needs a time")
    # A scene without changes in time may begin at any time.
    if times[0] > (0.0 if scene.steady else scene.duration):
        times, note = from_first(times)
        notes.append(note)
    check_increasing(times)
    sensors = tuple(_sensors(columns, times, columns_of))
    if not sensors:
        titles = [",".join(columns) for columns in _SENSORS.values()]
        titles += [f"{scene.hinges[0].name}_{kind}" for kind in _OF_HINGES]
        raise InputError(
            f"no sensor; the file has {', '.join(table.columns)}. Columns of sensors are "
            f"{', '.join(titles)}, and so for each hinge: rename one with --map TITLE=COLUMN"
        )
    _check_dense(sensors, scene)
    commands = {}
    for motor, has_motor in motors.items():
        column = columns.get(f"{motor}_{_COMMAND}")
        if column is None:
            continue
        if not has_motor:
            raise InputError(
                f"{motor}_command: {motor} has no motor, but a prescribed rate; add a motor in the "
                "scene file"
            )
        finite = np.isfinite(column)
        if not finite.any():
            raise InputError(f"{motor}_command has no values: remove the column")
        commands[motor] = read_only(times[finite]), read_only(column[finite])
    return Log(name, sensors, commands, tuple(notes))


def _check_unit(
    found: Recognized, names: tuple[str, ...], most: float, unit: str, other: str, scene: Scene
) -> list[str]:
    """Convert accelerations in g to m/s², and add a note.

    Raises InputError if readings without a unit are too large for a sensor, such as raw counts.
    """
    values = np.array([found.columns[name] for name in names])
    values = values[:, np.isfinite(values).all(axis=0)]
    if any(found.units[name] for name in names) or not values.size:
        return []
    if other == "g" and 0.5 < np.median(np.linalg.norm(values, axis=0)) < 1.5 < scene.gravity:
        for name in names:
            found.columns[name] = found.columns[name] * _G
        return [f"{', '.join(names)}: converted from g, because the readings are about 1"]
    axes = np.abs(values).max(axis=1)
    if (largest := float(axes.max())) <= most:
        return []
    name, whole = names[int(axes.argmax())], np.array_equal(values, np.round(values))
    title = found.titles[name]
    raise InputError(
        f"{title} reaches {largest:g}, but sensors measure at most {most:g} {unit}: "
        f"{'raw counts' if whole else 'another unit'}? Name the unit of each axis with --map "
        f"'{title}={name} [{other}]', or the size of a count: '{title}={name} [0.01 {other}]'"
    )


def _check_dense(sensors: tuple[Sensor, ...], scene: Scene) -> None:
    most = max(len(sensor.times) for sensor in sensors)
    end = max(sensor.times[-1] for sensor in sensors)
    falls = float(np.sqrt(scene.ball.radius / scene.gravity)) if scene.gravity else np.inf
    if end / most > _SPARSEST * falls:
        raise InputError(
            f"{most} readings until t = {end:.6g} s are one per {end / most:.3g} s, but at least "
            f"one per {_SPARSEST * falls:.2g} s is needed; if t has another unit, name it with "
            "--map 't=t [ms]'"
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
                f"{name} has {is_reading.sum()} readings, fewer than {_FEWEST}: remove its columns"
            )
        at, values = times[is_reading], values[is_reading]
        if name.endswith("attitude"):
            values, _ = to_unit(values, at)
        yield Sensor(name, at, values)
