"""Write motions as tables, and read trajectories written by any simulator.

A motion of robotball is stored with all arrays as named columns, and with a header that has the
scene and the engine. A trajectory from another program needs time and position. Many column names
and units are recognized and converted to robotball's names and to SI units.
"""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robotball.errors import LARGEST, InputError, named, unknown
from robotball.files import as_path
from robotball.files.columns import RECORDS, Table, read_table, write_table
from robotball.files.scene_writer import toml_of
from robotball.robot.ball import Value, read_only
from robotball.robot.scene import Scene
from robotball.rotations import Array, turned

FORMAT = "robotball motion 1"  # header entry of a file with all arrays of a motion
_ArrayPath = tuple[str, ...]  # names of nested fields of a motion
Units = dict[str, float]  # each unit in SI units

# Recognized column names, without unit, brackets, capitals and separators; * stands for the last
# letter. After them the names of arrays (n, k), whose columns an NPZ holds as name.0, name.1, …
_NAMES = {
    ("x", "y", "z"): (
        "* p* pos* *pos position* pose* poseposition* translation*",
        "position positions pos xyz contactpoint",
    ),
    ("qw", "qx", "qy", "qz"): (
        "q* quat* quaternion* orientation* rot* rotation* poseorientation*",
        "attitude quaternion quat q orientation",
    ),
    ("wx", "wy", "wz"): (
        "w* omega* angvel* angularvelocity* gyro* gyroscope* ω* twistangular*",
        "angularvelocity omega w angvel gyro",
    ),
    ("Mx", "My", "Mz"): ("m* momentum*", "momentum m"),
    ("ax", "ay", "az"): (
        "a* acc* accel* accelerometer* linearacceleration*",
        "accelerometer accel acc",
    ),
}
_ANGLES = ("roll", "pitch", "yaw")
_ALIASES = {
    **dict.fromkeys(["t", "time", "times", "timestamp", "stamp", "sec", "seconds", "simtime"], "t"),
    **dict.fromkeys(["secs", "stampsec", "stampsecs", "headerstamp", "logtime", "rostime"], "t"),
    **dict.fromkeys(["nanosec", "nsecs", "stampnanosec", "stampnsecs", "nanoseconds"], "nanosec"),
    **{"contactx": "x", "contacty": "y", "height": "z"},
    **{kind + angle: angle for angle in _ANGLES for kind in ("", "euler", "orientation")},
    **{
        alias: name
        for names, (columns, arrays) in _NAMES.items()
        for i, name in enumerate(names)
        for alias in (*columns.replace("*", name[-1]).split(), *(f"{a}{i}" for a in arrays.split()))
    },
}
_NEEDED = ("t", "x", "y")
LENGTHS = {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
_TIMES = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
TAU = 2 * np.pi
RATES = {"rad/s": 1.0, "1/s": 1.0, "deg/s": TAU / 360, "rpm": TAU / 60, "rev/s": TAU}
DEGREES = {"rad": 1.0, "deg": TAU / 360, "rev": TAU, "°": TAU / 360}
# A quaternion has no unit; momentum must be in kg m²/s.
_UNITS = {"t": _TIMES, **dict.fromkeys("xyz", LENGTHS), **dict.fromkeys(("wx", "wy", "wz"), RATES)}
_UNITS |= {"nanosec": {"ns": 1.0}, **dict.fromkeys(_ANGLES, DEGREES)}
_UNITS |= {name: {} for name in ("qw", "qx", "qy", "qz", "Mx", "My", "Mz")}
_UNIT_ALIASES = {
    "°/s": "deg/s",
    "µm": "um",
    "μm": "um",
    "rad/sec": "rad/s",
    "rad s^-1": "rad/s",
    "degrees": "deg",
}
_NOT_UNIT = 0.02  # deviation from unit length above which a quaternion is refused
_SINGLE_PRECISION = 1e-6  # deviation from unit length below which no note is given
_NO_UNIT = ("", "-", "1")
_LETTERS = 2  # an end of a title with so few letters is too short to be recognized
_EPOCH = (1e9, 4e9)  # s, time stamps of the years 2001 to 2096
_APART = 2.0  # s, largest interval between rows with such time stamps
# Least median intervals of times that are whole numbers of these units: 1 to 200 Hz for ms, 1 kHz
# for µs.
_TICKS = {"ns": 9e5, "us": 9e2, "ms": 5.0}
_MANY = 1000  # readings; at one reading per second they would take a quarter of an hour


@dataclass(frozen=True)
class _Array:
    """An array of a motion: its path, the names and the unit of its columns, and its dimension.

    dimension: "" for an array (n,), else the name of the array's second dimension. The dimension of
    vectors in world axes has another name than that of vectors in frame axes.
    """

    path: _ArrayPath
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


def dataset_of(scene: Scene, engine: Mapping[str, str], arrays: Mapping[_ArrayPath, Array]) -> Any:
    """Return the arrays of a motion as an xarray.Dataset, with units as attributes.

    Raises InputError if xarray is not installed.
    """
    try:
        import xarray
    except ImportError:
        line = "to_xarray needs xarray: install robotball's extra `xarray`"
        raise InputError(line) from None
    coordinates: dict[str, Any] = {
        "time": ("time", arrays[("times",)], {"units": "s"}),
        "plane": ["X", "Y"],
        "world": ["X", "Y", "Z"],
        "frame": ["x", "y", "z"],
        "quaternion": ["w", "x", "y", "z"],
        "hinge": [hinge.name for hinge in scene.hinges],
    }
    variables: dict[str, Any] = {}
    for layout in _layout(scene):
        dimensions = ("time", layout.dimension) if layout.dimension else ("time",)
        variables[layout.path[-1]] = (dimensions, arrays[layout.path], {"units": layout.unit})
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
    arrays: Mapping[_ArrayPath, Array],
    timestep: float | None = None,
) -> None:
    """Write a motion to a file.

    arrays: the motion's arrays by their path in `Motion`; engine: the engine's label as a mapping;
    timestep: of a contact engine [s]. Raises InputError if the file cannot be written.
    """
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    for layout in _layout(scene):
        array, names = arrays[layout.path], layout.columns
        columns.update(zip(names, array.reshape(len(array), len(names)).T, strict=True))
        units.update(dict.fromkeys(names, layout.unit))
    header = {"format": FORMAT, "engine": json.dumps(dict(engine), ensure_ascii=False)}
    if timestep is not None:
        header["timestep"] = repr(float(timestep))
    # The scene is included so that the file alone is enough for a comparison.
    header["scene"] = scene.name
    try:
        header["scene_toml"] = toml_of(scene)
    except InputError as error:
        header["scene_toml_missing"] = str(error)
    write_table(path, Table(columns, units, header))


