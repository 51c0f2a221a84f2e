"""The keys of a hinge: what it is commanded, what moves it, and where it starts."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from robotball.described import key
from robotball.drives import Rate, Sum
from robotball.errors import InputError
from robotball.files.samples_file import read_samples
from robotball.files.tables import Table
from robotball.motors import Free, Motor, PositionServo, Servo, Torque
from robotball.rates import COMMAND, Ramp, Samples, Sine

DriveName = Literal["prescribed", "servo", "position", "torque", "free"]


class SamplesTable(Table, frozen=True, tag_field="kind", tag="samples"):
    """Samples, told here or in a file."""

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
    """What the hinge keys of a body's table say; InputError for keys that do not go together."""
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
    """The unit of one of a hinge's keys."""
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
