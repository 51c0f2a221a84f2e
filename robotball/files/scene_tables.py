"""The tables of a scene file, one record each, in the order of a written file.

msgspec decodes a file into these records, and refuses unknown keys, wrong types and numbers beyond
a key's limits. They are the only list of the keys: the reader (`scene_file`), its messages
(`scene_keys`), the writer (`scene_writer`), docs/scene.md and the JSON schema all use them. At the
end, `Numbers` is the interface to the numbers of a scene or robot file by path.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import msgspec

from robotball.errors import InputError, unknown
from robotball.robot.ball import shell_inertia, wall_volume
from robotball.robot.drives import COMMAND, Ramp, Rate, Samples, Sine, Sum, key
from robotball.robot.formulas import Rolling
from robotball.robot.scene import DOWN, GRAVITY, Scene

_Triple = tuple[float, float, float]
_Quadruple = tuple[float, float, float, float]
_Positive = Annotated[float, msgspec.Meta(gt=0)]
_NotNegative = Annotated[float, msgspec.Meta(ge=0)]
_ORIGIN: _Triple = (0.0, 0.0, 0.0)
SAME = ("title", "source", "rolling", "duration", "gravity")  # the same in a scene and its file
_UPRIGHT: _Quadruple = (1.0, 0.0, 0.0, 0.0)
# kg/m³ of solid material, typical values of data sheets; grades differ by a few percent.
DENSITIES = {
    "abs": 1050.0,
    "pla": 1240.0,
    "petg": 1270.0,
    "pmma": 1190.0,
    "pc": 1200.0,
    "nylon": 1140.0,
    "pom": 1410.0,
    "aluminium": 2700.0,
    "steel": 7850.0,
    "brass": 8500.0,
    "lead": 11340.0,
    "tungsten": 19300.0,
}
_MASS_KEYS = ("mass", "density", "material")
_FILE_KEYS = ("part", "mjcf", "urdf")


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A TOML table without unknown keys."""

    def given(self, *keys: str) -> list[str]:
        """Return the names in `keys` that the table has."""
        return [name for name in keys if getattr(self, name) is not None]


def numbers_in(value: object, path: str = "") -> Iterator[tuple[str, float]]:
    """Yield the numbers in a value of TOML with their paths, such as `rotor[0].axis[2]`."""
    if isinstance(value, float):
        yield path, value
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from numbers_in(inner, f"{path}.{name}" if path else name)
    elif isinstance(value, list | tuple):
        for i, inner in enumerate(value):
            yield from numbers_in(inner, f"{path}[{i}]")


# `drives.Samples` has no file.
class _SamplesTable(Table, frozen=True, tag_field="kind", tag="samples"):
    """Samples in the scene file or in a file of their own."""

    times: Annotated[list[float] | None, key("increasing times that cover the run", "s")] = None
    values: Annotated[list[float] | None, key("a value for each time", COMMAND)] = None
    file: Annotated[
        str | None,
        key("a .csv or .npz file with two named columns, time and value, instead of both keys"),
    ] = None


_Term = float | Ramp | Sine | _SamplesTable
Command = _Term | list[_Term]
_Three = tuple[Command, Command, Command]


def rate_of(command: Command, folder: Path) -> Rate:
    """Return the rate of a command; folder: of the scene file, for files of samples."""
    if isinstance(command, list):
        return Sum(tuple(rate_of(term, folder) for term in command))
    if not isinstance(command, _SamplesTable):
        return command
    if command.file is not None:
        if command.times is not None or command.values is not None:
            raise InputError("samples take a file, or times and values, not both")
        from robotball.files.columns import read_samples  # few scenes have such a file

        return read_samples(folder / command.file)
    if command.times is None or command.values is None:
        missing = "times" if command.times is None else "values"
        raise InputError(f"samples: key {missing!r} or 'file' is missing")
    return Samples(times=tuple(command.times), values=tuple(command.values))


# A separate type, so that msgspec refuses other words.
_DriveName = Literal["prescribed", "servo", "position", "dc_motor", "torque", "free"]


