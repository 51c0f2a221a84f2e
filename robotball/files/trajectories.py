"""Write motions as tables, and read trajectories that any simulator wrote.

A motion of robotball has all its arrays as named columns, and a header with its scene and engine.
Another program's trajectory needs time, position and attitude; its columns are known by many names
and in many units, and are converted to SI units.
"""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robotball.errors import LARGEST, InputError, named
from robotball.files import as_path
from robotball.files.columns import Table, read_table, write_table
from robotball.files.scene_writer import toml_of
from robotball.robot.ball import Value, read_only
from robotball.robot.scene import Scene
from robotball.rotations import Array

FORMAT = "robotball motion 1"  # by which `recorded` knows a file that has all arrays
_Place = tuple[str, ...]
Units = dict[str, float]  # each unit in SI units


@dataclass(frozen=True)
class _Array:
    """An array of a motion: its place, the names of its columns, their unit and dimension.

    dimension: "" for an array (n,), else that of its columns. Vectors in world and in frame axes
    have dimensions of different names.
    """

    place: _Place
    columns: tuple[str, ...]
    unit: str
    dimension: str = ""


def _layout(scene: Scene) -> Iterator[_Array]:
    """Yield the arrays of a motion."""
    hinges = [hinge.name for hinge in scene.hinges]

    def of_hinges(what: str) -> tuple[str, ...]:
        return tuple(f"{name}_{what}" for name in hinges)

    yield _Array(("times",), ("t",), "s")
    yield _Array(("contact_point",), ("x", "y"), "m", "plane")
    yield _Array(("attitude",), ("qw", "qx", "qy", "qz"), "1", "quaternion")
    yield _Array(("angular_velocity",), ("wx", "wy", "wz"), "rad/s", "frame")
    yield _Array(("momentum",), ("Mx", "My", "Mz"), "kg m²/s", "world")
    yield _Array(("hinge_angles",), of_hinges("angle"), "rad", "hinge")
    yield _Array(("hinge_rates",), of_hinges("rate"), "rad/s", "hinge")
    yield _Array(("loads", "contact_force"), ("force_x", "force_y", "force_z"), "N", "world")
    yield _Array(("loads", "spin_torque"), ("spin_torque",), "N m")
    yield _Array(("loads", "motor_torques"), of_hinges("torque"), "N m", "hinge")


# The arrays (n,) of a contact engine's report, and their units.
_REPORT = {"slip": "m/s", "spin": "rad/s", "depth": "m", "friction_used": "1"}
_REPORT["hinge_rate_error"] = "1"


def dataset_of(scene: Scene, engine: Mapping[str, str], arrays: Mapping[_Place, Array]) -> Any:
    """Return the arrays of a motion as an xarray.Dataset, with units as attributes.

    Raises InputError if xarray is not installed.
    """
    try:
        import xarray
    except ImportError:
        raise InputError(
            "to_xarray needs xarray: install robotball's extra `xarray`, or pip install xarray"
        ) from None
    coordinates: dict[str, Any] = {
        "time": ("time", arrays[("times",)], {"units": "s"}),
        "plane": ["X", "Y"],
        "world": ["X", "Y", "Z"],
        "frame": ["x", "y", "z"],
        "quaternion": ["w", "x", "y", "z"],
        "hinge": [hinge.name for hinge in scene.hinges],
    }
    variables: dict[str, Any] = {}
    for each in _layout(scene):
        dimensions = ("time", each.dimension) if each.dimension else ("time",)
        variables[each.place[-1]] = (dimensions, arrays[each.place], {"units": each.unit})
    del variables["times"]
    for name, unit in _REPORT.items():
        if ("report", name) in arrays:
            variables[name] = ("time", arrays[("report", name)], {"units": unit})
    attributes = {"scene": scene.name, "engine": engine["name"], "version": engine["version"]}
    return xarray.Dataset(variables, coordinates, attributes)