def arrays_of(table: Table, scene: Scene) -> dict[_ArrayPath, Array]:
    """Return a motion's arrays by path, with the shapes of the scene's motions.

    Raises InputError if columns are missing.
    """
    arrays: dict[_ArrayPath, Array] = {}
    for layout in _layout(scene):
        missing = [name for name in layout.columns if name not in table.columns]
        if missing:
            raise InputError(f"not a motion of {scene.name}: it lacks {', '.join(missing)}")
        columns = [table.columns[name] for name in layout.columns]
        # With a single hinge, an array (n, 1) also has one column.
        arrays[layout.path] = np.stack(columns, axis=1) if layout.dimension else columns[0]
    return arrays


@dataclass(frozen=True)
class Trajectory(Value):
    """Hold a ball's motion read from a file, in SI units, in the file's axes and from its origin.

    Attributes
    ----------
    name : str
        The name of the file.
    times : (n,), s
        Increasing times, starting at 0 or later.
    position : (n, 3), m
        The ball's position. The third column is NaN if the file has no height.
    attitude : (n, 4)
        Unit quaternions (w, x, y, z). NaN if the file has no attitude.
    angular_velocity : (n, 3), rad/s, or None
        The angular velocity of the frame, if the file has it.
    momentum : (n, 3), kg m²/s, or None
        The momentum M, if the file has it.
    others : mapping of str to (n,), or None
        Columns that are not recognized.
    header : mapping of str to str, or None
        The header of the file.
    notes : tuple of str
        One line for each conversion made while reading, such as the conversion of a unit.

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


def read_trajectory(path: str | Path, names: Mapping[str, str] | None = None) -> Trajectory:
    """Read a trajectory written by any simulator.

    The file needs time and position. Without attitude, only the path can be compared. Many column
    names are recognized, and many units are converted to SI.

    Parameters
    ----------
    path : str or Path
        A CSV, NPZ, Parquet, JSON lines or MATLAB file, or a ROS bag.
    names : mapping of str to str, optional
        Names for columns that are not recognized, such as {"base.px": "x [mm]"}. A key is the
        column's title in the file, or the end of the title. A value is robotball's name, with the
        unit unless it is SI.

    Returns
    -------
    Trajectory
        The trajectory, with a note on each conversion.

    Raises
    ------
    InputError
        If a column is missing, a unit is unknown, a number is not finite, the times do not
        increase, or a quaternion does not have unit length. The message names the file.

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
        return _trajectory_of(table, path.name, names or {})