@dataclass(frozen=True)
class _DriveKind:
    """A value of the key `drive`.

    Attributes
    ----------
    command : str or None
        Key of the command.
    motor : str or None
        Class in `robotball.robot.motors`; None keeps the commanded rate exactly.
    keys : tuple of str
        Keys of the motor's fields, in their order.
    needed : tuple of str
        Required keys.
    """

    command: str | None
    motor: str | None = None
    keys: tuple[str, ...] = ()
    needed: tuple[str, ...] = ()

    @property
    def allowed(self) -> tuple[str, ...]:
        """All keys that belong to the drive."""
        names = (*self.needed, self.command, *self.keys, "initial_rate" if self.motor else None)
        return tuple(dict.fromkeys(name for name in names if name is not None))


_NEEDED_OF_MOTOR = ("stall_torque", "no_load_speed")
_KEYS_OF_MOTOR = ("gear", "rotor_inertia", "torque_limit", "efficiency", "no_load_current")
DRIVES: dict[_DriveName, _DriveKind] = {
    "prescribed": _DriveKind("rate"),
    "servo": _DriveKind("rate", "Servo", ("kv", "torque_limit", "armature"), ("kv",)),
    "position": _DriveKind(
        "angle", "PositionServo", ("kp", "kd", "torque_limit", "armature"), ("kp", "angle")
    ),
    "dc_motor": _DriveKind(
        "supply",
        "DCMotor",
        (*_NEEDED_OF_MOTOR, *_KEYS_OF_MOTOR, "stall_current"),
        (*_NEEDED_OF_MOTOR, "supply"),
    ),
    "torque": _DriveKind("torque", "Torque", ("armature",), ("torque",)),
    "free": _DriveKind(None, "Free", ("damping", "stiffness", "rest", "armature", "friction")),
}
_DRIVE_KEYS = tuple(dict.fromkeys(name for kind in DRIVES.values() for name in kind.allowed))


class HingeTable(Table, frozen=True):
    """The drive and the initial state of a hinge."""

    # None marks a missing key: 0 would be a value, and a key of another drive is refused.
    rate: Annotated[Command | None, key("commanded rate; default: 0", "rad/s")] = None
    angle: Annotated[Command | None, key("commanded angle", "rad")] = None
    torque: Annotated[Command | None, key("commanded torque", "N m")] = None
    supply: Annotated[Command | None, key("share of the nominal voltage, -1 to 1", "1")] = None
    drive: Annotated[
        _DriveName, key("the motor of the hinge; `prescribed`: exact rate, no motor")
    ] = "prescribed"
    kv: Annotated[float | None, key("gain: torque per error of the rate", "N m s/rad")] = None
    kp: Annotated[float | None, key("gain: torque per error of the angle", "N m/rad")] = None
    kd: Annotated[float | None, key("gain: torque against the rate, per rate", "N m s/rad")] = None
    stall_torque: Annotated[float | None, key("stall torque before the gear", "N m")] = None
    no_load_speed: Annotated[float | None, key("no-load speed before the gear", "rad/s")] = None
    gear: Annotated[float | None, key("motor turns per hinge turn; default: 1")] = None
    rotor_inertia: Annotated[float | None, key("inertia of the motor's rotor", "kg m²")] = None
    torque_limit: Annotated[float | None, key("largest torque of the motor", "N m")] = None
    efficiency: Annotated[float | None, key("efficiency of the gear; default: 1")] = None
    no_load_current: Annotated[float | None, key("no-load current; adds friction", "A")] = None
    stall_current: Annotated[float | None, key("required with `no_load_current`", "A")] = None
    damping: Annotated[float | None, key("viscous damping", "N m s/rad")] = None
    stiffness: Annotated[float | None, key("stiffness of a spring", "N m/rad")] = None
    rest: Annotated[float | None, key("rest angle of the spring", "rad")] = None
    friction: Annotated[float | None, key("dry friction, smoothed below 1e-3 rad/s", "N m")] = None
    armature: Annotated[float | None, key("rotor inertia times gear ratio squared", "kg m²")] = None
    initial_angle: Annotated[float, key("angle at the start", "rad")] = 0.0
    initial_rate: Annotated[float | None, key("default: a servo's command, or 0", "rad/s")] = None

    def __post_init__(self) -> None:
        drive = DRIVES[self.drive]
        for name in drive.needed:
            if getattr(self, name) is None:
                raise ValueError(f'drive = "{self.drive}" needs the key {name!r}')
        # A key of another drive would be ignored silently.
        for name in self.given(*_DRIVE_KEYS):
            if name not in drive.allowed:
                owners = [f'"{owner}"' for owner, kind in DRIVES.items() if name in kind.allowed]
                drives = " or ".join(owners)
                raise ValueError(f'{name} needs drive = {drives}, but drive is "{self.drive}"')


