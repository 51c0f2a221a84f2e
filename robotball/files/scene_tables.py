"""The tables of a scene file, a record each, in the order in which a file is written.

From these records a file is decoded (by msgspec, which refuses unknown keys and wrong types), read
(`scene_file`), explained (`scene_keys`) and written (`scene_writer`). Each key has
its meaning and unit beside it. In order: hinges, bodies, friction, numbers, starts, the whole
scene.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from robotball.errors import InputError
from robotball.robot.drives import COMMAND, Ramp, Rate, Samples, Sine, Sum, key
from robotball.robot.formulas import Rolling
from robotball.robot.scene import DOWN, GRAVITY

Triple = tuple[float, float, float]
_Quadruple = tuple[float, float, float, float]
_ORIGIN: Triple = (0.0, 0.0, 0.0)
_UPRIGHT: _Quadruple = (1.0, 0.0, 0.0, 0.0)


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A TOML table in which every key must be known."""

    def given(self, *keys: str) -> list[str]:
        """Return those of the keys that the table has."""
        return [each for each in keys if getattr(self, each) is not None]


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


# Not `drives.Samples` itself: that one has numbers, and no file.
class _SamplesTable(Table, frozen=True, tag_field="kind", tag="samples"):
    """Samples, given here or in a file."""

    times: Annotated[list[float] | None, key("increasing times, over the whole run", "s")] = None
    values: Annotated[list[float] | None, key("as many values", COMMAND)] = None
    file: Annotated[
        str | None,
        key("instead of both: a file (.csv, .npz) of two columns, time and value, with names"),
    ] = None


_Told = float | Ramp | Sine | _SamplesTable
Command = _Told | list[_Told]
_Three = tuple[Command, Command, Command]


def rate_of(given: Command, folder: Path) -> Rate:
    """Return a command as a drive takes it; samples may be in a file beside the scene's."""
    if isinstance(given, list):
        return Sum(tuple(rate_of(each, folder) for each in given))
    if not isinstance(given, _SamplesTable):
        return given
    if given.file is not None:
        if given.times is not None or given.values is not None:
            raise InputError("samples take a file, or times and values, not both")
        from robotball.files.columns import read_samples  # few scenes have such a file

        return read_samples(folder / given.file)
    if given.times is None or given.values is None:
        missing = "times" if given.times is None else "values"
        raise InputError(f"samples: key {missing!r} is missing, or 'file' instead")
    return Samples(times=tuple(given.times), values=tuple(given.values))


# As a type of its own, so that msgspec refuses any other word.
_DriveName = Literal["prescribed", "servo", "position", "dc_motor", "torque", "free"]


@dataclass(frozen=True)
class _DriveKind:
    """A way to move a hinge: the key of its command, its motor, and the keys of the motor's fields.

    does: a sentence of docs/scene.md; motor: the name of its class in `robotball.robot.motors`,
    which is loaded for scenes that have one; None keeps the command exactly; keys: in the order of
    the motor's fields; needed: the keys without which the drive is refused.
    """

    does: str
    command: str | None
    motor: str | None = None
    keys: tuple[str, ...] = ()
    needed: tuple[str, ...] = ()

    @property
    def allowed(self) -> tuple[str, ...]:
        """All keys that belong to the drive, those that it needs included."""
        own = (*self.needed, self.command, *self.keys, "initial_rate" if self.motor else None)
        return tuple(dict.fromkeys(each for each in own if each is not None))