def _trajectory_of(table: Table, name: str, names: Mapping[str, str]) -> Trajectory:
    found = recognized(table, {}, names)
    columns = found.columns
    missing = [column for column in _NEEDED if column not in columns]
    if missing:
        there, needed = ", ".join(table.columns) or "none", "t,x,y and qw,qx,qy,qz"
        line = f"missing: {','.join(missing)}; needed: {needed}; in the file: {there}"
        raise InputError(f"{line}; name a column with --map TITLE={missing[0]}")
    if table.header.get(RECORDS):  # a topic has its own times
        whole = np.isfinite(np.stack([*columns.values()])).all(axis=0)
        columns = {column: values[whole] for column, values in columns.items()}
    for column, values in columns.items():
        _check_finite(column, values, columns["t"])
    times = columns["t"]
    check_increasing(times)
    attitude, rounded = together(columns, ("qw", "qx", "qy", "qz")), list[str]()
    if attitude is None:
        attitude = np.full((len(times), 4), np.nan)
    else:
        attitude, rounded = to_unit(attitude, times)
    height = columns.get("z", np.full(len(times), np.nan))
    return Trajectory(
        name=name,
        times=times,
        position=np.stack([columns["x"], columns["y"], height], axis=1),
        attitude=attitude,
        angular_velocity=together(columns, ("wx", "wy", "wz")),
        momentum=together(columns, ("Mx", "My", "Mz")),
        others=found.others,
        header=table.header,
        notes=(*found.notes, *rounded),
    )


@dataclass(frozen=True)
class Recognized:
    """Recognized columns by robotball's names in SI units, other columns by title, and notes.

    There is a note for each conversion. titles, units: the titles and units that `columns` have in
    the file; a unit is "" if the file does not name it.
    """

    columns: dict[str, Array]
    titles: dict[str, str]
    units: dict[str, str]
    others: dict[str, Array]
    notes: list[str]


def recognized(table: Table, more: dict[str, Units], names: Mapping[str, str]) -> Recognized:
    """Return the recognized columns of a table.

    more: the units of further columns by name; these columns are recognized by exactly this name.
    names: as in `read_trajectory`. Raises InputError if a title or a name is unknown, or if two
    columns stand for the same quantity.
    """
    known = _UNITS | more
    renamed = {_title_of(old, table): new for old, new in names.items()}
    for new in map(_without_unit, renamed.values()):
        if new[0] not in known:
            raise unknown("column of a log", new[0], known)
    found: dict[str, tuple[int, str, str | None]] = {}  # rank, title and unit by robotball's name
    for title in table.columns:
        ours = renamed.get(title)
        rank, name, unit = (0, *_without_unit(ours)) if ours else _parsed(title, known)
        if name is None or (name in found and found[name][0] < rank):
            continue
        if name in found and found[name][0] == rank:
            raise InputError(
                f"{found[name][1]!r} and {title!r} both stand for the column {name}: choose one "
                f"with --map {title}={name}"
            )
        found[name] = rank, title, unit
    units = {name: unit or table.units.get(title, "") for name, (_, title, unit) in found.items()}
    titles = {name: title for name, (_, title, _) in found.items()}
    columns = {name: table.columns[title] for name, title in titles.items()}
    rest = table.columns.keys() - titles.values()
    others = {t: read_only(column) for t, column in table.columns.items() if t in rest}
    notes = [] if "t" not in columns else _timed(columns, units)
    quaternion = [titles[name] for name in ("qw", "qx", "qy", "qz") if found.get(name, [0])[0]]
    if any(title.endswith("0") for title in quaternion):
        notes.append(f"{', '.join(quaternion)}: read as qw, qx, qy, qz")
    notes = [*_made_si(columns, units, known), *notes, *_attitude_of_angles(columns, units)]
    if "t" in columns and columns["t"][0] >= _EPOCH[0]:
        columns["t"], note = from_first(columns["t"])
        notes.append(note)
    return Recognized(columns, titles, units, others, notes)