_Name = Annotated[str | None, key("one word, the name of the part in `fit`")]
_Mass = Annotated[_Positive, key("mass", "kg")]
_Place = Annotated[_Triple, key("centre, from the centre of the sphere", "m")]
_Axis = Annotated[_Triple | None, key("axis; default: the axis of the shell or rotor, or z")]


class _Matter(Table, frozen=True):
    """The mass of a body, or its density or material."""

    mass: Annotated[_Positive | None, key("mass; or give a density or material", "kg")] = None
    density: Annotated[_Positive | None, key("density, instead of the mass", "kg/m³")] = None
    material: Annotated[str | None, key("material (see below), instead of the density")] = None

    def __post_init__(self) -> None:
        if len(ways := self.given(*_MASS_KEYS)) > 1:
            raise ValueError(f"give only one of mass, density, material, not {' and '.join(ways)}")
        if self.material is not None and self.material.lower() not in DENSITIES:
            raise unknown("material", self.material, DENSITIES)

    def mass_in(self, volume: float) -> float:
        """Return the mass [kg] of a body with a volume [m³]."""
        if self.mass is not None:
            return self.mass
        density = self.density if self.material is None else DENSITIES[self.material.lower()]
        if density is None:
            raise InputError("give a mass [kg], a density [kg/m³] or a material")
        if volume == 0:
            raise InputError("without a thickness give the mass, not a density or a material")
        return density * volume


class _Round(_Matter, frozen=True):
    """A round body with an outer radius or diameter."""

    radius: Annotated[_Positive | None, key("outer radius; or give a diameter", "m")] = None
    diameter: Annotated[_Positive | None, key("diameter, instead of the radius", "m")] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.diameter is None is self.radius:
            raise ValueError("key 'radius' or 'diameter' is missing")
        if self.diameter is not None and self.radius:
            raise ValueError("give a radius or a diameter, not both")

    @property
    def outer(self) -> float:
        """The outer radius [m]."""
        return (self.radius or 0.0) if self.diameter is None else self.diameter / 2


class _Bored(_Round, frozen=True):
    """A round body about an axis, with or without a round hole."""

    inner_radius: Annotated[_NotNegative, key("radius of the hole", "m")] = 0.0
    centre: _Place = _ORIGIN
    axis: _Axis = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.inner_radius < self.outer:
            inner, outer = self.inner_radius, self.outer
            raise ValueError(f"inner_radius must be below the radius {outer:g} m, not {inner:g} m")


class Point(Table, frozen=True, kw_only=True, tag_field="kind", tag="point"):
    """A point mass."""

    mass: _Mass
    centre: _Place = _ORIGIN
    name: _Name = None


class Sphere(_Round, frozen=True, tag_field="kind", tag="sphere"):
    """A ball, solid or hollow."""

    thickness: Annotated[_Positive | None, key("thickness of the wall; default: solid", "m")] = None
    centre: _Place = _ORIGIN
    name: _Name = None


class Box(_Matter, frozen=True, kw_only=True, tag_field="kind", tag="box"):
    """A cuboid."""

    size: Annotated[tuple[_Positive, _Positive, _Positive], key("full lengths of the edges", "m")]
    centre: _Place = _ORIGIN
    attitude: Annotated[_Quadruple, key("quaternion (w, x, y, z) of the edges")] = _UPRIGHT
    name: _Name = None


class Cylinder(_Bored, frozen=True, kw_only=True, tag_field="kind", tag="cylinder"):
    """A cylinder or a tube."""

    length: Annotated[_Positive, key("length along the axis", "m")]
    name: _Name = None


class Disc(_Bored, frozen=True, tag_field="kind", tag="disc"):
    """A round plate, with or without a round hole."""

    thickness: Annotated[_NotNegative, key("thickness; required with a density", "m")] = 0.0
    name: _Name = None


