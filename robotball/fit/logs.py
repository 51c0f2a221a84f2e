"""Logs of a robot that was built: what its sensors read, and what its motors were commanded.

A log is a table. Any subset of sensors may be in it, each at its own times: a cell that is empty or
`nan` is no reading. Columns are known by the names and units that `trajectories` knows, those of a
hinge by the hinge's name: "frame_angle", "frame_rate", "frame_torque", "frame_command".
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
_COMMANDS: Units = dict.fromkeys(VALUES, 1.0)  # they need no conversion
_FEWEST = 4  # readings of a sensor; that its noise is known takes more
_SPARSEST = 30.0  # times √(radius/gravity), from one reading to the next at most


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
        The readings, SI units; of an attitude the unit quaternions (w, x, y, z).

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
    """Hold what a robot's sensors read, and what its motors were commanded.

    Attributes
    ----------
    name : str
        The name of the file.
    sensors : tuple of Sensor
        The sensors that the file has, each at its own times.
    commands : mapping of str to (times (n,), values (n,))
        The commands of motors by their hinges' names, each held until the next.
    notes : tuple of str
        What was understood on reading, such as units, a line each.

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
        return max(float(each.times[-1]) for each in self.sensors)


def read_log(path: str | Path, scene: Scene | str | Path) -> Log:
    """Read the log of a robot.

    Parameters
    ----------
    path : str or Path
        A CSV, NPZ or Parquet file with a column of times and those of any sensors.
    scene : Scene, str or Path
        The robot, which names the hinges: a scene, a name of the catalog, or the path of a TOML,
        MJCF or URDF file.

    Returns
    -------
    Log
        The sensors and the commands.

    Raises
    ------
    InputError
        If the file has no times or no sensor, a sensor's columns are not all there, a unit is
        unknown, a number is not finite, times do not increase or are far apart, or a quaternion has
        not length one. The message names the file. Also if `load_scene` raises it.

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
    """Return one log or several, with those that are files read."""
    given = [logs] if isinstance(logs, Log | str | Path) else logs
    return [each if isinstance(each, Log) else read_log(each, scene) for each in given]


def _log_of(table: Table, name: str, scene: Scene) -> Log:
    known = _columns_of(scene)
    driven = {hinge.name: hinge.motor is not None for hinge in scene.hinges}
    driven |= {actuator.name: True for actuator in scene.actuators}
    units = dict.fromkeys((f"{motor}_{_COMMAND}" for motor in driven), _COMMANDS)
    for of, needed in known.items():
        units |= dict.fromkeys(needed, _UNITS[of.rpartition("_")[2]])
    columns, _, notes = recognized(table, units)
    if "t" not in columns:
        raise InputError(f"there is no column of times; there are {', '.join(table.columns)}")
    times = columns["t"]
    if not np.isfinite(times).all():
        raise InputError(f"t is {times[~np.isfinite(times)][0]} in a row; each row needs its time")
    check_increasing(times)
    sensors = tuple(_sensors(columns, times, known))
    if not sensors:
        titles = [",".join(each) for each in _SENSORS.values()]
        titles += [f"{scene.hinges[0].name}_{kind}" for kind in _OF_HINGES]
        raise InputError(
            f"no sensor is in it; there are {', '.join(table.columns)}; known are "
            f"{', '.join(titles)}, and likewise of each hinge"
        )
    _check_dense(sensors, scene)
    commands = {}
    for motor, has_one in driven.items():
        column = columns.get(f"{motor}_{_COMMAND}")
        if column is None:
            continue
        if not has_one:
            raise InputError(
                f"{motor}_command: {motor} has no motor and keeps its rate exactly; give it one in "
                "the scene file"
            )
        there = np.isfinite(column)
        if not there.any():
            raise InputError(f"{motor}_command is empty")
        commands[motor] = read_only(times[there]), read_only(column[there])
    return Log(name, sensors, commands, tuple(notes))


def _check_dense(sensors: tuple[Sensor, ...], scene: Scene) -> None:
    """Raise InputError where readings are so far apart, or so late, that no motion is followed."""
    most, end = max(len(each.times) for each in sensors), max(each.times[-1] for each in sensors)
    falls = float(np.sqrt(scene.ball.radius / scene.gravity)) if scene.gravity else np.inf
    if end / most > _SPARSEST * falls:
        raise InputError(
            f"{most} readings until t = {end:.6g} s are one in {end / most:.3g} s, and a motion is "
            f"followed by one in {_SPARSEST * falls:.2g} s at least; check t, which is in s and "
            "counts from the scene's start"
        )


def _columns_of(scene: Scene) -> dict[str, tuple[str, ...]]:
    """Return the columns of sensors, those on links of a robot's own file and of hinges too."""
    of_links = {
        f"{link.name}_{kind}": tuple(f"{link.name}_{column}" for column in _SENSORS[kind])
        for link in scene.ball.links
        for kind in ("attitude", "gyro")
    }
    of_hinges = (f"{hinge.name}_{kind}" for hinge in scene.hinges for kind in _OF_HINGES)
    return _SENSORS | of_links | {each: (each,) for each in of_hinges}


def _sensors(
    columns: Mapping[str, Array], times: Array, known: Mapping[str, tuple[str, ...]]
) -> Iterator[Sensor]:
    for name, needed in known.items():
        if name == "position" and "z" not in columns:
            needed = ("x", "y")
        if (values := together(columns, needed)) is None:
            continue
        read = ~np.isnan(values).any(axis=1)
        if (worst := np.abs(values[read])).size and not worst.max() <= LARGEST:
            raise InputError(f"{name} has a reading of {worst.max():g}; check its unit")
        if read.sum() < _FEWEST:
            raise InputError(
                f"{name} has {read.sum()} readings, and needs {_FEWEST} at least; leave its "
                "columns out"
            )
        at, values = times[read], values[read]
        if name.endswith("attitude"):
            values, _ = to_unit(values, at)
        yield Sensor(name, at, values)