def write_motion(
    path: Path,
    scene: Scene,
    engine: Mapping[str, str],
    arrays: Mapping[_Place, Array],
    timestep: float | None = None,
) -> None:
    """Write a motion of a scene, by the places of its arrays, with its engine's label.

    timestep: of a contact engine [s]. Raises InputError where the file cannot be written.
    """
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    for each in _layout(scene):
        array, names = arrays[each.place], each.columns
        columns.update(zip(names, array.reshape(len(array), len(names)).T, strict=True))
        units.update(dict.fromkeys(names, each.unit))
    header = {"format": FORMAT, "engine": json.dumps(dict(engine), ensure_ascii=False)}
    if timestep is not None:
        header["timestep"] = repr(float(timestep))
    # The whole scene, so that the file can be compared without another file beside it.
    header["scene"] = scene.name
    try:
        header["scene_toml"] = toml_of(scene)
    except InputError as error:
        header["scene_toml_missing"] = str(error)
    write_table(path, Table(columns, units, header))


def arrays_of(table: Table, scene: Scene) -> dict[_Place, Array]:
    """Return a motion's arrays by their places. Raises InputError for missing columns.

    The shapes are those that a motion of the scene has.
    """
    arrays: dict[_Place, Array] = {}
    for each in _layout(scene):
        missing = [name for name in each.columns if name not in table.columns]
        if missing:
            raise InputError(f"{', '.join(missing)} are missing: it is no motion of {scene.name}")
        columns = [table.columns[name] for name in each.columns]
        # A single hinge has one column as well, and an array (n, 1).
        arrays[each.place] = np.stack(columns, axis=1) if each.dimension else columns[0]
    return arrays


