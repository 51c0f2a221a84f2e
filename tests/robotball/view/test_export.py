"""An export describes the scene's ball in every format."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.files.columns import read_table
from tests.random_robots import random_scene
from tests.robotball.theory.test_friction import sphere

TIMES = np.linspace(0, 0.2, 5)
# The last two are a rubber and a classical robot with three off-centre hinges each.
ROBOTS = [random_scene(np.random.default_rng(seed)) for seed in (15, 17)]
Exported = tuple[rb.Scene, Path]


@pytest.fixture(scope="module", params=[rb.load_scene("three_rotors"), *ROBOTS], ids=range(3))
def exported(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    """Return a scene and the folder of its export."""
    folder = tmp_path_factory.mktemp("export")
    rb.export_scene(request.param, folder, TIMES)
    return request.param, folder


def test_the_keyframe_of_the_mjcf_is_the_initial_state(exported: Exported) -> None:
    """MuJoCo's momentum at the keyframe is the scene's M (measured 1.5e-14 kg m²/s)."""
    scene, folder = exported
    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    data = mujoco.MjData(model)
    gravity = scene.gravity * np.array(scene.gravity_direction)
    assert model.opt.gravity.tolist() == gravity.tolist()
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    arm = data.subtree_com[1]
    L = data.subtree_angmom[1] + np.cross(arm, scene.ball.mass * data.subtree_linvel[1])
    M = np.cross([0, 0, 1], L) if scene.rolling == "rubber" else L
    assert pytest.approx(scene.start.momentum, abs=1e-13) == M


def test_drives_are_exported_as_samples(tmp_path: Path) -> None:
    """Of every drive; a function of time has no scene file."""
    ramp = rb.Ramp(final=3.0, end=0.5, initial=1.0, shape="smooth")
    sine = rb.Sine(amplitude=2.0, frequency=0.7, mean=0.5, phase=0.1)
    scene = rb.load_scene("fig12").with_hinges(command=(ramp, sine))
    names = {path.name for path in rb.export_scene(scene, tmp_path, np.linspace(0, 1, 11))}
    rows = read_table(tmp_path / "drives.csv").columns
    assert rows["rotor1_command"] == pytest.approx(sine.rate(rows["t"]), rel=1e-15)
    scene = scene.with_hinges(command={"frame": lambda t: 2.0 + np.sin(t) ** 3})
    others = {path.name for path in rb.export_scene(scene, tmp_path, np.linspace(0, 1, 11))}
    assert names - others == {"scene.toml"}
    assert others > {"model.xml", "model.urdf", "README.md"}
    rows = read_table(tmp_path / "drives.csv").columns
    assert rows["frame_command"] == pytest.approx(2.0 + np.sin(rows["t"]) ** 3, rel=1e-12)
    header = read_table(tmp_path / "reference.csv").header
    assert header["scene_toml_missing"].startswith("a function of time cannot")
    motion = rb.load_motion(tmp_path / "reference.csv", scene)
    assert motion.path_length == rb.integrate(scene, motion.times).path_length


def test_the_exported_friction_is_what_the_motion_needs(tmp_path: Path) -> None:
    """1.5 times the maximum over time of both coefficients."""
    scene = rb.load_scene("fig12")
    rb.export_scene(scene, tmp_path)
    loads = rb.integrate(scene).loads
    both = 1.5 * loads.sliding_friction.max(), 1.5 * loads.torsional_friction.max()
    floor = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml")).geom("floor")
    assert floor.friction == pytest.approx([*both, 0])


def test_an_exported_ball_that_slides_has_its_friction_and_its_velocity(tmp_path: Path) -> None:
    """A ball that rolled from the start would have the velocity (0.5, -1) m/s."""
    slides = sphere((2.0, 0.0), (10.0, 5.0, 0.0), rb.Friction(0.3))
    rb.export_scene(slides, tmp_path, 1.0)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    assert model.geom("floor").friction.tolist() == [0.3, 0.0, 0.0]
    assert model.key_qvel[0] == pytest.approx([2.0, 0.0, 0.0, 10.0, 5.0, 0.0], abs=1e-13)