class Ring(Table, frozen=True, kw_only=True, tag_field="kind", tag="ring"):
    """A thin hoop."""

    mass: _Mass
    radius: Annotated[_Positive, key("radius", "m")]
    centre: _Place = _ORIGIN
    axis: _Axis = None
    name: _Name = None


class Rod(_Round, frozen=True, kw_only=True, tag_field="kind", tag="rod"):
    """A round rod between two points."""

    begin: Annotated[_Triple, key("centre of one end", "m")]
    end: Annotated[_Triple, key("centre of the other end", "m")]
    radius: Annotated[_NotNegative, key("radius; required with a density", "m")] = 0.0
    name: _Name = None


Part = Point | Sphere | Box | Cylinder | Disc | Ring | Rod


class _BodyFile(Table, frozen=True):
    """A body in a model file, and its pose in the ball."""

    file: Annotated[str, key("path, relative to the folder of the scene")]
    origin: Annotated[_Triple, key("body origin, from the sphere's centre", "m")] = _ORIGIN
    attitude: Annotated[_Quadruple, key("quaternion (w, x, y, z) that rotates the body")] = _UPRIGHT


class _MjcfTable(_BodyFile, frozen=True, kw_only=True):
    """A body of an MJCF file, with everything fixed to it."""

    body: Annotated[str, key("the name of the body")]


class UrdfTable(_BodyFile, frozen=True, kw_only=True):
    """A link of a URDF file, with everything fixed to it."""

    link: Annotated[str, key("the name of the link")]


Rows = list[float | _Triple]  # three moments or three rows: msgspec has no union of two lists
_Tensor = Annotated[
    Rows | None, key("inertia about the centre of mass: 3 moments, or 3 rows of 3", "kg m²")
]


class Axial(Table, frozen=True):
    """Moments of a symmetric body."""

    axial: Annotated[float, key("moment about the axis", "kg m²")]
    transverse: Annotated[float, key("moment about a line across the axis", "kg m²")]


class ShellTable(_Round, frozen=True):
    """The sphere that rolls: a wall and parts fixed to it; symmetric about `axis`."""

    thickness: Annotated[_Positive | None, key("thickness of the uniform wall", "m")] = None
    inertia: Annotated[
        Literal["thin"] | Axial | None,
        key('inertia of the wall, instead of the thickness: `"thin"`, or two moments'),
    ] = None
    axis: Annotated[_Triple, key("axis of the frame's hinge, of any length")] = (0.0, 0.0, 1.0)
    offset: Annotated[float, key("centre of mass of the wall, along `axis`", "m")] = 0.0
    part: Annotated[list[Part] | None, key("parts fixed to the wall")] = None
    mjcf: Annotated[_MjcfTable | None, key("the whole shell from an MJCF file")] = None
    urdf: Annotated[UrdfTable | None, key("the whole shell from a URDF file")] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mjcf or self.urdf:
            _check_one_way(self, "mass and thickness", self.wall_keys)

    @property
    def wall_keys(self) -> list[str]:
        """The keys of the wall that the table has."""
        return self.given(*_MASS_KEYS, "thickness", "inertia")

    def wall(self) -> tuple[float, float, float]:
        """Return the mass [kg] of the wall, and its axial and transverse moments [kg m²].

        Raises InputError for missing keys and for keys that exclude each other.
        """
        inertia, thickness = self.inertia, self.thickness
        if inertia is not None and thickness is not None:
            raise InputError("shell: give thickness or inertia, not both")
        if thickness is not None:
            mass = self.mass_in(wall_volume(self.outer, thickness))
            moment = shell_inertia(self.outer, mass, thickness)
            return mass, moment, moment
        if self.given("density", "material"):
            raise InputError("shell: a density or a material needs the wall's thickness [m]")
        if self.mass is None:
            raise InputError("shell: key 'mass' is missing")
        if inertia is None:
            raise InputError("shell: key 'thickness' or 'inertia' is missing")
        if inertia == "thin":
            moment = shell_inertia(self.outer, self.mass)
            return self.mass, moment, moment
        return self.mass, inertia.axial, inertia.transverse


