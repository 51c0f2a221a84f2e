"""Write docs/scene.md and docs/scene.schema.json: `python -m bench.scene_page`, or `make docs`.

The text of the page is in scene_page.md; its tables come from the records of `scene_tables`.
"""

import json
import re
from collections.abc import Iterator
from pathlib import Path

from msgspec import inspect

from robotball.files.scene_tables import DENSITIES, DRIVES, HingeTable
from robotball.scene_files.scene_file import scene_schema
from robotball.scene_files.scene_keys import meaning_of, struct_of, tables_at
from robotball.user_model.robot_scene import RobotTable

_DRIVES = {
    "prescribed": "The hinge keeps the rate exactly, with any torque that this takes.",
    "servo": "Torque = kv (rate - the hinge's rate), clipped to the limit.",
    "position": "Torque = kp (angle - the hinge's angle) - kd · the hinge's rate, clipped to the "
    "limit.",
    "dc_motor": "Torque = efficiency · gear · stall_torque (supply - gear · rate/no_load_speed), "
    "clipped to the limit.",
    "torque": "The motor applies the torque, independent of the hinge's motion.",
    "free": "No motor: torque = -damping · rate - stiffness (angle - rest), minus friction.",
}


def page() -> str:
    """Return docs/scene.md: the text, with each line `{name}` replaced by a table of keys."""
    prose = Path(__file__).with_name("scene_page.md").read_text()
    return re.sub(r"(?m)^\{([\w.]+)\}$", lambda match: "\n".join(_rows(match[1])), prose)


def _rows(name: str) -> Iterator[str]:
    """Yield the table of a path in a scene file, or of a kind of part or command."""
    if name == "materials":
        yield from ("| `material` | density [kg/m³] |", "|---|---|")
        yield from (f"| `{material}` | {density:g} |" for material, density in DENSITIES.items())
        return
    if name == "drives":
        yield from ("| `drive` | behaviour | required keys | optional keys |", "|---|---|---|---|")
        for drive, kind in DRIVES.items():
            optional = tuple(key for key in kind.allowed if key not in kind.needed)
            yield f"| `{drive}` | {_DRIVES[drive]} | {_codes(kind.needed)} | {_codes(optional)} |"
        return
    yield from ("| key | meaning | unit | default |", "|---|---|---|---|")
    # A hinge's keys have their own table, so other bodies' tables leave them out.
    left_out = set() if name == "hinge" else set(HingeTable.__struct_fields__)
    for field in _documented(name).fields:
        if field.name not in left_out:
            meaning, unit = meaning_of(field)
            yield f"| `{field.name}` | {meaning} | {unit} | {_default(field)} |"


def _documented(name: str) -> inspect.StructType:
    if name == "hinge":
        return struct_of(HingeTable)
    if name == "robot":
        return struct_of(RobotTable)
    # Parts and commands are alike in all bodies; take the frame.
    kinds = [table for path in ("frame.part", "frame.rate") for table in tables_at(path)]
    at_path = tables_at("" if name == "scene" else name)
    return [*(table for table in kinds if table.tag == name), *at_path][0]


def _default(field: inspect.Field) -> str:
    match field.default:
        case _ if field.required:
            return "required"
        case bool(value):
            return f"`{str(value).lower()}`"
        case float(value):
            return f"`{value:g}`"
        case str(value) if value:
            return f"`{value}`"
        case (_, *_) as values:
            return f"`[{', '.join(f'{value:g}' for value in values)}]`"
        case _:
            return ""


def _codes(keys: tuple[str, ...]) -> str:
    return ", ".join(f"`{key}`" for key in keys)


def schema() -> str:
    """Return docs/scene.schema.json."""
    return json.dumps(scene_schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    docs = Path(__file__).parent.parent / "docs"
    (docs / "scene.md").write_text(page())
    (docs / "scene.schema.json").write_text(schema())
