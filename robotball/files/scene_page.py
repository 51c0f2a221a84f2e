"""docs/scene.md: its prose is scene_page.md, its tables of keys are those that the reader uses.

`python -m robotball.files.scene_page > docs/scene.md` writes it.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct, inspect

from robotball.drives import Ramp, Sine
from robotball.files.parts import Box, Cylinder, Disc, Point, Ring, Rod, Sphere
from robotball.files.scene_tables import (
    ALLOWED,
    NEEDED,
    Axial,
    FrameTable,
    FrictionTable,
    HingeTable,
    MjcfTable,
    NumbersTable,
    PendulumTable,
    RotorTable,
    SamplesTable,
    SceneTable,
    SectionTable,
    ShellInertia,
    ShellTable,
    StartTable,
    UrdfTable,
)

PROSE = Path(__file__).with_suffix(".md")
# What `{name}` on a line of the prose stands for.
TABLES: dict[str, type[Struct]] = {
    "scene": SceneTable,
    "shell": ShellTable,
    "shell.inertia": ShellInertia,
    "frame": FrameTable,
    "rotor": RotorTable,
    "rotor.inertia": Axial,
    "pendulum": PendulumTable,
    "box": Box,
    "cylinder": Cylinder,
    "sphere": Sphere,
    "disc": Disc,
    "ring": Ring,
    "rod": Rod,
    "point": Point,
    "mjcf": MjcfTable,
    "urdf": UrdfTable,
    "hinge": HingeTable,
    "ramp": Ramp,
    "sine": Sine,
    "samples": SamplesTable,
    "friction": FrictionTable,
    "start": StartTable,
    "section": SectionTable,
    "numbers": NumbersTable,
}
TOLD = {
    "prescribed": "The hinge keeps the rate exactly, whatever torque that takes.",
    "servo": "Torque = kv (rate - the hinge's rate), at most the limit either way.",
    "position": "Torque = kp (angle - the hinge's angle) - kd · the hinge's rate, likewise.",
    "torque": "The motor gives the torque, whatever the hinge does.",
    "free": "No motor: torque = -damping · rate - stiffness (angle - rest).",
}


def page() -> str:
    """The whole page."""
    return re.sub(r"(?m)^\{([\w.]+)\}$", lambda found: _table(found[1]), PROSE.read_text())


def _table(name: str) -> str:
    return "\n".join(_drives() if name == "drives" else _keys(TABLES[name]))


def _drives() -> Iterator[str]:
    yield from ("| `drive` | what it does | it needs | it may have |", "|---|---|---|---|")
    for drive, needed in NEEDED.items():
        yield f"| `{drive}` | {TOLD[drive]} | {_codes(needed)} | {_codes(ALLOWED[drive])} |"


def _keys(table: type[Struct]) -> Iterator[str]:
    """A row for each key of a table, those of hinges in their own table alone."""
    info = inspect.type_info(table)
    assert isinstance(info, inspect.StructType)
    inherited = set() if table is HingeTable else set(HingeTable.__struct_fields__)
    yield from ("| key | what it says | unit | if not given |", "|---|---|---|---|")
    for field in info.fields:
        if field.name not in inherited:
            meant = field.type
            assert isinstance(meant, inspect.Metadata)
            text = (meant.extra_json_schema or {})["description"]
            unit = (meant.extra or {})["unit"]
            yield f"| `{field.name}` | {text} | {unit} | {_default(field)} |"


def _default(field: inspect.Field) -> str:
    match field.default:
        case _ if field.required:
            return "needed"
        case bool(value):
            return f"`{str(value).lower()}`"
        case float(value):
            return f"`{value:g}`"
        case str(value) if value:
            return f"`{value}`"
        case (_, *_) as values:
            return f"`[{', '.join(f'{each:g}' for each in values)}]`"
        case _:
            return ""


def _codes(keys: tuple[str, ...]) -> str:
    return ", ".join(f"`{each}`" for each in keys)


if __name__ == "__main__":
    sys.stdout.write(page())
