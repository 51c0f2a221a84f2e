"""The tables of a scene's TOML, as msgspec decodes them, and the readers of hinges and starts.

Each key has its meaning and unit beside it, from which docs/scene.md is written. In order: hinges,
starts, bodies (by numbers, by parts, or from another file), the whole scene. The file
`bodies` makes bodies of these tables.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from robotball import scene as starts
from robotball.drives import (
    COMMAND,
    Free,
    Motor,
    PositionServo,
    Ramp,
    Rate,
    Samples,
    Servo,
    Sine,
    Sum,
    Torque,
    key,
)
from robotball.equations import Rolling
from robotball.errors import InputError
from robotball.files.parts import ORIGIN, UPRIGHT, Part, Quadruple, Triple
from robotball.robot import Ball
from robotball.rotations import Array, rotation_matrix
from robotball.scene import DOWN, GRAVITY, Scene, Start


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A TOML table in which every key must be known."""

    def given(self, *keys: str) -> list[str]:
        """Return those of the keys that the table has."""
        return [each for each in keys if getattr(self, each) is not None]


def one_of(name: str, ways: dict[str, list[str]]) -> str:
    """Return the alternative whose keys the user gave. Raises InputError for none or several."""
    told = [way for way, keys in ways.items() if keys]
    if len(told) != 1:
        given = " and ".join(", ".join(ways[way]) for way in told) or "nothing"
        raise InputError(f"{name} gives {given}; it takes {', or '.join(ways)}")
    return told[0]


DriveName = Literal["prescribed", "servo", "position", "torque", "free"]


class SamplesTable(Table, frozen=True, tag_field="kind", tag="samples"):
    """Samples, given here or in a file."""

    times: Annotated[list[float] | None, key("increasing times, over the whole run", "s")] = None
    values: Annotated[list[float] | None, key("as many values", COMMAND)] = None
    file: Annotated[
        str | None,
        key("instead of both: a file (.csv, .npz) of two columns, time and value, with names"),
    ] = None


Told = float | Ramp | Sine | SamplesTable
Command = Told | list[Told]


class HingeTable(Table, frozen=True):
    """How a hinge is moved, and where it starts."""

    drive: Annotated[
        DriveName,
        key("what moves the hinge, see Drives; `prescribed`: it keeps its rate exactly"),
    ] = "prescribed"
    rate: Annotated[
        Command | None, key("commanded rate, a command as below; 0 if not given", "rad/s")
    ] = None
    angle: Annotated[Command | None, key("commanded angle, a command as below", "rad")] = None
    torque: Annotated[Command | None, key("commanded torque, a command as below", "N m")] = None
    kv: Annotated[float | None, key("gain: torque per rate missed", "N m s/rad")] = None
    kp: Annotated[float | None, key("gain: torque per angle missed", "N m/rad")] = None
    kd: Annotated[float | None, key("damping: torque against the rate", "N m s/rad")] = None
    torque_limit: Annotated[float | None, key("the motor's largest torque", "N m")] = None
    damping: Annotated[float | None, key("torque against the rate", "N m s/rad")] = None
    stiffness: Annotated[float | None, key("of a spring", "N m/rad")] = None
    rest: Annotated[float | None, key("the angle at which the spring rests", "rad")] = None
    armature: Annotated[
        float | None, key("inertia of the motor's own rotor, times its gear ratio squared", "kg m²")
    ] = None
    initial_angle: Annotated[float, key("angle at the start", "rad")] = 0.0
    initial_rate: Annotated[
        float | None,
        key("rate at the start; if not given, that of a velocity servo's command, else 0", "rad/s"),
    ] = None


# The keys of each drive, those that it needs first, of which the others have none.
NEEDED: dict[str, tuple[str, ...]] = {
    "prescribed": (),
    "servo": ("kv",),
    "position": ("kp", "angle"),
    "torque": ("torque",),
    "free": (),
}
ALLOWED: dict[str, tuple[str, ...]] = {
    "prescribed": ("rate",),
    "servo": ("rate", "torque_limit", "armature", "initial_rate"),
    "position": ("kd", "torque_limit", "armature", "initial_rate"),
    "torque": ("armature", "initial_rate"),
    "free": ("damping", "stiffness", "rest", "armature", "initial_rate"),
}


@dataclass(frozen=True)
class ReadHinge:
    """A hinge's command, motor, and angle and rate at the start; None is as the command is."""

    command: Rate
    motor: Motor | None
    angle: float
    rate: float | None