DRIVES: dict[_DriveName, _DriveKind] = {
    "prescribed": _DriveKind(
        "The hinge keeps the rate exactly, whatever torque that takes.",
        "rate",
    ),
    "servo": _DriveKind(
        "Torque = kv (rate - the hinge's rate), at most the limit either way.",
        "rate", "Servo", keys=("kv", "torque_limit", "armature"), needed=("kv",),
    ),
    "position": _DriveKind(
        "Torque = kp (angle - the hinge's angle) - kd · the hinge's rate, likewise.",
        "angle", "PositionServo", keys=("kp", "kd", "torque_limit", "armature"),
        needed=("kp", "angle"),
    ),
    "dc_motor": _DriveKind(
        "Torque = efficiency · gear · stall_torque (supply - gear · rate/no_load_speed), likewise.",
        "supply", "DCMotor", needed=("stall_torque", "no_load_speed", "supply"),
        keys=(
            "stall_torque", "no_load_speed", "gear", "rotor_inertia", "torque_limit", "efficiency",
            "no_load_current", "stall_current",
        ),
    ),
    "torque": _DriveKind(
        "The motor gives the torque, whatever the hinge does.",
        "torque", "Torque", keys=("armature",), needed=("torque",),
    ),
    "free": _DriveKind(
        "No motor: torque = -damping · rate - stiffness (angle - rest), less friction.",
        None, "Free", keys=("damping", "stiffness", "rest", "armature", "friction"),
    ),
}  # fmt: skip


class HingeTable(Table, frozen=True):
    """How a hinge is moved, and where it starts."""

    # None where a key is not given: 0 would be a value, and a key of another drive is refused.
    rate: Annotated[
        Command | None, key("commanded rate, a command as below; 0 if not given", "rad/s")
    ] = None
    angle: Annotated[Command | None, key("commanded angle, a command as below", "rad")] = None
    torque: Annotated[Command | None, key("commanded torque, a command as below", "N m")] = None
    supply: Annotated[
        Command | None, key("share of the nominal voltage, -1 to 1, a command as below", "1")
    ] = None
    drive: Annotated[
        _DriveName, key("what moves the hinge, see Drives; `prescribed`: it keeps its rate exactly")
    ] = "prescribed"
    kv: Annotated[float | None, key("gain: torque per rate missed", "N m s/rad")] = None
    kp: Annotated[float | None, key("gain: torque per angle missed", "N m/rad")] = None
    kd: Annotated[float | None, key("damping: torque against the rate", "N m s/rad")] = None
    stall_torque: Annotated[float | None, key("of the motor before its gear", "N m")] = None
    no_load_speed: Annotated[float | None, key("of the motor before its gear", "rad/s")] = None
    gear: Annotated[float | None, key("the motor's turns in one of the hinge's; else 1")] = None
    rotor_inertia: Annotated[float | None, key("of the motor's own rotor", "kg m²")] = None
    torque_limit: Annotated[float | None, key("the motor's largest torque", "N m")] = None
    efficiency: Annotated[
        float | None, key("of the gear: the part of the torque that reaches the hinge; else 1")
    ] = None
    no_load_current: Annotated[
        float | None, key("at the no-load speed; with it the motor has dry friction", "A")
    ] = None
    stall_current: Annotated[float | None, key("at rest, which no_load_current needs", "A")] = None
    damping: Annotated[float | None, key("torque against the rate", "N m s/rad")] = None
    stiffness: Annotated[float | None, key("of a spring", "N m/rad")] = None
    rest: Annotated[float | None, key("the angle at which the spring rests", "rad")] = None
    friction: Annotated[
        float | None,
        key("dry friction of the hinge; the equations smooth it below 1e-3 rad/s", "N m"),
    ] = None
    armature: Annotated[
        float | None, key("inertia of the motor's own rotor, times its gear ratio squared", "kg m²")
    ] = None
    initial_angle: Annotated[float, key("angle at the start", "rad")] = 0.0
    initial_rate: Annotated[
        float | None,
        key("rate at the start; if not given, that of a velocity servo's command, else 0", "rad/s"),
    ] = None


_Name = Annotated[str | None, key("one word, by which `fit` finds its numbers")]
_Mass = Annotated[float, key("its mass", "kg")]
_Place = Annotated[Triple, key("where its middle is, from the sphere's centre", "m")]
_Axis = Annotated[
    Triple | None,
    key("what it is symmetric about; without it the axis of the shell or rotor, or else z"),
]


