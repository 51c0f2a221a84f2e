"""Messages about the keys of scene files: errors, and questions about units.

Errors and questions are made with msgspec's inspection of the records in `scene_tables`, which
declare each key with its meaning and unit.
"""

import difflib
import math
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
from msgspec import inspect

from robotball.errors import UnitWarning, warn
from robotball.files import contents
from robotball.files.scene_tables import DENSITIES, SceneTable, numbers_in
from robotball.robot.drives import COMMAND
from robotball.robot.scene import Scene

# msgspec's names of types, and the terms of TOML for them.
_WORDS = {"float": "a number", "int": "a whole number", "str": "text", "bool": "true or false"}
_WORDS |= {"array": "a list", "object": "a table"}
# Keys of other formats, for which the nearest match by spelling would be a wrong key.
_MEANT = dict.fromkeys(("max_torque", "torque_max", "effort", "forcerange"), "torque_limit")
# Largest plausible number by key or unit. A ball that people ride in has a radius of 1.5 m; few
# motors turn at 19 000 rpm. `_limits_of` adds the limits that depend on the ball.
_LARGEST = {"m": 10.0, "rad": 2 * math.pi, "rad/s": 2e3, "m/s²": 100.0}
_LARGEST |= {"1": 1.0, "rotor_inertia": 0.1}
_OVERSIZED = 4.0  # times the ball's weight times its radius: a larger motor torque is implausible
_FASTEST = 20.0  # m/s, the largest plausible rolling speed
# Other units that the user may have meant if a number is too large, in units of the key.
_OTHERS = {
    "m": {"cm": 1e-2, "mm": 1e-3},
    "kg": {"g": 1e-3},
    "rad": {"°": math.pi / 180},
    "rad/s": {"rpm": math.pi / 30},
    "m/s²": {"mm/s²": 1e-3},
    "1": {"%": 1e-2},
    "N m": {"kg cm": 0.0980665, "mN m": 1e-3},
    "rotor_inertia": {"g cm²": 1e-7},
    "kg/m³": {"g/cm³": 1e3},
}
_LIGHTEST = 25.0  # kg/m³, a foam; the densest metal has 22.6 g/cm³
_MANY = ("rotor", "pendulum", "part")


def explained(message: str, keys: object) -> str:
    """Return msgspec's message with the key's path first, and with its value or near matches.

    keys: the decoded file.
    """
    # msgspec reports an error only as a text; a test covers each form of the text.
    where = re.search(r" - at `\$\.?(.*)`$", message)
    path, error = (where[1], message[: where.start()]) if where else ("", message)
    line = _worded(path, error, keys)
    return f"{path}: {line}" if path else line


def counted(message: str) -> str:
    """Return the message with bodies numbered from 1: rotor[0] becomes rotor1."""
    many = rf"\b({'|'.join(_MANY)})\[(\d+)\]"
    return re.sub(many, lambda match: f"{match[1]}{int(match[2]) + 1}", message)


def _worded(path: str, error: str, keys: object) -> str:
    if unknown := re.search(r"unknown field `(.*)`", error, re.S):
        name, tables = unknown[1], tables_at(path)
        if tags := [str(t.tag) for t in tables if any(name == field.name for field in t.fields)]:
            return f"key {name!r} belongs only to the kinds {', '.join(tags)}"
        known = [field.name for table in tables for field in table.fields]
        meant = _MEANT.get(name)
        near = [meant] if meant in known else difflib.get_close_matches(name, known, n=1)
        return f"unknown key {name!r}" + (f"; did you mean {near[0]!r}?" if near else "")
    if missing := re.search(r"missing required field `(.*)`", error):
        kinds = _listed(f"{path}.kind") if missing[1] == "kind" else ""
        return f"key {missing[1]!r} is missing{kinds}"
    if needed := re.search(r"needs the key '(\w+)'$", error):
        return f"{error} [{unit_at(f'{path}.{needed[1]}')}]"
    if invalid := re.match(r"Invalid (?:enum )?value (.*)$", error):
        return f"unknown value {invalid[1]}{_listed(path)}"
    if bound := re.match(r"Expected `float` (>=?) 0.0$", error):
        least = "positive" if bound[1] == ">" else "0 or more"
        return f"the value must be {least}, not {_value_at(keys, path):g} {unit_at(path)}"
    if expected := re.match(r"Expected (.*), got `?(\w+)`?$", error):
        # Users often write [rotor] in place of [[rotor]], which gives a table instead of a list.
        if path.split(".")[-1] in _MANY and expected[2] == "object":
            return f"a scene may have many of these: write [[{path}]] for each"
        # An optional key is a union with null, which TOML does not have.
        types, actual = expected[1].replace(" | null", ""), expected[2]
        types = re.sub(r"`array` of length (\d+)", r"a list of \1", types).replace(" | ", " or ")
        types = re.sub(r"\w+", lambda name: _WORDS.get(name[0], name[0]), types).replace("`", "")
        return f"the value must be {types}, not {_WORDS.get(actual, actual)}"
    return error


def _value_at(keys: Any, path: str) -> float:
    for name, number in re.findall(r"(\w+)|\[(\d+)\]", re.sub(r"\[\.\.\.\]", "", path)):
        keys = keys[name] if name and not number else keys[int(number)]
    return float(keys)


def _listed(path: str) -> str:
    known = ", ".join(dict.fromkeys(_values_at(path)))
    return f"; known values are {known}" if known else ""


def tables_at(path: str) -> list[inspect.StructType]:
    """Return the tables that may stand at a path; parts and commands are of several kinds."""
    tables = [struct_of(SceneTable)]
    for name in re.findall(r"\w+", re.sub(r"\[.*?\]", "", path)):
        fields = [field for table in tables for field in table.fields if field.name == name]
        tables = [table for field in fields for table in _tables_in(field.type)]
    return tables


