"""A model in files moves as it should without robotball, or says what it needs to."""

import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from dm_control import mjcf

import robotball as rb
from robotball.engines.mujoco.mjcf_export import Written, write_model
from tests.robots import ENDINGS, worked
from tests.scenes import FOUR

BALANCED = rb.preset("balanced")


def files_of(scene: rb.Scene, settings: rb.Settings = BALANCED) -> Written:
    return write_model(scene, settings, dressed=True, stem="ball")


def played(files: Written, folder: Path) -> tuple[float, list[float]]:
    """The time and qpos that the player prints, by a Python that finds no robotball."""
    (folder / "ball.xml").write_text(files.xml)
    (folder / "ball-play.py").write_text(files.player)
    (folder / "ball-controls.csv").write_text(files.controls)
    assert "robotball" not in files.player
    code = (
        "import runpy, sys; sys.modules['robotball'] = None; "
        "runpy.run_path('ball-play.py', run_name='__main__')"
    )
    said = subprocess.check_output([sys.executable, "-c", code], cwd=folder, text=True)
    found = re.fullmatch(r"t = (\S+) s, qpos = \[(.*)\]\n", said)
    assert found is not None
    return float(found[1]), [float(number) for number in found[2].split(",")]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wobbling_drive", "spin_up_from_rest"])
def test_plain_steps_with_the_controls_beside_it_end_where_the_equations_do(
    name: str, tmp_path: Path
) -> None:
    """To 1e-6 of the path; measured 2.7e-7 and 4e-9, of second order in the step."""
    scene = rb.load_scene(name)
    t, qpos = played(files_of(scene), tmp_path)
    theory = rb.integrate(scene)
    assert t == pytest.approx(scene.duration, rel=1e-12)
    off = np.linalg.norm(qpos[:2] - theory.contact_point[-1]) / theory.path_scale
    assert off < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", ["W2", "W4", "W5"])
def test_a_player_moves_robots_whose_contact_is_harder_than_mjcf_can_say(
    name: str, tmp_path: Path
) -> None:
    """Pendulums with motors, ends known to twelve digits; measured 8e-7 to 2e-6 m."""
    t, qpos = played(files_of(worked(name)), tmp_path)
    assert t == pytest.approx(10.0, rel=1e-12)
    assert np.abs(np.array(qpos[:2]) - ENDINGS[name].contact_point).max() < 4e-6


@pytest.mark.slow
def test_without_the_player_it_rolls_elsewhere() -> None:
    """With the keyframe's controls alone the path is off by more than a tenth; measured 0.33."""
    scene = rb.load_scene("wobbling_drive")
    compiled = mujoco.MjModel.from_xml_string(files_of(scene).xml)
    data = mujoco.MjData(compiled)
    mujoco.mj_resetDataKeyframe(compiled, data, 0)
    while data.time < scene.duration - 1e-9:
        mujoco.mj_step(compiled, data)
    theory = rb.integrate(scene)
    off = np.linalg.norm(data.qpos[:2] - theory.contact_point[-1]) / theory.path_scale
    assert off > 0.1


def test_settings_that_never_get_good_keep_their_own_step() -> None:
    """The naive preset shows what a newcomer writes, with its step."""
    files = files_of(rb.load_scene("wobbling_drive").until(0.1), rb.preset("naive"))
    timestep = mujoco.MjModel.from_xml_string(files.xml).opt.timestep
    assert timestep == mujoco.MjModel.from_xml_string("<mujoco/>").opt.timestep


@pytest.mark.parametrize("name", FOUR)
def test_a_steady_scene_s_file_needs_no_player(name: str) -> None:
    """Any way of stepping it is right; what a user must know stands in its first lines."""
    files = files_of(rb.load_scene(name))
    assert (files.needs, files.player, files.controls) == (None, "", "")
    comment = files.xml.partition("-->")[0]
    for words in ('the keyframe "start"', "Armature: so huge that", "Integrator: RK4", "MJX"):
        assert words in comment
    assert mjcf.from_xml_string(files.xml).find("camera", "track") is not None


def test_a_file_that_needs_its_player_says_so_in_itself() -> None:
    """In its comment, and in the line for the user."""
    files = files_of(rb.load_scene("wobbling_drive").until(0.1))
    assert files.needs is not None
    assert "it needs ball-play.py to move as it should" in files.needs
    assert "ball-play.py" in files.xml.partition("-->")[0]
