"""docs/scene.md: it is what the reader reads, and every example in it is a scene."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from robotball.files import scene_tables
from robotball.files.scene_keys import page
from tests.imports import PROJECT
from tests.robotball.files.scene_texts import FRAME, HEAD, SHELL, START, URDF, scene_of

PAGE = PROJECT / "docs" / "scene.md"
EXAMPLES = re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.S)


def test_the_page_is_what_is_generated() -> None:
    """`python -m robotball.files.scene_keys > docs/scene.md` changes nothing."""
    assert PAGE.read_text() == page()


def whole(example: str) -> str:
    """The example with what a scene needs besides."""
    has = tomllib.loads(example)
    head = [line for line in HEAD.splitlines() if line.split()[0] not in has]
    tables = {"shell": SHELL, "frame": FRAME, "start": START}
    left_out = ("shell", "frame") if "numbers" in has else ()
    rest = [text for key, text in tables.items() if key not in (*has, *left_out)]
    return "\n".join([*head, example, *rest])


@pytest.mark.parametrize("example", EXAMPLES, ids=range(len(EXAMPLES)))
def test_every_example_is_a_scene(tmp_path: Path, example: str) -> None:
    """With tables of others for what it does not tell, beside the files that it names."""
    (tmp_path / "robot.urdf").write_text(URDF)
    chassis = '<body name="chassis"><geom size=".05" mass="1"/></body>'
    (tmp_path / "robot.xml").write_text(f"<mujoco><worldbody>{chassis}</worldbody></mujoco>")
    (tmp_path / "wheel.csv").write_text("t,rate\ns,rad/s\n0,0\n4,60\n10,80\n")
    scene = scene_of(whole(example), tmp_path)
    assert np.all(np.isfinite(scene.angular_velocity_at(scene.start)))


def test_every_key_is_in_an_example() -> None:
    """Of whichever table."""
    tables = [each for each in vars(scene_tables).values() if hasattr(each, "__struct_fields__")]
    keys = {key for table in tables for key in table.__struct_fields__}
    shown = set(re.findall(r"\b(\w+)(?: = |\.|\])", "\n".join(EXAMPLES)))
    assert len(keys) > 50
    assert keys - shown == set()
