"""Scenes as TOML: the catalog in scenes/, and files of the user's own."""

import difflib
import re
from pathlib import Path

import msgspec
import numpy as np

from robotball.bodies import (
    Ball,
    Frame,
    Rotor,
    Shell,
    beyond_the_shell,
    thick_shell_inertia,
    thin_shell_inertia,
)
from robotball.designing.design import Design, design
from robotball.drives import Rate, as_drive
from robotball.errors import InputError, check_size, unknown, warn
from robotball.files.catalog import CATALOG, catalog
from robotball.files.mjcf import frame_of_mjcf
from robotball.files.scene_table import (
    FrameTable,
    HingeTable,
    NumbersTable,
    RotorTable,
    SceneTable,
    ShellTable,
    Triple,
    known_keys,
    read_start,
)
from robotball.motors import Servo
from robotball.parameters import parameters_of
from robotball.rotations import Array, normalised
from robotball.scene import Scene


def load_scene(name: str | Path) -> Scene:
    """The scene of a catalog name, or of a path to a TOML file.

    Raises InputError, with the file and the key, where there is none or it cannot be used, and
    warns of bodies that no workshop could build.
    """
    path = CATALOG / f"{name}.toml"
    if str(name) not in catalog():
        path = Path(name)
        if path.suffix != ".toml":
            raise unknown("scene", name, catalog())
    try:
        text = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except ValueError as error:  # a null byte in the name
        raise InputError(f"{path}: {error}") from None
    scene = read_scene(path, text)
    for line in beyond_the_shell(scene.ball):
        warn(f"{scene.name}: {line}")
    return scene


def read_scene(path: Path, text: bytes | str) -> Scene:
    """The scene of the text of a TOML file, whose path gives it its name; raises InputError."""
    try:
        table = msgspec.toml.decode(text, type=SceneTable)
        _check_numbers("", msgspec.to_builtins(table))
        return _scene(path, table)
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: {_counted(_explained(str(error)))}") from None
    except InputError as error:
        raise InputError(f"{path}: {_counted(str(error))}") from None
    # ValueError: bytes that are no text, an integer of thousands of digits; RecursionError: as
    # many brackets.
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: not TOML: {error}") from None


def _check_numbers(key: str, value: object) -> None:
    """Raises InputError, with the key, for a number of a TOML value that is NaN or too large."""
    if isinstance(value, float):
        check_size(key, value)
    if isinstance(value, dict):
        for name, inner in value.items():
            _check_numbers(f"{key}.{name}" if key else name, inner)
    if isinstance(value, list | tuple):
        for i, inner in enumerate(value):
            _check_numbers(f"{key}[{i}]", inner)


def _counted(message: str) -> str:
    """The message with its rotors named as the bodies are: rotor1 is rotor[0]."""
    return re.sub(r"\brotor\[(\d+)\]", lambda found: f"rotor{int(found[1]) + 1}", message)


def _explained(message: str) -> str:
    """Msgspec's message, with the key's path first and a near match for a misspelt key."""
    where = re.search(r" - at `\$\.?(.*)`$", message)
    key, what = (where[1], message[: where.start()]) if where else ("", message)
    unknown = re.search(r"unknown field `(.*)`", what)
    if unknown:
        table = re.sub(r"\[.*?\]", "", key)
        near = difflib.get_close_matches(unknown[1], known_keys(table), n=1)
        what = f"unknown key {unknown[1]!r}" + (f"; did you mean {near[0]!r}?" if near else "")
    missing = re.search(r"missing required field `(.*)`", what)
    if missing:
        what = f"key {missing[1]!r} is missing"
    return f"{key}: {what}" if key else what


def _scene(path: Path, table: SceneTable) -> Scene:
    ball, rates, motors = _parts(table, path.parent)
    drives = [as_drive(rate, table.duration) for rate in rates]
    at_start = parameters_of(ball, table.rolling, [float(each.rate(0.0)) for each in drives])
    return Scene(
        name=path.stem.encode(errors="replace").decode(),  # bytes that are no text are shown as ?
        title=table.title,
        source=table.source,
        ball=ball,
        rolling=table.rolling,
        frame_rate=rates[0],
        rotor_rates=tuple(rates[1:]),
        start=read_start(table.start, ball, at_start),
        duration=table.duration,
        gravity=table.gravity,
        motors=tuple(motors) if any(motors) else (),
    )


