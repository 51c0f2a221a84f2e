"""docs/scene.md: it is what the reader reads, and every example in it is a scene."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import inspect

import robotball as rb
from robotball.files.scene_keys import page, tables_at, tables_in
from robotball.files.scene_tables import SceneTable
from tests.imports import PROJECT
from tests.robotball.files.scene_texts import URDF

PAGE = PROJECT / "docs" / "scene.md"
EXAMPLES = re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.S)

# What an example leaves out, by the key that it would have.
REST = {
    "shell": "[shell]\nradius = 0.15\nmass = 1.0\nthickness = 0.003\naxis = [0, 1, 0]\n",
    "frame": "[frame]\nmass = 1.0\ninertia = [0.004, 0.003, 0.005]\n",
    "start": "[start]\nattitude = [1, 0, 0, 0]\nangular_velocity = [0, 0, 0]\n",
}
HEAD = {"title": '"whole"', "rolling": '"classical"', "duration": "10.0"}


def whole(example: str) -> str:
    """The example with what a scene needs besides."""
    has = tomllib.loads(example)
    head = [f"{key} = {value}" for key, value in HEAD.items() if key not in has]
    bodies = [] if "numbers" in has else ["shell", "frame"]
    rest = [REST[key] for key in (*bodies, "start") if key not in has]
    return "\n".join([*head, example, *rest])


def test_the_page_is_what_is_generated() -> None:
    """`python -m robotball.files.scene_keys > docs/scene.md` changes nothing."""
    assert PAGE.read_text() == page()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """One with the files that examples name."""
    (tmp_path / "robot.urdf").write_text(URDF)
    chassis = '<body name="chassis"><geom size=".05" mass="1"/></body>'
    (tmp_path / "robot.xml").write_text(f"<mujoco><worldbody>{chassis}</worldbody></mujoco>")
    (tmp_path / "wheel.csv").write_text("t,rate\ns,rad/s\n0,0\n4,60\n10,80\n")
    return tmp_path


@pytest.mark.parametrize("example", EXAMPLES, ids=range(len(EXAMPLES)))
def test_every_example_is_a_scene(folder: Path, example: str) -> None:
    """With tables of others for what it does not tell; it starts with numbers."""
    path = folder / "example.toml"
    path.write_text(whole(example))
    scene = rb.load_scene(path)
    assert np.all(np.isfinite(scene.angular_velocity_at(scene.start)))


def keys_in(value: Any, path: str = "") -> Iterator[tuple[str, str, str]]:
    """(path of the table, its kind, key) of each key in a decoded example."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield path, str(value.get("kind", "")), key
            yield from keys_in(inner, f"{path}.{key}" if path else key)
    if isinstance(value, list):
        for inner in value:
            yield from keys_in(inner, path)


def tables(found: list[inspect.StructType]) -> list[inspect.StructType]:
    """These tables and all that can stand in them."""
    below = [each for table in found for f in table.fields for each in tables_in(f.type)]
    new = [each for each in below if each.cls not in {table.cls for table in found}]
    unique = list({each.cls: each for each in new}.values())
    return tables(found + unique) if unique else found


def test_every_key_is_in_an_example() -> None:
    """Of each table, part and kind of command; a hinge's keys on any body."""
    shown = set()
    for example in EXAMPLES:
        for path, kind, key in keys_in(tomllib.loads(example)):
            for table in tables_at(path):
                if not table.tag or table.tag == kind:
                    shown.add((table.cls.__name__, key))
    hinge = {key for name, key in shown if name in ("FrameTable", "RotorTable", "PendulumTable")}
    (scene,) = tables_in(inspect.type_info(SceneTable))
    missing = {
        (table.cls.__name__, field.name)
        for table in tables([scene])
        for field in table.fields
        if (table.cls.__name__, field.name) not in shown and field.name not in hinge
    }
    assert missing == set()
