"""A model in files moves as it should without robotball, or says what it needs to."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.mjcf_export import Written, write_model
from robotball.robot.scene import Friction
from tests.messages import unnamed
from tests.random_robots import random_tree
from tests.robots import worked

BALANCED = rb.preset("balanced")
WOBBLING = rb.load_scene("wobbling_drive")


def files_of(scene: rb.Scene, settings: rb.Settings = BALANCED) -> Written:
    return write_model(scene, settings)


def played(files: Written, folder: Path) -> tuple[float, list[float]]:
    """The time and qpos that the player prints, by a Python that finds no robotball."""
    for name, text in files.files.items():
        (folder / name).write_text(text)
    code = (
        "import runpy, sys; sys.modules['robotball'] = None; "
        "runpy.run_path('mujoco-play.py', run_name='__main__')"
    )
    said = subprocess.check_output([sys.executable, "-c", code], cwd=folder, text=True)
    found = re.fullmatch(r"t = (\S+) s, qpos = \[(.*)\]\n", said)
    assert found is not None
    return float(found[1]), [float(number) for number in found[2].split(",")]


@pytest.mark.parametrize(
    ("scene", "unplayed"),
    [
        (WOBBLING.until(1.5), 0.71),
        (worked("W4").until(0.5), 0.22),
        (random_tree(np.random.default_rng(2), framed=False).until(0.5), 5.0e-3),
    ],
    ids=["ball", "W4", "tree"],
)
def test_plain_steps_end_where_the_equations_do_with_the_controls_alone(
    scene: rb.Scene, unplayed: float, tmp_path: Path
) -> None:
    """Held controls are of second order in the step; W4's contact is harder than MJCF can say.

    Measured 1.8e-7 to 2.5e-7 of the path; unplayed: with the keyframe's controls.
    """
    files, theory = files_of(scene), rb.integrate(scene)

    def off(qpos: list[float]) -> float:
        miss = np.linalg.norm(qpos[:2] - theory.contact_point[-1])
        return float(miss / theory.path_scale)

    t, qpos = played(files, tmp_path)
    assert t == pytest.approx(scene.duration, rel=1e-12)
    assert off(qpos) < 1e-6
    compiled = mujoco.MjModel.from_xml_string(files.xml)
    data = mujoco.MjData(compiled)
    mujoco.mj_resetDataKeyframe(compiled, data, 0)
    while data.time < scene.duration - 1e-9:
        mujoco.mj_step(compiled, data)
    assert off(data.qpos.tolist()) > unplayed / 2
    assert files.needs is not None
    assert unnamed("mujoco-play.py", files.needs) == []
    assert "mujoco-play.py" in files.xml.partition("-->")[0]


def test_settings_that_never_get_good_keep_their_own_step() -> None:
    """The naive preset shows what a newcomer writes, with its step."""
    files = files_of(WOBBLING.until(0.1), rb.preset("naive"))
    timestep = mujoco.MjModel.from_xml_string(files.xml).opt.timestep
    assert timestep == mujoco.MjModel.from_xml_string("<mujoco/>").opt.timestep


@pytest.mark.parametrize("name", ["classical_regular", "fig12"])
def test_a_steady_scene_s_file_needs_no_player(name: str) -> None:
    """Any way of stepping it is right; what a user must know stands in its first lines.

    Resistance to rolling is no part of MJCF.
    """
    scene = rb.load_scene(name)
    files = files_of(scene)
    assert (files.needs, files.files) == (None, {"mujoco.xml": files.xml})
    comment = files.xml.partition("-->")[0]
    for words in ('the keyframe "start"', "Armature: so large that", "Integrator: RK4", "MJX"):
        assert words in comment
    assert mujoco.MjModel.from_xml_string(files.xml).camera("track").name == "track"
    missing = "resistance to rolling, which robotball adds"
    assert missing not in comment
    assert missing in files_of(replace(scene, friction=Friction(rolling=0.01))).xml