class Matter(Table, frozen=True):
    """A body's matter: its mass, or what makes it in the body's volume."""

    mass: Annotated[float | None, key("its mass, or else its density or material", "kg")] = None
    density: Annotated[float | None, key("instead of the mass", "kg/m³")] = None
    material: Annotated[str | None, key("instead of the density, see Materials")] = None


class _Round(Matter, frozen=True):
    """Matter of a round shape, by its outer radius or diameter."""

    radius: Annotated[float | None, key("its outer radius, or else its diameter", "m")] = None
    diameter: Annotated[float | None, key("instead of the radius", "m")] = None

    def __post_init__(self) -> None:
        if self.diameter is None is self.radius:
            raise ValueError("key 'radius' is missing, or 'diameter' instead")
        if self.diameter is not None and self.radius:
            raise ValueError("it takes a radius or a diameter, not both")

    @property
    def outer(self) -> float:
        """The outer radius [m]."""
        return (self.radius or 0.0) if self.diameter is None else self.diameter / 2


class _Bored(_Round, frozen=True):
    """A round shape about an axis, with or without a round hole."""

    inner_radius: Annotated[float, key("of its hole", "m")] = 0.0
    centre: _Place = _ORIGIN
    axis: _Axis = None


# The parts, of which bodies are put together.
class Point(Table, frozen=True, kw_only=True, tag_field="kind", tag="point"):
    """A mass without a size."""

    mass: _Mass
    centre: _Place = _ORIGIN
    name: _Name = None


class Sphere(_Round, frozen=True, tag_field="kind", tag="sphere"):
    """A ball, solid or hollow."""

    thickness: Annotated[float | None, key("of its wall; without it the ball is solid", "m")] = None
    centre: _Place = _ORIGIN
    name: _Name = None


class Box(Matter, frozen=True, kw_only=True, tag_field="kind", tag="box"):
    """A cuboid."""

    size: Annotated[Triple, key("its three edges, whole lengths", "m")]
    centre: _Place = _ORIGIN
    attitude: Annotated[
        _Quadruple, key("quaternion (w, x, y, z) that turns its edges from x, y, z")
    ] = _UPRIGHT
    name: _Name = None


class Cylinder(_Bored, frozen=True, kw_only=True, tag_field="kind", tag="cylinder"):
    """A cylinder or a tube."""

    length: Annotated[float, key("along the axis", "m")]
    name: _Name = None


class Disc(_Bored, frozen=True, tag_field="kind", tag="disc"):
    """A round plate, with or without a round hole."""

    thickness: Annotated[float, key("along the axis; a density needs it", "m")] = 0.0
    name: _Name = None


class Ring(Table, frozen=True, kw_only=True, tag_field="kind", tag="ring"):
    """A hoop, all of whose mass is at its radius."""

    mass: _Mass
    radius: Annotated[float, key("its radius", "m")]
    centre: _Place = _ORIGIN
    axis: _Axis = None
    name: _Name = None


class Rod(_Round, frozen=True, kw_only=True, tag_field="kind", tag="rod"):
    """A round rod between two points."""

    begin: Annotated[Triple, key("the middle of its one end, from the sphere's centre", "m")]
    end: Annotated[Triple, key("the middle of its other end", "m")]
    radius: Annotated[float, key("of its round section; a density needs it", "m")] = 0.0
    name: _Name = None


Part = Point | Sphere | Box | Cylinder | Disc | Ring | Rod


class _BodyFile(Table, frozen=True):
    """A file with a body, and where that is laid."""

    file: Annotated[str, key("the file; a relative path is from the scene's own folder")]
    origin: Annotated[Triple, key("where its origin is, from the sphere's centre", "m")] = _ORIGIN
    attitude: Annotated[_Quadruple, key("quaternion (w, x, y, z) that turns its axes")] = _UPRIGHT