def _title_of(end: str, table: Table) -> str:
    """Return the title that is equal to `end`, or the only title that ends with `end`."""
    titles = [t for t in table.columns if t == end or t.endswith((f"/{end}", f".{end}"))]
    if end not in titles and len(titles) != 1:
        raise unknown("column of the file", end, titles or table.columns)
    return end if end in titles else titles[0]


def _timed(columns: dict[str, Array], units: dict[str, str]) -> list[str]:
    """Add a column of nanoseconds to the times in place; convert times without a unit.

    The unit is inferred from the size of the times.
    """
    times, fraction = columns["t"], columns.pop("nanosec", None)
    whole = bool((times == np.round(times)).all())
    if fraction is not None and whole and (fraction < 1e9).all():
        columns["t"] = times + 1e-9 * fraction
        return []
    if units["t"] not in _NO_UNIT or len(times) < 2 or not np.abs(times).max() <= LARGEST:
        return []
    step = float(np.median(np.diff(times)))
    epoch = [(u, _TIMES[u]) for u in ("s", "ms", "us", "ns") if step * _TIMES[u] <= _APART]
    of_epoch = (u for u, si in epoch if _EPOCH[0] <= times[0] * si <= _EPOCH[1])
    of_ticks = (u for u, least in _TICKS.items() if whole and step >= least)
    unit = next(of_epoch, "") or next(of_ticks, "ms" if whole and len(times) > _MANY else "s")
    if unit == "s":
        return []
    columns["t"] = times * _TIMES[unit]
    return [f"t has no unit; read in {unit}, because it begins {times[0]:.15g}, {times[1]:.15g}"]


def from_first(times: Array) -> tuple[Array, str]:
    """Return times that count from the first row, and a note about the change."""
    return times - times[0], f"t is counted from the first row, at {times[0]:.12g} s in the file"


def _attitude_of_angles(columns: dict[str, Array], units: Mapping[str, str]) -> list[str]:
    """Replace roll about X, then pitch about Y, then yaw about Z with a quaternion."""
    there = [name for name in _ANGLES if name in columns]
    angles = np.array([columns.pop(name) for name in there])
    if len(there) < len(_ANGLES) or "qw" in columns:
        return [f"{', '.join(there)}: not used: an attitude needs all three"] if there else []
    unit = "rad"
    if (
        not any(units[name] for name in _ANGLES)
        and np.abs(np.nan_to_num(angles[1])).max() > TAU / 4
    ):
        angles, unit = angles * DEGREES["deg"], "deg, as pitch exceeds π/2"
    turns = np.eye(4)[0]
    for axis, angle in zip(np.eye(3)[::-1], angles[::-1], strict=True):
        turns = turned(turns, angle[:, None] * axis)
    columns.update(zip(("qw", "qx", "qy", "qz"), turns.T, strict=True))
    return [f"roll, pitch, yaw: read as rotations about X, Y and then Z, in {unit}"]


def _parsed(title: str, known: Mapping[str, Units]) -> tuple[int, str | None, str | None]:
    """Return (rank, name, unit) of a title such as `x`, `x [mm]`, `x_mm`, `odom/pose.position.x`.

    rank: 1 for a whole title, 2 for its last parts.
    """
    bare, unit = _without_unit(title)
    if bare in known:
        return 1, bare, unit
    parts = re.split(r"[./]", bare)
    ends = [".".join(parts[i:]) for i in range(len(parts))]
    for end in ends:
        if end is not bare and len(end) <= _LETTERS:
            break  # `linear.x` is not a position
        name = _ALIASES.get(_plain(end))
        if name is None and "_" in end:
            first, _, last = end.rpartition("_")
            # `x_mm` is x in mm, but `x_error` is another column.
            if _unit_name(last) in known.get(_ALIASES.get(_plain(first), ""), {}):
                name, unit = _ALIASES[_plain(first)], last
        if name in known:
            return 1 + (end is not bare), name, unit
    return 3, None, None


