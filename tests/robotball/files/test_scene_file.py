"""Scenes read from TOML: every scene of the catalog is what its file says."""

import re

import numpy as np

import robotball as rb
from robotball.files.scene_file import CATALOG
from tests.robotball.files.scene_texts import FIG12, Write, edited
from tests.scenes import FOUR


def test_catalog_has_the_papers_scenes_and_all_of_it_loads() -> None:
    """Every catalog scene loads by its name and by its path, to the same scene."""
    assert set(FOUR) < set(rb.catalog())
    for name in rb.catalog():
        by_name, by_path = rb.load_scene(name), rb.load_scene(CATALOG / f"{name}.toml")
        assert by_name.name == by_path.name == name
        assert by_name == by_path


def test_scene_has_what_its_file_says() -> None:
    """Title, rolling model, rates, duration and the default gravity are the file's."""
    scene = rb.load_scene("fig12")
    assert scene.title == "Drifting along a limit cycle, rubber (Fig. 12)"
    assert scene.rolling == "rubber"
    assert scene.frame_rate == 2.0
    assert scene.rotor_rates == (147.98400204185404,)
    assert (scene.duration, scene.gravity) == (10.0, 9.81)
    assert scene.times[0] == 0
    assert scene.times[-1] == 10.0


def test_axes_need_not_be_of_unit_length(write: Write) -> None:
    """A rotor's axis gives a direction; (2, 0, 0) is (1, 0, 0)."""
    axis = re.search(r"axis = \[.*\]", FIG12)
    assert axis
    scene = rb.load_scene(write(edited(axis[0], "axis = [0.0, -2.0, 0.0]")))
    np.testing.assert_array_equal(scene.ball.rotors[0].axis, [0.0, -1.0, 0.0])