class MjcfTable(_BodyFile, frozen=True, kw_only=True):
    """A body of an MJCF file, with all that is fixed to it."""

    body: Annotated[str, key("the name of the body")]


class UrdfTable(_BodyFile, frozen=True, kw_only=True):
    """A link of a URDF file, with all that is fixed to it."""

    link: Annotated[str, key("the name of the link")]


Rows = list[float | Triple]  # three moments, or three rows: msgspec knows no list of either
_Tensor = Annotated[
    Rows | None, key("about its own centre of mass: three moments, or three rows of three", "kg m²")
]


class Axial(Table, frozen=True):
    """Moments of a symmetric body about its axis and across it."""

    axial: Annotated[float, key("about the axis", "kg m²")]
    transverse: Annotated[float, key("across it", "kg m²")]


class ShellInertia(Table, frozen=True):
    """Two moments about the shell's own centre of mass, or a thickness."""

    axial: Annotated[float | None, key("about the axis", "kg m²")] = None
    transverse: Annotated[float | None, key("across it", "kg m²")] = None
    thickness: Annotated[float | None, key("as `thickness` of the shell", "m")] = None


class ShellTable(_Round, frozen=True):
    """The sphere that rolls: a wall, and parts fixed to it; symmetric about `axis`."""

    # Which of these combine the reader knows; the records have only what a value may be.
    thickness: Annotated[float | None, key("of the wall, the same all round", "m")] = None
    inertia: Annotated[
        Literal["thin"] | ShellInertia | None,
        key('of the wall, instead of its thickness: `"thin"` for none, or two moments'),
    ] = None
    axis: Annotated[
        Triple, key("what the frame turns about in the shell; a direction of any length")
    ] = (0.0, 0.0, 1.0)
    offset: Annotated[
        float, key("how far along `axis` the wall's centre of mass is from the sphere's", "m")
    ] = 0.0
    part: Annotated[list[Part] | None, key("parts fixed to the wall, see Parts")] = None
    mjcf: Annotated[MjcfTable | None, key("the whole shell from an MJCF file")] = None
    urdf: Annotated[UrdfTable | None, key("the whole shell from a URDF file")] = None


class _BodyTable(HingeTable, frozen=True):
    """A body on a hinge, but for its inertia and the hinge's place."""

    mass: Annotated[float | None, key("its mass", "kg")] = None
    centre: Annotated[
        Triple | None, key("the centre of mass, from the sphere's centre; 0 if not given", "m")
    ] = None
    part: Annotated[list[Part] | None, key("parts that it is made of, see Parts")] = None
    mjcf: Annotated[MjcfTable | None, key("a body of an MJCF file")] = None
    urdf: Annotated[UrdfTable | None, key("a link of a URDF file")] = None


class FrameTable(_BodyTable, frozen=True):
    """The body that turns in the shell, about the shell's axis, and carries the others."""

    inertia: _Tensor = None


class RotorTable(_BodyTable, frozen=True, kw_only=True):
    """A symmetric body on the frame that turns about its own axis."""

    inertia: Annotated[Axial | None, key("its moments")] = None
    axis: Annotated[Triple, key("its axis; a direction of any length")]


class PendulumTable(_BodyTable, frozen=True, kw_only=True):
    """Any body on a hinge of the frame, as it is at the hinge's angle 0."""

    inertia: _Tensor = None
    axis: Annotated[Triple, key("the hinge's axis; a direction of any length")]
    pivot: Annotated[Triple, key("a point of the axis, from the sphere's centre", "m")] = _ORIGIN


class FrictionTable(Table, frozen=True):
    """Friction of the plane against the shell."""

    sliding: Annotated[
        float | None, key("largest friction over the normal force; as much as needed if not given")
    ] = None
    # None is as much as needed; 0, a plane of ice, is refused.
    torsional: Annotated[
        float | None, key("largest torque about the vertical over the normal force; likewise", "m")
    ] = None
    rolling: Annotated[float, key("torque against rolling over the normal force", "m")] = 0.0


