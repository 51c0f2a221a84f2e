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
    "prescribed": "keeps the rate exactly, with any torque",
    "servo": "kv (rate - actual rate)",
    "position": "kp (angle - actual angle) - kd · actual rate",
    "dc_motor": "efficiency · gear · stall_torque (supply - gear · rate/no_load_speed)",
    "torque": "the command, independent of the motion",
    "free": "no motor: -damping · rate - stiffness (angle - rest), and dry friction",
}


def page() -> str:
    """Return docs/scene.md: the text, with each line `{names}` replaced by a table of keys."""
    prose = Path(__file__).with_name("scene_page.md").read_text()
    return re.sub(r"(?m)^\{([\w. ]+)\}$", lambda match: "\n".join(_rows(match[1])), prose)


def _rows(names: str) -> Iterator[str]:
    """Yield one table of the keys at these paths in a scene file, or of these kinds of parts."""
    if names == "materials":
        cells = [f"| `{material}` | {density:g} " for material, density in DENSITIES.items()]
        rows = len(cells) // 3
        yield from ("| `material` | density [kg/m³] " * 3 + "|", "|---|---" * 3 + "|")
        for triple in zip(cells[:rows], cells[rows:-rows], cells[-rows:], strict=True):
            yield "".join(triple) + "|"
        return
    if names == "drives":
        yield "| `drive` | torque, up to `torque_limit` | required keys | optional keys |"
        yield "|---|---|---|---|"
        for drive, kind in DRIVES.items():
            optional = tuple(key for key in kind.allowed if key not in kind.needed)
            yield f"| `{drive}` | {_DRIVES[drive]} | {_codes(kind.needed)} | {_codes(optional)} |"
        return
    owners = dict[tuple[str, ...], list[str]]()
    for name in names.split():
        table = _documented(name)
        # The keys of a hinge have a table of their own.
        is_body = issubclass(table.cls, HingeTable) and name != "hinge"
        for field in table.fields:
            if not (is_body and field.name in HingeTable.__struct_fields__):
                row = f"`{field.name}`", *meaning_of(field), _default(field)
                owners.setdefault(row, []).append(f"`{name.rpartition('.')[2]}`")
    several = " of |" if " " in names else ""
    yield from (
        f"| key |{several} meaning | unit | default |",
        "|---" * (5 if several else 4) + "|",
    )
    order = [key for key, *_ in owners]  # rows with the same key stand together
    for key, *cells in sorted(owners, key=lambda row: order.index(row[0])):
        of = owners[key, *cells]
        first = [key, "all" if len(of) == names.count(" ") + 1 else ", ".join(of)]
        yield f"| {' | '.join([*first[: 1 + bool(several)], *cells])} |"


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