def read_hinge(name: str, table: HingeTable, folder: Path) -> ReadHinge:
    """Read the hinge keys of a body's table. Raises InputError for keys that do not combine."""
    _check_keys(name, table)
    told = {"position": table.angle, "torque": table.torque}.get(table.drive, table.rate)
    try:
        command = _command(0.0 if told is None else told, folder)
        motor = _motor(table)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    return ReadHinge(command, motor, table.initial_angle, table.initial_rate)


def _check_keys(name: str, table: HingeTable) -> None:
    drive = table.drive
    for each in NEEDED[drive]:
        if getattr(table, each) is None:
            unit = unit_of(each)
            raise InputError(f'{name}: drive = "{drive}" needs the key {each!r} [{unit}]')
    known = {*NEEDED[drive], *ALLOWED[drive]}
    every = [each for drives in (NEEDED, ALLOWED) for keys in drives.values() for each in keys]
    for each in table.given(*dict.fromkeys(every)):
        if each not in known:
            owners = [d for d in NEEDED if each in (*NEEDED[d], *ALLOWED[d])]
            listed = " or ".join(f'"{owner}"' for owner in owners)
            raise InputError(f'{name}: {each} belongs to drive = {listed}, not to "{drive}"')


def unit_of(name: str) -> str:
    """Return the unit of one of a hinge's keys."""
    table = msgspec.inspect.type_info(HingeTable)
    assert isinstance(table, msgspec.inspect.StructType)
    (told,) = (field.type for field in table.fields if field.name == name)
    assert isinstance(told, msgspec.inspect.Metadata)
    return str((told.extra or {})["unit"])


def _command(told: Command, folder: Path) -> Rate:
    if isinstance(told, list):
        return Sum(tuple(_command(each, folder) for each in told))
    if not isinstance(told, SamplesTable):
        return told
    if told.file is not None:
        if told.times is not None or told.values is not None:
            raise InputError("samples take a file, or times and values, not both")
        from robotball.files.columns import read_samples

        return read_samples(folder / told.file)
    if told.times is None or told.values is None:
        missing = "times" if told.times is None else "values"
        raise InputError(f"samples: key {missing!r} is missing, or 'file' instead")
    return Samples(times=tuple(told.times), values=tuple(told.values))


def _motor(table: HingeTable) -> Motor | None:
    armature = table.armature or 0.0
    if table.drive == "servo":
        return Servo(table.kv or 0.0, table.torque_limit, armature)
    if table.drive == "position":
        return PositionServo(table.kp or 0.0, table.kd or 0.0, table.torque_limit, armature)
    if table.drive == "torque":
        return Torque(armature)
    if table.drive == "free":
        return Free(table.damping or 0.0, table.stiffness or 0.0, table.rest or 0.0, armature)
    return None


class SectionTable(Table, frozen=True):
    """The section's coordinates (5.5), in the principal axes of the ball's inertia."""

    L: Annotated[float, key("M along the third axis", "kg m²/s")]
    l: Annotated[float, key("angle of M about it", "rad")]
    g: Annotated[float, key("angle of γ about M", "rad")]
    f: Annotated[float, key("M²", "(kg m²/s)²")]
    c: Annotated[float, key("(M, γ); 0 in the rubber model", "kg m²/s")] = 0.0


