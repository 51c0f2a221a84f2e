"""Controls on the command line change the scene."""

from pathlib import Path

import pytest

import robotball as rb
from tests.messages import naming
from tests.robotball.scene_files.scene_texts import PLATE
from tests.robotball.user_model.test_robot_file import trusted, written
from validation.results import controls_of

__all__ = ["trusted"]  # a fixture


@pytest.mark.usefixtures("trusted")
def test_controls_are_given_as_numbers_and_tables(tmp_path: Path) -> None:
    """Each control is given once; the scene ends with the table."""
    file = written(tmp_path, "fly.csv", "t,value\n0,0\n1,20\n5,30\n")
    controls = controls_of(["drive=.5", f"fly={file}"])
    assert controls == {"drive": 0.5, "fly": rb.Samples(times=(0, 1, 5), values=(0, 20, 30))}
    scene = rb.load_scene(written(tmp_path, "mybot.xml", PLATE), controls)
    assert (scene.duration, scene.controls[0].rate(0.0)) == (5.0, 0.5)
    for texts in (["drive"], ["=3"], ["drive="], ["drive=1", "drive=2"]):
        with pytest.raises(rb.InputError, match=naming("NAME=VALUE NAME=FILE")):
            controls_of(texts)
