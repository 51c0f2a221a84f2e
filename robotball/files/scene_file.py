"""Read scenes from TOML: the catalog in scenes/, and files of the user's own.

msgspec decodes a file into the tables of `scene_tables`, which refuse unknown keys. `explained`
puts its errors into the author's words, and is loaded when there is one.
"""

import tomllib
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from robotball.drives import Motor
from robotball.errors import InputError, check_size, unknown, warn
from robotball.files import contents
from robotball.files.bodies import read_frame, read_pendulum, read_rotor, read_shell
from robotball.files.parts import Triple, direction
from robotball.files.scene_tables import (
    NumbersTable,
    ReadHinge,
    SceneTable,
    read_hinge,
    read_start,
    turning,
)
from robotball.robot import Ball, beyond_the_shell
from robotball.scene import Friction, Scene

if TYPE_CHECKING:
    from robotball.designing import Design

CATALOG = Path(__file__).parent.parent / "scenes"


@dataclass(frozen=True)
class Entry:
    """What heads a scene's file: its name, title, rolling model and duration [s]."""

    name: str
    title: str
    rolling: str
    duration: float


def catalog() -> list[str]:
    """The names of the scenes that come with robotball."""
    return sorted(path.stem for path in CATALOG.glob("*.toml"))


def entries() -> list[Entry]:
    """The heads of all these scenes, whose balls are not made."""
    tables = {name: tomllib.loads((CATALOG / f"{name}.toml").read_text()) for name in catalog()}
    return [
        Entry(name, table["title"], table["rolling"], table["duration"])
        for name, table in tables.items()
    ]


def load_scene(name: str | Path) -> Scene:
    """The scene of a catalog name, or of a path to a TOML file.

    Raises InputError, with the file and the key, where there is none or it cannot be used, and
    warns of bodies that no workshop could build.
    """
    path = CATALOG / f"{name}.toml"
    if str(name) not in catalog():
        path = Path(name)
        if path.suffix != ".toml":
            with suppress(OSError):  # of a name that no file can have
                if path.exists():
                    raise InputError(
                        f"{path}: a scene is a TOML file, in which a body can be one of an MJCF or "
                        "URDF file: write one with the key `mjcf` or `urdf`, see docs/scene.md"
                    )
            raise unknown("scene", name, catalog())
    scene = read_scene(path, contents(path))
    for line in beyond_the_shell(scene.ball):
        warn(f"{scene.name}: {line}")
    return scene


def read_scene(path: Path, text: bytes | str) -> Scene:
    """The scene of the text of a TOML file, whose path gives it its name; raises InputError."""
    try:
        table = msgspec.toml.decode(text, type=SceneTable)
        _check_numbers("", msgspec.to_builtins(table))
        return _scene(path, table)
    except (msgspec.ValidationError, InputError) as error:
        from robotball.files.explained import counted, explained

        ours = isinstance(error, InputError)
        raise InputError(
            f"{path}: {counted(str(error) if ours else explained(str(error)))}"
        ) from None
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


def _scene(path: Path, table: SceneTable) -> Scene:
    ball, hinges = _parts(table, path.parent)
    rotors, told = len(ball.rotors), table.start.angular_velocity
    start = read_start(table.start, ball)
    scene = Scene(
        name=path.stem.encode(errors="replace").decode(),  # bytes that are no text are shown as ?
        title=table.title,
        source=table.source,
        ball=ball,
        rolling=table.rolling,
        frame_rate=hinges[0].command,
        rotor_rates=tuple(hinge.command for hinge in hinges[1 : 1 + rotors]),
        pendulum_rates=tuple(hinge.command for hinge in hinges[1 + rotors :]),
        start=replace(start, hinge_angles=np.array([hinge.angle for hinge in hinges])),
        duration=table.duration,
        gravity=table.gravity,
        gravity_direction=_down(table.gravity_direction),
        friction=Friction(*msgspec.structs.astuple(table.friction)),
        motors=_motors(hinges),
    )
    scene = _with_rates(scene, [hinge.rate for hinge in hinges])
    return scene if told is None else turning(scene, told)


def _with_rates(scene: Scene, told: list[float | None]) -> Scene:
    """The scene whose hinges start at the rates told, the others as the scene has them."""
    if all(rate is None for rate in told):
        return scene
    rates = [
        hinge.rate if rate is None else rate for hinge, rate in zip(scene.hinges, told, strict=True)
    ]
    return replace(scene, start=replace(scene.start, hinge_rates=np.array(rates)))


def _parts(table: SceneTable, folder: Path) -> tuple[Ball, list[ReadHinge]]:
    """The ball and its hinges: as given, or designed for given numbers."""
    if table.numbers is not None:
        if table.shell or table.frame or table.rotor or table.pendulum:
            raise InputError("a scene takes bodies or numbers, not both")
        found = design_of(table.numbers)
        rates = (found.frame_rate, *found.rotor_rates)
        return found.ball, [ReadHinge(rate, None, 0.0, None) for rate in rates]
    if table.shell is None or table.frame is None:
        missing = "frame" if table.shell else "shell"
        raise InputError(f"key {missing!r} is missing; a scene takes shell and frame, or numbers")
    radius = table.shell.radius
    rotors = [(f"rotor{i}", each) for i, each in enumerate(table.rotor, start=1)]
    pendulums = [(f"pendulum{i}", each) for i, each in enumerate(table.pendulum, start=1)]
    ball = Ball(
        shell=read_shell(table.shell, folder),
        frame=read_frame(table.frame, radius, folder),
        rotors=tuple(read_rotor(*each, radius, folder) for each in rotors),
        pendulums=tuple(read_pendulum(*each, radius, folder) for each in pendulums),
    )
    hinged = (("frame", table.frame), *rotors, *pendulums)
    return ball, [read_hinge(name, each, folder) for name, each in hinged]


def _motors(hinges: list[ReadHinge]) -> tuple[Motor | None, ...]:
    motors = tuple(hinge.motor for hinge in hinges)
    return motors if any(motors) else ()


def _down(v: Triple) -> Triple:
    x, y, z = direction("gravity_direction", np.array(v)).tolist()
    return (x, y, z)


def design_of(numbers: NumbersTable) -> "Design":
    """The bodies for a [numbers] table; raises InputError where there are none."""
    from robotball.designing import design

    size = {isinstance(row, tuple) for row in numbers.A}
    if len(numbers.A) != 3 or len(size) != 1:
        raise InputError("numbers.A takes a diagonal of three, or three rows of three")
    return design(np.array(numbers.A), numbers.Omega, numbers.K, numbers.radius, numbers.mass)
