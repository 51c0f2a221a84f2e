"""Exported models run correctly without robotball, or name the script that they need."""

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
from robotball.rotations import Array
from tests.messages import unnamed
from tests.random_robots import random_tree
from tests.robotball.theory.test_friction import regular
from tests.robots import worked

BALANCED = rb.preset("balanced")
WOBBLING = rb.load_scene("wobbling_drive")


def files_of(scene: rb.Scene, settings: rb.Settings = BALANCED) -> Written:
    return write_model(scene, settings)


def played(files: Written, folder: Path) -> tuple[float, list[float]]:
    """Return the time and qpos printed by the player in a Python without robotball."""
    for name, text in files.files.items():
        (folder / name).write_text(text)
    code = (
        "import runpy, sys; sys.modules['robotball'] = None; "
        "runpy.run_path('mujoco-play.py', run_name='__main__')"
    )
    output = subprocess.check_output([sys.executable, "-c", code], cwd=folder, text=True)
    match = re.fullmatch(r"t = (\S+) s, qpos = \[(.*)\]\n", output)
    assert match is not None
    return float(match[1]), [float(number) for number in match[2].split(",")]


@pytest.mark.parametrize(
    ("scene", "unplayed"),
    [
        (WOBBLING.until(1.5), 0.71),
        (worked("W4").until(0.5), 0.22),
        (random_tree(np.random.default_rng(2), framed=False).until(0.5), 5.0e-3),
    ],
    ids=["ball", "W4", "tree"],
)
def test_the_player_is_needed_to_follow_the_equations(
    scene: rb.Scene, unplayed: float, tmp_path: Path
) -> None:
    """Plain steps with the constant controls of the keyframe miss the end point by `unplayed`.

    Measured with the player: 1.8e-7 to 2.5e-7 of the path, from holding controls over a step and
    from the contact of W4, which is harder than MJCF can express.
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


def test_the_naive_preset_is_exported_with_mujocos_default_timestep() -> None:
    """An accurate step would hide the errors that this preset demonstrates."""
    files = files_of(WOBBLING.until(0.1), rb.preset("naive"))
    timestep = mujoco.MjModel.from_xml_string(files.xml).opt.timestep
    assert timestep == mujoco.MjModel.from_xml_string("<mujoco/>").opt.timestep


@pytest.mark.parametrize("name", ["classical_regular", "fig12"])
def test_a_steady_scene_is_exported_as_one_file(name: str) -> None:
    """Its first comment explains the model, and names resistance to rolling, which MJCF lacks."""
    scene = rb.load_scene(name)
    files = files_of(scene)
    assert (files.needs, files.files) == (None, {"mujoco.xml": files.xml})
    comment = files.xml.partition("-->")[0]
    for phrase in ('the keyframe "start"', "Armature: so large that", "Integrator: RK4", "MJX"):
        assert phrase in comment
    assert mujoco.MjModel.from_xml_string(files.xml).camera("track").name == "track"
    missing = "resistance to rolling, which robotball adds"
    assert missing not in comment
    assert missing in files_of(replace(scene, friction=Friction(rolling=0.01))).xml


def stepped(xml: str, times: Array) -> Array:
    """Return the contact points (n, 2) [m] of a model that MuJoCo steps to times [s]."""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    points = []
    for t in times:
        while data.time < t - 1e-9:
            mujoco.mj_step(model, data)
        points.append(data.qpos[:2].copy())
    return np.array(points)


def test_an_exported_ball_slips_only_with_the_contact_for_slipping() -> None:
    """Path errors of classical_regular at 0.3 over 3 s: 3.5e-4, from late friction.

    With the contact for rolling and this friction it is 0.14, of which the model's comment warns.
    """
    scene, theory = regular(0.3), rb.integrate(regular(0.3), 3.0)
    slips, rolls = (files_of(each).xml for each in (scene, scene.ideal))
    lowered = re.sub(r'(<pair [^>]* friction=")[^"]*', r"\g<1>0.3 0.3 0.005", rolls)
    errors = [
        np.linalg.norm(stepped(xml, theory.times) - theory.contact_point, axis=1).max()
        / theory.path_scale
        for xml in (slips, lowered)
    ]
    assert errors[0] < 5e-4
    assert errors[1] > 0.1
    words = [" ".join(xml.partition("-->")[0].split()) for xml in (slips, rolls)]
    assert unnamed("impratio solreffriction timestep export~again", words[0]) == []
    assert unnamed("lower seventh [friction] export~again", words[1]) == []
    assert "Friction:" not in words[0] + files_of(scene.ideal, rb.preset("naive")).xml
    assert "Slip:" not in words[1]


def test_an_exported_dry_hinge_has_the_hardest_row_and_a_remark() -> None:
    """Other programs have no torque of friction. A newcomer's row stays MuJoCo's default."""
    dry = rb.load_scene("fig12").with_hinges(motor={"rotor1": rb.Free(friction=0.01)})
    for preset, hard in (("balanced", True), ("naive", False)):
        xml = files_of(dry, rb.preset(preset)).xml
        assert 'frictionloss="0.01"' in xml
        assert ('solreffriction="0 -360"' in xml, "frictionloss is" in xml) == (hard, hard)