# What columns are called, without units, brackets, capitals and separators: * is their letter.
# Then the names of arrays (n, k), of which an NPZ has the columns as name.0, name.1, …
_NAMES = {
    ("x", "y", "z"): (
        "* p* pos* *pos position* poseposition*", "position positions pos xyz contactpoint"
    ),
    ("qw", "qx", "qy", "qz"): (
        "q* quat* quaternion* orientation* rot* poseorientation*",
        "attitude quaternion quat q orientation",
    ),
    ("wx", "wy", "wz"): (
        "w* omega* angvel* angularvelocity* gyro* ω* twistangular*",
        "angularvelocity omega w angvel",
    ),
    ("Mx", "My", "Mz"): ("m* momentum*", "momentum m"),
}  # fmt: skip
_KNOWN = {
    **dict.fromkeys(["t", "time", "times", "timestamp", "stamp", "sec", "seconds", "simtime"], "t"),
    **{"contactx": "x", "contacty": "y", "height": "z"},
    **{
        alias: name
        for names, (columns, arrays) in _NAMES.items()
        for i, name in enumerate(names)
        for alias in (*columns.replace("*", name[-1]).split(), *(f"{a}{i}" for a in arrays.split()))
    },
}
_NEEDED = ("t", "x", "y", "qw", "qx", "qy", "qz")
LENGTHS = {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
_TIMES = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
TAU = 2 * np.pi
RATES = {"rad/s": 1.0, "1/s": 1.0, "deg/s": TAU / 360, "rpm": TAU / 60, "rev/s": TAU}
# A quaternion has no unit, and momentum is taken in kg m²/s alone.
_UNITS = {"t": _TIMES, **dict.fromkeys("xyz", LENGTHS), **dict.fromkeys(("wx", "wy", "wz"), RATES)}
_AS_WRITTEN = {"°/s": "deg/s", "µm": "um", "μm": "um", "rad/sec": "rad/s", "rad s^-1": "rad/s"}
_NO_QUATERNION = 0.02  # off length one: more is no rounding
_ROUNDED = 1e-6  # off length one: single precision, which is not worth a note
_NO_UNIT = ("", "-", "1")
_FINITE = f"it must be finite, and at most {LARGEST:g} in size"


@dataclass(frozen=True)
class Trajectory(Value):
    """Hold a ball's motion as a file has it, in SI units.

    Frames and origins are those of the file.

    Attributes
    ----------
    name : str
        The name of the file.
    times : (n,), s
        Increasing times from 0 or later.
    position : (n, 3), m
        The ball's position. Its third column is NaN if the file has no height.
    attitude : (n, 4)
        Unit quaternions (w, x, y, z).
    angular_velocity : (n, 3), rad/s, or None
        The angular velocity of the frame. None if the file has none.
    momentum : (n, 3), kg m²/s, or None
        The momentum M. None if the file has none.
    others : mapping of str to (n,), or None
        The columns of other names.
    header : mapping of str to str, or None
        The header of the file.
    notes : tuple of str
        What was changed on reading, such as units, a line each.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> times = np.linspace(0.0, 0.5, 26)
    >>> still = np.tile([1.0, 0.0, 0.0, 0.0], (26, 1))
    >>> trajectory = rb.Trajectory("still", times, np.zeros((26, 3)), still)
    >>> motion = rb.recorded(rb.load_scene("fig12"), trajectory)
    >>> print(f"{motion.path_length:.3f} m")
    0.000 m
    """

    name: str
    times: Array
    position: Array
    attitude: Array
    angular_velocity: Array | None = None
    momentum: Array | None = None
    others: Mapping[str, Array] | None = None
    header: Mapping[str, str] | None = None
    notes: tuple[str, ...] = ()


def read_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory that any simulator wrote.

    Time, position and attitude are needed. Columns are known by many names and in many units, and
    are converted to SI units.

    Parameters
    ----------
    path : str or Path
        A CSV, NPZ or Parquet file.

    Returns
    -------
    Trajectory
        The trajectory, with a note on each change that was made on reading.

    Raises
    ------
    InputError
        If columns are missing, a unit is unknown, numbers are not finite, times do not increase, or
        quaternions do not have length one. The message names the file.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.integrate(rb.load_scene("fig12"), 0.5).save("run.csv")
    >>> trajectory = rb.read_trajectory("run.csv")
    >>> trajectory.position.shape, trajectory.notes
    ((26, 3), ())
    """
    path = as_path("a trajectory", path)
    table = read_table(path)
    with named(path):
        return _trajectory_of(table, path.name)


def _trajectory_of(table: Table, name: str) -> Trajectory:
    """Return the trajectory of a table. Raises InputError as `read_trajectory` does."""
    columns, others, notes = recognized(table, {})
    missing = [each for each in _NEEDED if each not in columns]
    if missing:
        there, needed = ", ".join(table.columns) or "none", ",".join(_NEEDED)
        raise InputError(
            f"the columns {','.join(missing)} are missing; there are {there}, and needed {needed}"
        )
    for each, column in columns.items():
        _check_finite(each, column, columns["t"])
    times = columns["t"]
    check_increasing(times)
    attitude = np.stack([columns[each] for each in ("qw", "qx", "qy", "qz")], axis=1)
    attitude, rounded = to_unit(attitude, times)
    height = columns.get("z", np.full(len(times), np.nan))
    return Trajectory(
        name=name,
        times=times,
        position=np.stack([columns["x"], columns["y"], height], axis=1),
        attitude=attitude,
        angular_velocity=together(columns, ("wx", "wy", "wz")),
        momentum=together(columns, ("Mx", "My", "Mz")),
        others=others,
        header=table.header,
        notes=(*notes, *rounded),
    )


def recognized(
    table: Table, more: dict[str, Units]
) -> tuple[dict[str, Array], dict[str, Array], list[str]]:
    """Return the known columns by our names, in SI units, the others by their own, and notes.

    more: further columns that are known, by this name alone, with the units that they can have.
    """
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    others: dict[str, Array] = {}
    came_as: dict[str, str] = {}
    for title, column in table.columns.items():
        name, unit = _parsed(title)
        if name is None and _without_unit(title)[0] in more:
            name, unit = _without_unit(title)
        if name is None:
            others[title] = read_only(column)
            continue
        if name in columns:
            raise InputError(f"{came_as[name]!r} and {title!r} are both the column {name}")
        columns[name], came_as[name] = column, title
        units[name] = unit or table.units.get(title, "")
    return columns, others, [*table.notes, *_made_si(columns, units, _UNITS | more)]


def _parsed(title: str) -> tuple[str | None, str | None]:
    """Return a column's name and its title's unit: `x`, `x [mm]`, `x_mm`, `pos.x (mm)`."""
    bare, unit = _without_unit(title)
    name = _KNOWN.get(_plain(bare))
    if name is None and "_" in bare:
        first, _, last = bare.rpartition("_")
        name = _KNOWN.get(_plain(first))
        # `x_mm` is x in mm, but `x_error` is another column.
        if name is None or _unit_name(last) not in _UNITS.get(name, {}):
            return None, None
        unit = last
    return name, unit


def _without_unit(title: str) -> tuple[str, str | None]:
    """Return a title without its unit in brackets, and the unit."""
    found = re.match(r"(.*?)\s*[\[(](.*?)[\])]\s*$", title)
    return (found[1], found[2]) if found else (title, None)


def _plain(title: str) -> str:
    return re.sub(r"[\s_./:\-]", "", title).lower()


def _unit_name(unit: str) -> str:
    return _AS_WRITTEN.get(unit.strip(), unit.strip())


def _made_si(
    columns: dict[str, Array], units: Mapping[str, str], units_of: Mapping[str, Units]
) -> list[str]:
    """Turn columns into SI units, in place. Returns a note for each other unit."""
    changed: dict[str, list[str]] = {}
    for name, known in units_of.items():
        unit = _unit_name(units.get(name, ""))
        # Without a unit the column is in SI units.
        if unit in _NO_UNIT:
            continue
        if unit not in known:
            raise InputError(f"{name} is in {unit!r}; it can be in {', '.join(known)}")
        if known[unit] != 1.0:
            columns[name] = columns[name] * known[unit]
            changed.setdefault(unit, []).append(name)
    return [f"{', '.join(names)}: in {unit}, as the file says" for unit, names in changed.items()]


def _check_finite(name: str, column: Array, times: Array) -> None:
    bad = np.flatnonzero(~(np.abs(column) <= LARGEST))
    if len(bad):
        i = int(bad[0])
        more = f", and in {len(bad) - 1} more" if len(bad) > 1 else ""
        at = f" (t = {times[i]:g} s)" if name != "t" else ""
        raise InputError(f"{name} is {column[i]} in row {i + 1}{at}{more}; {_FINITE}")


def check_increasing(times: Array) -> None:
    if len(times) < 2:
        raise InputError(f"it has {len(times)} row of numbers, and at least two are needed")
    # The first fault alone, by its row: the others mostly follow from it.
    late = np.flatnonzero(np.diff(times) <= 0)
    if len(late):
        i = int(late[0])
        if times[i + 1] == times[i]:
            raise InputError(
                f"t = {times[i]:g} s comes twice, in rows {i + 1} and {i + 2}; times must increase"
            )
        raise InputError(
            f"times must increase: t = {times[i + 1]:g} s in row {i + 2} follows {times[i]:g} s"
        )
    if times[0] < 0:
        raise InputError(f"times must start at 0 s or later, not at {times[0]:g} s")


def to_unit(attitude: Array, times: Array) -> tuple[Array, list[str]]:
    """Return quaternions (n, 4) at length one, and a note where more than rounding was missing."""
    length = np.linalg.norm(attitude, axis=1)
    off = np.abs(length - 1)
    worst = int(off.argmax())
    if off[worst] > _NO_QUATERNION:
        raise InputError(
            f"the quaternion in row {worst + 1} (t = {times[worst]:g} s) has length "
            f"{length[worst]:.6g}, and must have 1"
        )
    note = f"quaternions are off length 1 by up to {off[worst]:.1g}; they are normalized"
    # Those of length one but for rounding stay as they are, to the last bit.
    exact = np.where(off[:, None] <= 1e-15, attitude, attitude / length[:, None])
    return exact, [note] if off[worst] > _ROUNDED else []


def together(columns: Mapping[str, Array], names: tuple[str, ...]) -> Array | None:
    """Return the columns of these names (n, k), None where there is none of them."""
    there = [name for name in names if name in columns]
    if there and len(there) < len(names):
        raise InputError(f"of {', '.join(names)} there is only {', '.join(there)}")
    return np.stack([columns[name] for name in names], axis=1) if there else None