def _tables_in(kind: inspect.Type) -> list[inspect.StructType]:
    """Return the tables of a type, a union or a list."""
    return [part for part in _parts_of(kind) if isinstance(part, inspect.StructType)]


def _values_at(path: str) -> Iterator[str]:
    """Yield the allowed strings at a path."""
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
    """Yield a type without its annotations, or the types in a union or of a list's items."""
    if isinstance(kind, inspect.Metadata):
        yield from _parts_of(kind.type)
    elif isinstance(kind, inspect.UnionType):
        for member in kind.types:
            yield from _parts_of(member)
    elif isinstance(kind, inspect.ListType | inspect.VarTupleType):
        yield from _parts_of(kind.item_type)
    else:
        yield kind


def unit_at(path: str) -> str:
    """Return the unit of the key at a path. The numbers in a command have the command's unit."""
    above, _, name = re.sub(r"\[.*?\]", "", path).rpartition(".")
    fields = (field for table in tables_at(above) for field in table.fields)
    unit = next((meaning_of(field)[1] for field in fields if field.name == name), "")
    return unit_at(above) if unit == COMMAND else unit


@cache
def struct_of(table: type[msgspec.Struct]) -> inspect.StructType:
    (struct,) = _tables_in(inspect.type_info(table))
    return struct


def meaning_of(field: inspect.Field) -> tuple[str, str]:
    """Return the meaning and the unit of a field, from `drives.key`."""
    annotation = field.type
    assert isinstance(annotation, inspect.Metadata)
    return (annotation.extra_json_schema or {})["description"], (annotation.extra or {})["unit"]


def ask(path: Path, scene: Scene) -> None:
    """Issue a UnitWarning if a number in the file of a scene seems to be in another unit.

    For a model file, the numbers are taken from the scene.
    """
    keys = msgspec.toml.decode(contents(path)) if path.suffix == ".toml" else {}
    limits = _limits_of(scene)
    if "start" in keys:
        questions = [*_questions_of_file(msgspec.convert(keys, SceneTable), limits)]
    else:
        numbers = _numbers_of(scene)
        questions = [q for number in numbers for q in _question(*number, limits.get(number[1]))]
    more = ", ".join(question.partition(" is ")[0] for question in questions[1:])
    for question in questions[:1]:
        question += f" Other such numbers: {more}" * bool(more)
        warn(f"{path}: {counted(question)}", UnitWarning)


def _limits_of(scene: Scene) -> dict[str, float]:
    """Return the largest plausible numbers, by key or unit, for this size and weight."""
    a, ball = scene.ball.radius, scene.ball
    solid_steel = min(1e3, DENSITIES["steel"] * 4 / 3 * math.pi * a**3)
    torque = _OVERSIZED * ball.mass * scene.gravity * a
    turning = dict.fromkeys(("frame rad/s", "start rad/s"), _FASTEST / a)
    return {**_LARGEST, **turning, "kg": solid_steel, "N m": torque, "rolling": a}


def _numbers_of(scene: Scene) -> Iterator[tuple[str, str, float]]:
    """Yield name, unit and value of the numbers in a model file."""
    yield "the shell's radius", "m", scene.ball.radius
    yield "gravity", "m/s²", scene.gravity
    slides = {link.name: link.slides for link in scene.ball.tree}
    for link in scene.ball.tree:
        yield f"the mass of {link.name}", "kg", link.mass
    for hinge in scene.hinges:
        yield f"the start of {hinge.name}", "m" if slides[hinge.name] else "rad", hinge.angle
    for actuator in scene.actuators:
        (name, gear), law, command = actuator.gears[0], actuator.law, actuator.command
        angle = bool(law.per_angle)
        if isinstance(command, float) and not slides[name] and (angle or not law.per_rate):
            value = command if angle else gear * float(law.torque(command, 0.0, 0.0))
            yield f"the command of {actuator.name}", "rad" if angle else "N m", value


def _questions_of_file(table: SceneTable, limits: dict[str, float]) -> Iterator[str]:
    """Yield a question for each number of a scene file that is implausible in its unit."""
    numbers = dict(numbers_in(msgspec.to_builtins(table)))
    for path, value in numbers.items():
        above, _, key = path.rpartition(".")
        body, unit = path.partition(".")[0], unit_at(path)
        # A motor's numbers are converted to those after the gear, and then compared.
        gear = numbers.get(f"{above}.gear") or 1.0
        factor = {"stall_torque": gear, "no_load_speed": 1 / gear}.get(key, 1.0)
        largest = next((limits[i] for i in (key, f"{body} {unit}", unit) if i in limits), None)
        yield from _question(path, key if key in _OTHERS else unit, value, largest, factor, unit)


def _question(
    name: str, kind: str, value: float, largest: float | None, factor: float = 1.0, unit: str = ""
) -> Iterator[str]:
    """Yield a question if a number is implausible; kind: a key or unit of `_OTHERS`."""
    light = kind == "kg/m³" and 0 < value < _LIGHTEST
    if light or (largest is not None and abs(value) * factor > largest):
        others, limit = _OTHERS[kind].items(), largest or math.inf
        # Without the factor: a number of a motor may stand for the motor with its gear.
        fits = [other for other in others if abs(value) * other[1] <= limit] or others
        meant = " or ".join(f"{value * ratio:.4g} ({value:g} {other})" for other, ratio in fits)
        shown = f"{value:g} {unit or kind}".removesuffix(" 1")
        yield f"{name} is {shown}; did you mean {meant}?"