class StartTable(Table, frozen=True):
    """An attitude and what turns the ball, in one of three forms."""

    attitude: Annotated[
        Quadruple | None, key("quaternion (w, x, y, z) of the frame, frame to world")
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
    section: Annotated[SectionTable | None, key("the paper's section coordinates")] = None


START_FORMS = (
    "section, or gamma and momentum, or an attitude (attitude, or gamma and alpha) with one of "
    "momentum, momentum_world, angular_velocity and rest (M = 0; a ball that stands still has "
    "angular_velocity = [0, 0, 0])"
)
MOMENTUM_KEYS = {"momentum", "momentum_world", "angular_velocity", "rest"}


def read_start(table: StartTable, ball: Ball) -> Start:
    """Return the one start that the table gives; a section's is in principal axes.

    An angular velocity leaves M at 0, which `turning` sets when the hinges are known.
    """
    given = {key for key in table.__struct_fields__ if getattr(table, key)}
    axes = ball.principal[1]
    if given == {"section"} and table.section:
        gamma, M = starts.section_state(*msgspec.structs.astuple(table.section))
        return starts.along_momentum(axes @ gamma, axes @ M)
    if given == {"gamma", "momentum"}:
        gamma = starts.unit("gamma", np.array(table.gamma))
        return starts.along_momentum(gamma, np.array(table.momentum))
    if (
        given - MOMENTUM_KEYS in ({"attitude"}, {"gamma", "alpha"})
        and len(given & MOMENTUM_KEYS) == 1
    ):
        attitude = _attitude(table)
        return Start(attitude, _momentum(table, rotation_matrix(attitude)))
    keys = ", ".join(sorted(given)) or "nothing"
    raise InputError(f"start gives {keys}; it takes one form: {START_FORMS}")


def turning(scene: Scene, omega: Triple) -> Scene:
    """Return the scene with the frame's angular velocity (3,) at its start, frame axes [rad/s].

    Raises InputError where the shell would spin on the spot and the rolling model is rubber.
    """
    from robotball.mechanics import momentum_at

    start, turned = scene.start, np.array(omega)
    angles = np.array([hinge.angle for hinge in scene.hinges])
    rates = np.array([hinge.rate for hinge in scene.hinges])
    if scene.rolling == "rubber":
        gamma = rotation_matrix(start.attitude)[2]
        starts.check_no_spin(turned - rates[0] * scene.ball.shell.axis, gamma)
    M = momentum_at(scene.ball, scene.rolling, start.attitude, turned, angles, rates)
    return replace(scene, start=replace(start, momentum=M))


def _attitude(table: StartTable) -> Array:
    if table.attitude:
        return starts.unit("attitude", np.array(table.attitude))
    gamma, alpha = np.array(table.gamma), np.array(table.alpha)
    return starts.attitude_of_axes(starts.unit("gamma", gamma), starts.unit("alpha", alpha))


def _momentum(table: StartTable, to_world: Array) -> Array:
    """Return M (3,) in world axes of a table with one of MOMENTUM_KEYS."""
    if table.momentum:
        return to_world @ np.array(table.momentum)
    if table.momentum_world:
        return np.array(table.momentum_world)
    return np.zeros(3)


File = Annotated[str, key("the file; a relative path is from the scene's own folder")]
Origin = Annotated[Triple, key("where the body's origin is, from the sphere's centre", "m")]
Attitude = Annotated[Quadruple, key("quaternion (w, x, y, z) that turns the body's axes")]
Parts = Annotated[list[Part] | None, key("parts that it is made of, see Parts")]


class MjcfTable(Table, frozen=True):
    """A body of an MJCF file, with all that is fixed to it."""

    file: File
    body: Annotated[str, key("the name of the body")]
    origin: Origin = ORIGIN
    attitude: Attitude = UPRIGHT


class UrdfTable(Table, frozen=True):
    """A link of a URDF file, with all that is fixed to it."""

    file: File
    link: Annotated[str, key("the name of the link")]
    origin: Origin = ORIGIN
    attitude: Attitude = UPRIGHT


Mjcf = Annotated[MjcfTable | None, key("a body of an MJCF file")]
Urdf = Annotated[UrdfTable | None, key("a link of a URDF file")]
Rows = list[float | Triple]


class Axial(Table, frozen=True):
    """Moments of a symmetric body about its axis and across it."""

    axial: Annotated[float, key("about the axis", "kg m²")]
    transverse: Annotated[float, key("across it", "kg m²")]


class ShellInertia(Table, frozen=True):
    """Two moments about the shell's own centre of mass, or a thickness."""

    axial: Annotated[float | None, key("about the axis", "kg m²")] = None
    transverse: Annotated[float | None, key("across it", "kg m²")] = None
    thickness: Annotated[float | None, key("as `thickness` of the shell", "m")] = None


class ShellTable(Table, frozen=True):
    """The sphere that rolls: a wall, and parts fixed to it; symmetric about `axis`."""

    radius: Annotated[float, key("its outer radius", "m")]
    mass: Annotated[float | None, key("of the wall", "kg")] = None
    density: Annotated[float | None, key("of the wall, instead of its mass", "kg/m³")] = None
    thickness: Annotated[float | None, key("of the wall, the same all round", "m")] = None
    inertia: Annotated[
        Literal["thin"] | ShellInertia | None,
        key('of the wall, instead of its thickness: `"thin"` for none, or two moments'),
    ] = None
    offset: Annotated[
        float, key("how far along `axis` the wall's centre of mass is from the sphere's", "m")
    ] = 0.0
    axis: Annotated[
        Triple, key("what the frame turns about in the shell; a direction of any length")
    ] = (0.0, 0.0, 1.0)
    part: Annotated[list[Part] | None, key("parts fixed to the wall, see Parts")] = None
    mjcf: Annotated[MjcfTable | None, key("the whole shell from an MJCF file")] = None
    urdf: Annotated[UrdfTable | None, key("the whole shell from a URDF file")] = None


Centre = Annotated[
    Triple | None, key("the centre of mass, from the sphere's centre; 0 if not given", "m")
]


class FrameTable(HingeTable, frozen=True):
    """The body that turns in the shell, about the shell's axis, and carries the others."""

    mass: Annotated[float | None, key("its mass", "kg")] = None
    inertia: Annotated[
        Rows | None,
        key("about its own centre of mass: three moments, or three rows of three", "kg m²"),
    ] = None
    centre: Centre = None
    part: Parts = None
    mjcf: Mjcf = None
    urdf: Urdf = None


class RotorTable(HingeTable, frozen=True, kw_only=True):
    """A symmetric body on the frame that turns about its own axis."""

    axis: Annotated[Triple, key("its axis; a direction of any length")]
    mass: Annotated[float | None, key("its mass", "kg")] = None
    inertia: Annotated[Axial | None, key("its moments")] = None
    centre: Centre = None
    part: Parts = None
    mjcf: Mjcf = None
    urdf: Urdf = None


class PendulumTable(HingeTable, frozen=True, kw_only=True):
    """Any body on a hinge of the frame, as it is at the hinge's angle 0."""

    axis: Annotated[Triple, key("the hinge's axis; a direction of any length")]
    pivot: Annotated[Triple, key("a point of the axis, from the sphere's centre", "m")] = ORIGIN
    mass: Annotated[float | None, key("its mass", "kg")] = None
    inertia: Annotated[
        Rows | None,
        key("about its own centre of mass: three moments, or three rows of three", "kg m²"),
    ] = None
    centre: Centre = None
    part: Parts = None
    mjcf: Mjcf = None
    urdf: Urdf = None


class FrictionTable(Table, frozen=True):
    """Friction of the plane against the shell."""

    sliding: Annotated[
        float | None, key("largest friction over the normal force; as much as needed if not given")
    ] = None
    torsional: Annotated[
        float | None,
        key("largest torque about the vertical over the normal force; likewise", "m"),
    ] = None
    rolling: Annotated[float, key("torque against rolling over the normal force", "m")] = 0.0


class NumbersTable(Table, frozen=True):
    """The numbers of the equations, for which bodies are designed."""

    radius: Annotated[float, key("a", "m")]
    A: Annotated[list[float | Triple], key("A: its diagonal, or three rows", "1/(kg m²)")]
    K: Annotated[Triple, key("K, in the same axes", "kg m²/s")]
    Omega: Annotated[Triple, key("Ω, in the same axes", "rad/s")]
    mass: Annotated[float | None, key("of the whole ball; found if not given", "kg")] = None


class SceneTable(Table, frozen=True):
    """The table of a whole scene file."""

    title: Annotated[str, key("one line, for tables and plots")]
    rolling: Annotated[
        Rolling,
        key("`rubber`: the shell neither slips nor spins on the spot; `classical`: no slip"),
    ]
    duration: Annotated[float, key("of the motion", "s")]
    start: Annotated[StartTable, key("where the motion starts, see Start")]
    source: Annotated[str, key("where the numbers come from, any lines of text")] = ""
    gravity: Annotated[float, key("how fast things fall", "m/s²")] = GRAVITY
    gravity_direction: Annotated[
        Triple,
        key(
            "which way they fall, a direction of any length; Z is up from the plane, and "
            "`[tan(slope), 0, -1]` is a plane that goes down towards X"
        ),
    ] = DOWN
    friction: Annotated[FrictionTable, key("friction of the plane, see Friction")] = FrictionTable()
    shell: Annotated[ShellTable | None, key("the sphere that rolls, see Shell")] = None
    frame: Annotated[FrameTable | None, key("what turns in it, see Frame")] = None
    rotor: Annotated[tuple[RotorTable, ...], key("`[[rotor]]`, any number of them, see Rotor")] = ()
    pendulum: Annotated[
        tuple[PendulumTable, ...], key("`[[pendulum]]`, any number of them, see Pendulum")
    ] = ()
    numbers: Annotated[
        NumbersTable | None, key("instead of bodies: numbers of the paper's equations, see Numbers")
    ] = None
