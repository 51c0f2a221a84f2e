"""What is wrong with a scene's TOML, in the words of its author: the key first, then what to do.

The scenes that come with robotball: their names, and what heads their files.

Scenes as TOML: the catalog in scenes/, and files of the user's own.
"""

import difflib
import re
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
from msgspec import inspect

from robotball.designing import Design, design
from robotball.drives import Motor
from robotball.errors import InputError, check_size, unknown, warn
from robotball.files.bodies import read_frame, read_pendulum, read_rotor, read_shell
from robotball.files.parts import Triple, direction
from robotball.files.reading import contents
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

WORDS = {
    "float": "a number",
    "int": "a whole number",
    "str": "text",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
}
# Other formats' words for a key, of which another key has more letters.
MEANT = dict.fromkeys(("max_torque", "torque_max", "effort", "forcerange"), "torque_limit")
MANY = ("rotor", "pendulum", "part")


def explained(message: str) -> str:
    """Msgspec's message with the key's path first, near matches and what is known."""
    where = re.search(r" - at `\$\.?(.*)`$", message)
    key, what = (where[1], message[: where.start()]) if where else ("", message)
    told = _told(key, what)
    return f"{key}: {told}" if key else told


def counted(message: str) -> str:
    """The message with all that is many counted as the bodies are: rotor1 is rotor[0]."""
    many = rf"\b({'|'.join(MANY)})\[(\d+)\]"
    return re.sub(many, lambda found: f"{found[1]}{int(found[2]) + 1}", message)


def _told(key: str, what: str) -> str:
    if unknown := re.search(r"unknown field `(.*)`", what):
        word, known = unknown[1], known_keys(key)
        meant = MEANT.get(word)
        near = [meant] if meant in known else difflib.get_close_matches(word, known, n=1)
        return f"unknown key {word!r}" + (f"; did you mean {near[0]!r}?" if near else "")
    if missing := re.search(r"missing required field `(.*)`", what):
        kinds = _listed(f"{key}.kind") if missing[1] == "kind" else ""
        return f"key {missing[1]!r} is missing{kinds}"
    if invalid := re.match(r"Invalid (?:enum )?value (.*)$", what):
        return f"unknown value {invalid[1]}{_listed(key)}"
    if expected := re.match(r"Expected (.*), got `?(\w+)`?$", what):
        if key.split(".")[-1] in MANY and expected[2] == "object":
            return f"a scene may have many; write [[{key}]] for each"
        types, given = expected[1].replace(" | null", ""), expected[2]
        types = re.sub(r"`array` of length (\d+)", r"a list of \1", types).replace(" | ", " or ")
        types = re.sub(r"\w+", lambda word: WORDS.get(word[0], word[0]), types).replace("`", "")
        return f"it must be {types}, not {WORDS.get(given, given)}"
    return what


def _listed(path: str) -> str:
    known = ", ".join(dict.fromkeys(_values_at(path)))
    return f"; it takes {known}" if known else ""


def known_keys(path: str) -> list[str]:
    """The keys of the table at a path such as `frame.part[0]`, of any of its kinds."""
    return [field.name for table in tables_at(path) for field in table.fields]


def tables_at(path: str) -> Iterator[inspect.StructType]:
    """The tables that may stand at a path."""
    words = [word for word in re.sub(r"\[.*?\]", "", path).split(".") if word]
    found = [*tables_in(inspect.type_info(SceneTable))]
    for word in words:
        fields = [field for table in found for field in table.fields if field.name == word]
        found = [table for field in fields for table in tables_in(field.type)]
    yield from found


def tables_in(kind: inspect.Type) -> Iterator[inspect.StructType]:
    """The tables that a value of a type may be, or hold in a list."""
    for each in _parts_of(kind):
        if isinstance(each, inspect.StructType):
            yield each


def _values_at(path: str) -> Iterator[str]:
    """The words that may stand at a path."""
    above, _, name = path.rpartition(".")
    for table in tables_at(above):
        if name == table.tag_field:
            yield str(table.tag)
        for field in table.fields:
            if field.name == re.sub(r"\[.*", "", name):
                for kind in _parts_of(field.type):
                    if isinstance(kind, inspect.LiteralType):
                        yield from map(str, kind.values)


def _parts_of(kind: inspect.Type) -> Iterator[inspect.Type]:
    """A type without its notes, or the types of a union or of a list's items."""
    if isinstance(kind, inspect.Metadata):
        yield from _parts_of(kind.type)
    elif isinstance(kind, inspect.UnionType):
        for each in kind.types:
            yield from _parts_of(each)
    elif isinstance(kind, inspect.ListType | inspect.VarTupleType):
        yield from _parts_of(kind.item_type)
    else:
        yield kind


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
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: {counted(explained(str(error)))}") from None
    except InputError as error:
        raise InputError(f"{path}: {counted(str(error))}") from None
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


def design_of(numbers: NumbersTable) -> Design:
    """The bodies for a [numbers] table; raises InputError where there are none."""
    size = {isinstance(row, tuple) for row in numbers.A}
    if len(numbers.A) != 3 or len(size) != 1:
        raise InputError("numbers.A takes a diagonal of three, or three rows of three")
    return design(np.array(numbers.A), numbers.Omega, numbers.K, numbers.radius, numbers.mass)