class PlaneTable(Table, frozen=True):
    """How the plane moves, without turning."""

    motion: Annotated[_Three, key("its acceleration along the world's X, Y, Z", "m/s²")] = _ORIGIN


class NumbersTable(Table, frozen=True):
    """The numbers of the equations, for which bodies are designed."""

    radius: Annotated[float, key("a", "m")]
    A: Annotated[Rows, key("A: its diagonal, or three rows", "1/(kg m²)")]
    K: Annotated[Triple, key("K, in the same axes", "kg m²/s")]
    Omega: Annotated[Triple, key("Ω, in the same axes", "rad/s")]
    mass: Annotated[float | None, key("of the whole ball; found if not given", "kg")] = None


class _SectionTable(Table, frozen=True):
    """The section's coordinates (5.5), in the principal axes of the ball's inertia."""

    L: Annotated[float, key("M along the third axis", "kg m²/s")]
    l: Annotated[float, key("angle of M about it", "rad")]
    g: Annotated[float, key("angle of γ about M", "rad")]
    f: Annotated[float, key("M²", "(kg m²/s)²")]
    c: Annotated[float, key("(M, γ); 0 in the rubber model", "kg m²/s")] = 0.0


class StartTable(Table, frozen=True):
    """An attitude and what turns the ball, in one of three forms."""

    attitude: Annotated[
        _Quadruple | None, key("quaternion (w, x, y, z) of the frame, frame to world")
    ] = None
    gamma: Annotated[Triple | None, key("the upward vertical, in frame axes; of length 1")] = None
    alpha: Annotated[Triple | None, key("the world's X, in frame axes; of length 1")] = None
    angular_velocity: Annotated[
        Triple | None, key("ω of the frame, in frame axes; 0 is a frame that stands still", "rad/s")
    ] = None
    momentum: Annotated[Triple | None, key("M in frame axes", "kg m²/s")] = None
    momentum_world: Annotated[Triple | None, key("M in world axes", "kg m²/s")] = None
    rest: Annotated[
        bool, key("`true` is M = 0, the paper's rest; what turns at the start turns the ball then")
    ] = False
    section: Annotated[_SectionTable | None, key("the paper's section coordinates")] = None


class SceneTable(Table, frozen=True, kw_only=True):
    """The table of a whole scene file."""

    title: Annotated[str, key("one line, for tables and plots")]
    source: Annotated[str, key("where the numbers come from, any lines of text")] = ""
    rolling: Annotated[
        Rolling,
        key("`rubber`: the shell neither slips nor spins on the spot; `classical`: no slip"),
    ]
    duration: Annotated[float, key("of the motion", "s")]
    gravity: Annotated[float, key("how fast things fall", "m/s²")] = GRAVITY
    gravity_direction: Annotated[
        Triple,
        key(
            "which way they fall, a direction of any length; Z is up from the plane, and "
            "`[tan(slope), 0, -1]` is a plane that goes down towards X"
        ),
    ] = DOWN
    friction: Annotated[FrictionTable, key("friction of the plane, see Friction")] = FrictionTable()
    plane: Annotated[PlaneTable, key("how the plane moves, see Plane")] = PlaneTable()
    shell: Annotated[ShellTable | None, key("the sphere that rolls, see Shell")] = None
    frame: Annotated[FrameTable | None, key("what turns in it, see Frame")] = None
    rotor: Annotated[tuple[RotorTable, ...], key("`[[rotor]]`, any number of them, see Rotor")] = ()
    pendulum: Annotated[
        tuple[PendulumTable, ...], key("`[[pendulum]]`, any number of them, see Pendulum")
    ] = ()
    numbers: Annotated[
        NumbersTable | None, key("instead of bodies: numbers of the paper's equations, see Numbers")
    ] = None
    start: Annotated[StartTable, key("where the motion starts, see Start")]