class _BodyTable(HingeTable, frozen=True):
    """A body on a hinge, without its inertia and the axis of the hinge."""

    mass: Annotated[float | None, key("mass", "kg")] = None
    centre: Annotated[_Triple | None, key("centre of mass; default: the origin", "m")] = None
    part: Annotated[list[Part] | None, key("parts of the body")] = None
    mjcf: Annotated[_MjcfTable | None, key("a body of an MJCF file")] = None
    urdf: Annotated[UrdfTable | None, key("a link of a URDF file")] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        numbers = self.given("mass", "inertia", "centre")
        _check_one_way(self, "mass and inertia", numbers)
        if self.part is not None and not self.part:
            raise ValueError("part is empty: list at least one part, or give mass and inertia")
        for name in ("mass", "inertia") if numbers else ():
            if getattr(self, name) is None:
                raise ValueError(f"key {name!r} is missing")


def _check_one_way(table: ShellTable | _BodyTable, numbers: str, keys: list[str]) -> None:
    """Raise ValueError unless a body has either numbers, or parts, or one file."""
    ways = {numbers: keys, **{name: table.given(name) for name in _FILE_KEYS}}
    if len(used := [names for names in ways.values() if names]) != 1:
        listed = " and ".join(map(", ".join, used)) or "nothing"
        raise ValueError(f"this table has {listed}; give either {', or '.join(ways)}")


class FrameTable(_BodyTable, frozen=True):
    """The body that turns in the shell, about the shell's axis, and carries the other bodies."""

    inertia: _Tensor = None


class RotorTable(_BodyTable, frozen=True, kw_only=True):
    """A symmetric body that turns on the frame about its symmetry axis."""

    inertia: Annotated[Axial | None, key("two moments: axial and transverse")] = None
    axis: Annotated[_Triple, key("symmetry axis, of any length")]


class PendulumTable(_BodyTable, frozen=True, kw_only=True):
    """Any body on a hinge of the frame, at hinge angle 0."""

    inertia: _Tensor = None
    axis: Annotated[_Triple, key("axis of the hinge, of any length")]
    pivot: Annotated[_Triple, key("a point of the axis", "m")] = _ORIGIN


class FrictionTable(Table, frozen=True):
    """Friction of the plane against the shell."""

    sliding: Annotated[float | None, key("sliding coefficient; default: no limit")] = None
    torsional: Annotated[float | None, key("torsional coefficient; default: no limit", "m")] = None
    rolling: Annotated[float, key("resisting torque per normal force", "m")] = 0.0


class PlaneTable(Table, frozen=True):
    """The motion of the plane."""

    motion: Annotated[_Three, key("acceleration along X, Y and Z of the world", "m/s²")] = _ORIGIN
    rotation: Annotated[Command, key("rate about the world's Z axis", "rad/s")] = 0.0


class _NumbersTable(Table, frozen=True):
    """Numbers of the equations, for which bodies are designed."""

    radius: Annotated[float, key("radius a", "m")]
    A: Annotated[Rows, key("A: diagonal, or three rows", "1/(kg m²)")]
    K: Annotated[_Triple, key("K, in the same axes", "kg m²/s")]
    Omega: Annotated[_Triple, key("Ω, in the same axes", "rad/s")]
    mass: Annotated[float | None, key("mass of the ball; default: chosen by `design`", "kg")] = None


class _SectionTable(Table, frozen=True):
    """The section's coordinates (5.5), in the principal axes of the ball's inertia."""

    L: Annotated[float, key("component of M along the third principal axis", "kg m²/s")]
    l: Annotated[float, key("angle of M about the third principal axis", "rad")]
    g: Annotated[float, key("angle of γ about M", "rad")]
    f: Annotated[float, key("square of M", "(kg m²/s)²")]
    c: Annotated[float, key("scalar product of M and γ; 0 in the rubber model", "kg m²/s")] = 0.0