def _without_unit(title: str) -> tuple[str, str | None]:
    """Return a title without its unit in brackets, and the unit if there is one."""
    match = re.match(r"(.*?)\s*[\[(](.*?)[\])]\s*$", title)
    return (match[1], match[2]) if match else (title, None)


def _plain(title: str) -> str:
    return re.sub(r"[\s_./:\-]", "", title).lower()


def _unit_name(unit: str) -> str:
    return _UNIT_ALIASES.get(unit.strip(), unit.strip())


def _made_si(
    columns: dict[str, Array], units: Mapping[str, str], units_of: Mapping[str, Units]
) -> list[str]:
    """Convert columns to SI units in place. Returns a note for each converted unit."""
    changed: dict[str, list[str]] = {}
    for name, known in units_of.items():
        unit = _unit_name(units.get(name, ""))
        if unit in _NO_UNIT or name not in columns or not known:
            continue  # a column without a unit is in SI units
        size = re.fullmatch(r"([\d.]+(?:e[+-]?\d+)?) (.+)", unit)  # one count is 0.061 deg/s
        if size and _unit_name(size[2]) in known:
            known = known | {unit: float(size[1]) * known[_unit_name(size[2])]}
        if unit not in known:
            raise InputError(f"{name} is in {unit!r}; the unit can be {', '.join(known)}")
        if known[unit] != 1.0:
            columns[name] = columns[name] * known[unit]
            changed.setdefault(unit, []).append(name)
    return [f"{', '.join(names)}: converted from {unit}" for unit, names in changed.items()]


def _check_finite(name: str, column: Array, times: Array) -> None:
    bad = np.flatnonzero(~(np.abs(column) <= LARGEST))
    if len(bad):
        i = int(bad[0])
        more = f", and {len(bad) - 1} more are bad" if len(bad) > 1 else ""
        at = f" (t = {times[i]:g} s)" if name != "t" else ""
        limit = f"values must be finite and at most {LARGEST:g} in size"
        raise InputError(f"{name} is {column[i]} in row {i + 1}{at}{more}: {limit}")


def check_increasing(times: Array) -> None:
    if len(times) < 2:
        raise InputError(f"{len(times)} row of numbers; at least two rows are needed")
    # Report only the first fault, because later faults are mostly its consequences.
    late = np.flatnonzero(np.diff(times) <= 0)
    if len(late):
        row, before, after = int(late[0]) + 1, *times[late[0] :][:2]
        there = f"row {row + 1} with t = {after:g} s follows row {row} with t = {before:g} s"
        raise InputError(f"times must increase: {there}")
    if times[0] < 0:
        raise InputError(f"times must start at 0 s or later, not at {times[0]:g} s")


def to_unit(attitude: Array, times: Array) -> tuple[Array, list[str]]:
    """Return quaternions (n, 4) at unit length, and a note if they were off by over 1e-6."""
    length = np.linalg.norm(attitude, axis=1)
    off = np.abs(length - 1)
    worst = int(off.argmax())
    if off[worst] > _NOT_UNIT:
        where = f"row {worst + 1} (t = {times[worst]:g} s)"
        raise InputError(f"the quaternion in {where} has length {length[worst]:.6g}, not 1")
    note = f"normalized the quaternions: their length was off by up to {off[worst]:.1g}"
    # Quaternions of unit length within rounding are kept to the last bit.
    exact = np.where(off[:, None] <= 1e-15, attitude, attitude / length[:, None])
    return exact, [note] if off[worst] > _SINGLE_PRECISION else []


def together(columns: Mapping[str, Array], names: tuple[str, ...]) -> Array | None:
    """Return the columns of these names (n, k); None if all are missing, InputError if some are."""
    present = [name for name in names if name in columns]
    if present and len(present) < len(names):
        raise InputError(f"give all of {', '.join(names)}, or none; found {', '.join(present)}")
    return np.stack([columns[name] for name in names], axis=1) if present else None
