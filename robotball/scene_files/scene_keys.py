"""The keys of scene files in words: what is wrong with one, and units asked back.

Both are made by walking the records of `scene_tables` with msgspec's inspection, so that a key is
described where it is declared and nowhere else.
"""

import difflib
import math
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import msgspec
from msgspec import inspect

from robotball.errors import UnitWarning, warn
from robotball.files import contents
from robotball.files.scene_tables import SceneTable, numbers_in
from robotball.robot.drives import COMMAND
from robotball.robot.scene import Scene

_WORDS = {  # msgspec's names of types, in the words of TOML's users
    "float": "a number",
    "int": "a whole number",
    "str": "text",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
}
# Other formats' words for a key. By their letters alone another key would be the nearest.
_MEANT = dict.fromkeys(("max_torque", "torque_max", "effort", "forcerange"), "torque_limit")
# By key or unit: the largest number that a robot has there. Balls that people ride in have 1.5 m;
# few motors turn at 19 000 rpm. `_limits_of` adds what depends on the ball.
_LARGEST = {
    "m": 10.0,
    "rad": 2 * math.pi,
    "rad/s": 2e3,
    "m/s²": 100.0,
    "1": 1.0,
    "rotor_inertia": 0.1,
}
_STEEL = 7850.0  # kg/m³: a ball of solid steel is heavier than any robot in a shell of its size
_OVERSIZED = 4.0  # times the ball's weight at its radius: the torque of a motor far too strong
_FASTEST = 20.0  # m/s, at which a ball rolls
# Other units that a number beyond may be in, and what they are in the key's.
_OTHERS = {
    "m": {"mm": 1e-3},
    "kg": {"g": 1e-3},
    "rad": {"°": math.pi / 180},
    "rad/s": {"rpm": math.pi / 30},
    "m/s²": {"mm/s²": 1e-3},
    "1": {"%": 1e-2},
    "N m": {"kg cm": 0.0980665, "mN m": 1e-3},
    "rotor_inertia": {"g cm²": 1e-7},
    "kg/m³": {"g/cm³": 1e3},
}
_LIGHTEST = 25.0  # kg/m³, of a foam; the densest metal has 22.6 g/cm³
_MANY = ("rotor", "pendulum", "part")


def explained(message: str) -> str:
    """Return msgspec's message with the key's path first, and near matches or the known values."""
    # Its messages are its only report of what and where; a test holds each form that is read here.
    where = re.search(r" - at `\$\.?(.*)`$", message)
    key, what = (where[1], message[: where.start()]) if where else ("", message)
    line = _worded(key, what)
    return f"{key}: {line}" if key else line


def counted(message: str) -> str:
    """Return the message with bodies numbered from 1, as everywhere else: rotor[0] is rotor1."""
    many = rf"\b({'|'.join(_MANY)})\[(\d+)\]"
    return re.sub(many, lambda found: f"{found[1]}{int(found[2]) + 1}", message)


def _worded(key: str, what: str) -> str:
    if unknown := re.search(r"unknown field `(.*)`", what, re.S):
        word, tables = unknown[1], tables_at(key)
        if tags := [str(t.tag) for t in tables if any(word == each.name for each in t.fields)]:
            return f"key {word!r} is of the kinds {', '.join(tags)} alone"
        known = [each.name for table in tables for each in table.fields]
        meant = _MEANT.get(word)
        near = [meant] if meant in known else difflib.get_close_matches(word, known, n=1)
        return f"unknown key {word!r}" + (f"; did you mean {near[0]!r}?" if near else "")
    if missing := re.search(r"missing required field `(.*)`", what):
        kinds = _listed(f"{key}.kind") if missing[1] == "kind" else ""
        return f"key {missing[1]!r} is missing{kinds}"
    if invalid := re.match(r"Invalid (?:enum )?value (.*)$", what):
        return f"unknown value {invalid[1]}{_listed(key)}"
    if expected := re.match(r"Expected (.*), got `?(\w+)`?$", what):
        # [rotor] for [[rotor]] is easily written, and is a table where a list is expected.
        if key.split(".")[-1] in _MANY and expected[2] == "object":
            return f"a scene may have many; write [[{key}]] for each"
        # A key that may be left out is a union with null, which TOML has not.
        types, given = expected[1].replace(" | null", ""), expected[2]
        types = re.sub(r"`array` of length (\d+)", r"a list of \1", types).replace(" | ", " or ")
        types = re.sub(r"\w+", lambda word: _WORDS.get(word[0], word[0]), types).replace("`", "")
        return f"it must be {types}, not {_WORDS.get(given, given)}"
    return what


def _listed(path: str) -> str:
    known = ", ".join(dict.fromkeys(_values_at(path)))
    return f"; it takes {known}" if known else ""


def tables_at(path: str) -> list[inspect.StructType]:
    """Return the tables that may stand at a path."""
    words = [word for word in re.sub(r"\[.*?\]", "", path).split(".") if word]
    # All tables that may stand there: parts and commands are of several kinds.
    found = [struct_of(SceneTable)]
    for word in words:
        fields = [field for table in found for field in table.fields if field.name == word]
        found = [table for field in fields for table in _tables_in(field.type)]
    return found


def _tables_in(kind: inspect.Type) -> list[inspect.StructType]:
    """Return the tables that a value of a type may be, or hold in a list."""
    return [each for each in _parts_of(kind) if isinstance(each, inspect.StructType)]