class StartTable(Table, frozen=True):
    """The initial attitude and momentum, in one of three forms."""

    attitude: Annotated[_Quadruple | None, key("quaternion (w, x, y, z), frame to world")] = None
    gamma: Annotated[_Triple | None, key("upward vertical in frame axes, of length 1")] = None
    alpha: Annotated[_Triple | None, key("X of the world in frame axes, of length 1")] = None
    angular_velocity: Annotated[_Triple | None, key("ω of the frame in frame axes", "rad/s")] = None
    momentum: Annotated[_Triple | None, key("M in frame axes", "kg m²/s")] = None
    momentum_world: Annotated[_Triple | None, key("M in world axes", "kg m²/s")] = None
    rest: Annotated[bool, key("`true`: M = 0, and hinges that turn also turn the ball")] = False
    section: Annotated[_SectionTable | None, key("the section coordinates of the paper")] = None
    slip: Annotated[
        tuple[float, float],
        key("velocity of the shell at the contact, along X and Y; needs friction", "m/s"),
    ] = (0.0, 0.0)
    spin: Annotated[
        float, key("rubber: spin of the shell about the vertical; needs friction", "rad/s")
    ] = 0.0


class SceneTable(Table, frozen=True, kw_only=True):
    """The table of a whole scene file."""

    title: Annotated[str, key("one line, for tables and plots")]
    source: Annotated[str, key("source of the numbers, any lines of text")] = ""
    rolling: Annotated[Rolling, key("`rubber`: no slip and no spin; `classical`: no slip")]
    duration: Annotated[float, key("duration of the motion", "s")]
    gravity: Annotated[float, key("acceleration of free fall", "m/s²")] = GRAVITY
    gravity_direction: Annotated[
        _Triple, key("vector of any length; `[tan(slope), 0, -1]`: the plane slopes down towards X")
    ] = DOWN
    friction: Annotated[FrictionTable, key("friction of the plane")] = FrictionTable()
    plane: Annotated[PlaneTable, key("motion of the plane")] = PlaneTable()
    shell: Annotated[ShellTable | None, key("rolling sphere; required without `numbers`")] = None
    frame: Annotated[FrameTable | None, key("body in the shell; required without `numbers`")] = None
    rotor: Annotated[tuple[RotorTable, ...], key("any number of `[[rotor]]` tables")] = ()
    pendulum: Annotated[tuple[PendulumTable, ...], key("any number of `[[pendulum]]` tables")] = ()
    numbers: Annotated[_NumbersTable | None, key("`[numbers]`, instead of bodies")] = None
    start: Annotated[StartTable, key("initial state")]


class Number(NamedTuple):
    """A number of a file.

    unit: "" if it depends on other numbers; place: location in the file, in a format-specific form.
    """

    value: float
    unit: str
    place: Any


class Numbers(ABC):
    """The numbers of a file by path. They can be replaced to get another scene or another file.

    suffix: suffix of the file's name.
    """

    suffix: str

    @property
    @abstractmethod
    def known(self) -> Mapping[str, Number]:
        """Each number, keyed by path."""

    @abstractmethod
    def scene(self, values: Mapping[str, float]) -> Scene:
        """Return the scene with some numbers replaced. Raises InputError if it is invalid."""

    @abstractmethod
    def text(self, values: Mapping[str, float], start: Scene) -> str:
        """Return the file's text with some numbers replaced and the initial state of `start`."""

    def with_whole(self, names: Sequence[str]) -> "Numbers":
        """Return the numbers with mass, centre and inertia of some bodies instead of their parts.

        Raises InputError for file formats that do not support this.
        """
        if names:
            raise InputError(
                f"{names[0]}.inertia: a fit frees the whole inertia of a body only in scene files; "
                "name single numbers of the body"
            )
        return self

    def path_of(self, name: str) -> str:
        """Return the path that a name, such as its last parts, stands for.

        Raises InputError, listing candidates, if no path or several paths match.
        """
        parts = name.split(".")
        matches = [path for path in self.known if _follows(parts, path.split("."))]
        if name in matches or len(matches) == 1:
            return name if name in matches else matches[0]
        if matches:
            raise InputError(f"{name!r} is ambiguous: {', '.join(matches)}; give more of the path")
        raise unknown("number of the scene", name, self.known)


def _follows(parts: list[str], path: list[str]) -> bool:
    """Return whether `parts` is an ordered subset of `path` that ends with its last word."""
    rest = iter(path)
    return parts[-1] == path[-1] and all(word in rest for word in parts)