def _parts(table: SceneTable, folder: Path) -> tuple[Ball, list[Rate], list[Servo | None]]:
    """The ball, its hinges' rates and their motors: as given, or designed for given numbers."""
    if table.numbers is not None:
        if table.shell or table.frame or table.rotor:
            raise InputError("a scene takes bodies or numbers, not both")
        found = design_of(table.numbers)
        return found.ball, [found.frame_rate, *found.rotor_rates], []
    if table.shell is None or table.frame is None:
        missing = "frame" if table.shell else "shell"
        raise InputError(f"key {missing!r} is missing; a scene takes shell and frame, or numbers")
    ball = Ball(
        shell=_shell(table.shell),
        frame=_frame(table.frame, folder),
        rotors=tuple(_rotor(i, rotor) for i, rotor in enumerate(table.rotor, start=1)),
    )
    hinges: list[HingeTable] = [table.frame, *table.rotor]
    names = ["frame", *(f"rotor{i}" for i in range(1, 1 + len(table.rotor)))]
    motors = [_motor(name, hinge) for name, hinge in zip(names, hinges, strict=True)]
    return ball, [hinge.rate for hinge in hinges], motors


def design_of(numbers: NumbersTable) -> Design:
    """The bodies for a [numbers] table; raises InputError where there are none."""
    size = {isinstance(row, tuple) for row in numbers.A}
    if len(numbers.A) != 3 or len(size) != 1:
        raise InputError("numbers.A takes a diagonal of three, or three rows of three")
    return design(np.array(numbers.A), numbers.Omega, numbers.K, numbers.radius, numbers.mass)


def _shell(table: ShellTable) -> Shell:
    axial, transverse = _shell_moments(table)
    return Shell(
        radius=table.radius,
        mass=table.mass,
        axial_inertia=axial,
        transverse_inertia=transverse,
        axis=_direction("shell.axis", table.axis),
    )


def _shell_moments(table: ShellTable) -> tuple[float, float]:
    given = table.inertia
    if given == "thin":
        moment = thin_shell_inertia(table.radius, table.mass)
        return moment, moment
    if given.thickness is not None and (given.axial, given.transverse) == (None, None):
        moment = thick_shell_inertia(table.radius, table.mass, given.thickness)
        return moment, moment
    if given.thickness is None and given.axial is not None and given.transverse is not None:
        return given.axial, given.transverse
    raise InputError('shell.inertia takes "thin", or thickness, or axial and transverse')


def _frame(table: FrameTable, folder: Path) -> Frame:
    if table.mjcf is not None:
        if table.mass is not None or table.inertia is not None:
            raise InputError("frame takes mjcf, or mass and inertia, not both")
        return frame_of_mjcf(folder / table.mjcf.file, table.mjcf.body)
    for key in ("mass", "inertia"):
        if getattr(table, key) is None:
            raise InputError(f"frame: key {key!r} is missing")
    return Frame(
        mass=float(table.mass or 0.0),
        inertia=np.array(table.inertia),
        centre=np.array(table.centre),
    )


def _rotor(number: int, table: RotorTable) -> Rotor:
    return Rotor(
        mass=table.mass,
        axial_inertia=table.inertia.axial,
        transverse_inertia=table.inertia.transverse,
        axis=_direction(f"rotor{number}'s axis", table.axis),
        centre=np.array(table.centre),
    )


def _motor(name: str, table: HingeTable) -> Servo | None:
    if table.drive == "servo":
        if table.kv is None:
            raise InputError(f"{name}: a servo needs its gain kv [N m s/rad]")
        return Servo(table.kv, table.torque_limit)
    if table.kv is not None or table.torque_limit is not None:
        raise InputError(f'{name}: kv and torque_limit belong to drive = "servo"')
    return None


def _direction(name: str, v: Triple) -> Array:
    length = float(np.linalg.norm(v))
    if not (np.isfinite(length) and length > 0):
        raise InputError(f"{name} must have a length and a direction, unlike {list(v)}")
    return normalised(np.array(v))