def _values_at(path: str) -> Iterator[str]:
    """Yield the words that may stand at a path."""
    above, _, name = path.rpartition(".")
    for table in tables_at(above):
        if name == table.tag_field:
            yield str(table.tag)
        of_name = (each for each in table.fields if each.name == re.sub(r"\[.*", "", name))
        for kind in (kind for field in of_name for kind in _parts_of(field.type)):
            if isinstance(kind, inspect.LiteralType):
                yield from map(str, kind.values)


def _parts_of(kind: inspect.Type) -> Iterator[inspect.Type]:
    """Yield a type without its annotations, or the types of a union or of a list's items."""
    if isinstance(kind, inspect.Metadata):
        yield from _parts_of(kind.type)
    elif isinstance(kind, inspect.UnionType):
        for each in kind.types:
            yield from _parts_of(each)
    elif isinstance(kind, inspect.ListType | inspect.VarTupleType):
        yield from _parts_of(kind.item_type)
    else:
        yield kind


def unit_at(path: str) -> str:
    """Return the unit of the key at a path, of a command's numbers that of the command."""
    above, _, name = re.sub(r"\[.*?\]", "", path).rpartition(".")
    fields = (field for table in tables_at(above) for field in table.fields)
    unit = next((meaning_of(field)[1] for field in fields if field.name == name), "")
    return unit_at(above) if unit == COMMAND else unit


@cache
def struct_of(table: type[msgspec.Struct]) -> inspect.StructType:
    (struct,) = _tables_in(inspect.type_info(table))
    return struct


def meaning_of(field: inspect.Field) -> tuple[str, str]:
    """Return what `drives.key` says of a field: its meaning and its unit."""
    meant = field.type
    assert isinstance(meant, inspect.Metadata)
    return (meant.extra_json_schema or {})["description"], (meant.extra or {})["unit"]


def ask(path: Path, scene: Scene) -> None:
    """Issue a UnitWarning where numbers of a scene's file seem to be in another unit.

    Of a robot's own file they are those of the scene that was made of it.
    """
    given = msgspec.toml.decode(contents(path)) if path.suffix == ".toml" else {}
    limits = _limits_of(scene)
    if "start" in given:
        found = [*_doubts(msgspec.convert(given, SceneTable), limits)]
    else:
        numbers = _numbers_of(scene)
        found = [line for each in numbers for line in _question(*each, limits.get(each[1]))]
    more = f" More such numbers: {len(found) - 1}" if found[1:] else ""
    for line in found[:1]:
        warn(f"{path}: {counted(line)}{more}", UnitWarning)


def _limits_of(scene: Scene) -> dict[str, float]:
    """Return the largest likely numbers by key or unit, of a ball of this size and weight."""
    a, ball = scene.ball.radius, scene.ball
    steel = min(1e3, _STEEL * 4 / 3 * math.pi * a**3)
    torque = _OVERSIZED * ball.mass * scene.gravity * a
    turning = dict.fromkeys(("frame rad/s", "start rad/s"), _FASTEST / a)
    return {**_LARGEST, **turning, "kg": steel, "N m": torque, "rolling": a}


def _numbers_of(scene: Scene) -> Iterator[tuple[str, str, float]]:
    """Yield what a robot's own file gives, with its unit."""
    yield "the shell's radius", "m", scene.ball.radius
    yield "gravity", "m/s²", scene.gravity
    slides = {link.name: link.slides for link in scene.ball.tree}
    for link in scene.ball.tree:
        yield f"the mass of {link.name}", "kg", link.mass
    for hinge in scene.hinges:
        yield f"the start of {hinge.name}", "m" if slides[hinge.name] else "rad", hinge.angle
    for each in scene.actuators:
        (name, gear), law, command = each.gears[0], each.law, each.command
        angle = bool(law.per_angle)
        if isinstance(command, float) and not slides[name] and (angle or not law.per_rate):
            value = command if angle else gear * float(law.torque(command, 0.0, 0.0))
            yield f"the command of {each.name}", "rad" if angle else "N m", value


def _doubts(table: SceneTable, limits: dict[str, float]) -> Iterator[str]:
    """Yield a question for each number of a scene file that is unlikely in its unit."""
    numbers = dict(numbers_in(msgspec.to_builtins(table)))
    for path, value in numbers.items():
        above, _, key = path.rpartition(".")
        body, unit = path.partition(".")[0], unit_at(path)
        # What the hinge has of a motor's number, behind the gear.
        gear = numbers.get(f"{above}.gear") or 1.0
        times = {"stall_torque": gear, "no_load_speed": 1 / gear}.get(key, 1.0)
        most = next((limits[i] for i in (key, f"{body} {unit}", unit) if i in limits), None)
        yield from _question(path, key if key in _OTHERS else unit, value, most, times, unit)


def _question(
    what: str, kind: str, value: float, most: float | None, times: float = 1.0, unit: str = ""
) -> Iterator[str]:
    """Yield a question where a number is unlikely; kind: a key or a unit of `_OTHERS`."""
    light = kind == "kg/m³" and 0 < value < _LIGHTEST
    if light or (most is not None and abs(value) * times > most):
        others = _OTHERS[kind].items()
        fits = [each for each in others if abs(value) * times * each[1] <= (most or math.inf)]
        other, factor = (fits or [*others])[0]
        shown = f"{value:g} {unit or kind}".removesuffix(" 1")
        yield f"{what} is {shown}; did you mean {value * factor:.4g} ({value:g} {other})?"
