"""An export describes the scene's ball in every format."""

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.files.columns import read_table
from robotball.rotations import rotation_matrix
from robotball.view.export import formula
from tests.random_robots import random_scene

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


def read(folder: Path) -> Any:
    return json.loads((folder / "scene.json").read_text())


def test_the_momentum_of_the_exported_bodies_is_the_scenes(exported: Exported) -> None:
    """M from the JSON alone: Σ r×mv + Jω about the contact point (measured 4.4e-15 kg m²/s).

    Inertias about the centre, moved by Steiner's theorem, add up to the ball's inertia.
    """
    scene, folder = exported
    data = read(folder)
    L = np.zeros(3)
    for body in data["bodies"]:
        state = {name: np.array(value) for name, value in body["start"].items()}
        R = rotation_matrix(state["attitude"])
        L += R @ np.array(body["inertia"]) @ R.T @ state["angular_velocity"]
        L += np.cross(state["position"], body["mass"] * state["velocity"])
    M = np.cross([0, 0, 1], L) if scene.rolling == "rubber" else L
    assert pytest.approx(scene.start.momentum, abs=2e-14) == M
    assert data["start"]["momentum_world"] == pytest.approx(scene.start.momentum, abs=2e-14)
    whole = np.sum([body["inertia_about_centre"] for body in data["bodies"]], axis=0)
    assert whole == pytest.approx(scene.ball.inertia, rel=1e-14, abs=1e-15)


def test_the_exported_start_rolls_with_the_commanded_hinge_rates(exported: Exported) -> None:
    """The shell's lowest point is at rest, and each body rotates relative to its parent."""
    scene, folder = exported
    bodies = {body["name"]: body for body in read(folder)["bodies"]}
    shell = bodies["shell"]["start"]
    turning = np.array(shell["angular_velocity"])
    still = shell["velocity"] - np.cross(turning, shell["position"])
    assert still == pytest.approx(np.zeros(3), abs=1e-14)
    if scene.rolling == "rubber":
        assert turning[2] == pytest.approx(0.0, abs=1e-14)
    for name, body in bodies.items():
        if hinge := body["hinge"]:
            parent = bodies[hinge["parent"]]["start"]
            more = np.subtract(body["start"]["angular_velocity"], parent["angular_velocity"])
            axis = rotation_matrix(np.array(parent["attitude"])) @ hinge["axis"]
            assert more == pytest.approx(hinge["rate"] * axis, abs=1e-13 * abs(hinge["rate"])), name


def test_the_keyframe_of_the_mjcf_is_the_initial_state(exported: Exported) -> None:
    """MuJoCo's momentum at the keyframe is the scene's M (measured 1.5e-14 kg m²/s)."""
    scene, folder = exported
    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    data = mujoco.MjData(model)
    gravity = scene.gravity * np.array(scene.gravity_direction)
    assert model.opt.gravity.tolist() == read(folder)["gravity"] == gravity.tolist()
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    arm = data.subtree_com[1]
    L = data.subtree_angmom[1] + np.cross(arm, scene.ball.mass * data.subtree_linvel[1])
    M = np.cross([0, 0, 1], L) if scene.rolling == "rubber" else L
    assert pytest.approx(scene.start.momentum, abs=1e-13) == M


def test_drives_are_exported_as_formula_or_samples(tmp_path: Path) -> None:
    """A formula with its numbers reproduces the samples; functions have samples only."""
    ramp = rb.Ramp(final=3.0, end=0.5, initial=1.0, shape="smooth")
    sine = rb.Sine(amplitude=2.0, frequency=0.7, mean=0.5, phase=0.1)
    scene = rb.load_scene("fig12").with_hinges(command=(ramp, sine))
    names = {path.name for path in rb.export_scene(scene, tmp_path, np.linspace(0, 1, 11))}
    hinges = [body["hinge"] for body in read(tmp_path)["bodies"][1:]]
    assert [hinge["command"]["kind"] for hinge in hinges] == ["ramp", "sine"]
    assert hinges[0]["command"]["breakpoints"] == [0.0, 0.5]
    text = hinges[1]["command"]["formula"]
    rows = read_table(tmp_path / "drives.csv").columns
    values = [eval(text, {"t": t, "sin": np.sin, "pi": np.pi}) for t in rows["t"]]
    assert rows["rotor1_command"] == pytest.approx(values, rel=1e-15)
    assert formula(scene.drives[0])["formula"].startswith("1.0 + (3.0 - 1.0)*(3u² - 2u³)")
    scene = scene.with_hinges(command={"frame": lambda t: 2.0 + np.sin(t) ** 3})
    others = {path.name for path in rb.export_scene(scene, tmp_path, np.linspace(0, 1, 11))}
    assert names - others == {"scene.toml"}
    assert others > {"scene.json", "model.xml", "model.urdf", "README.md"}
    rows = read_table(tmp_path / "drives.csv").columns
    assert rows["frame_command"] == pytest.approx(2.0 + np.sin(rows["t"]) ** 3, rel=1e-12)
    header = read_table(tmp_path / "reference.csv").header
    assert header["scene_toml_missing"].startswith("a function of time cannot")
    motion = rb.load_motion(tmp_path / "reference.csv", scene)
    assert motion.path_length == rb.integrate(scene, motion.times).path_length


def test_the_exported_friction_is_what_the_motion_needs(tmp_path: Path) -> None:
    """The maximum over time of both coefficients; 1.5 times as much in the models."""
    scene = rb.load_scene("fig12")
    rb.export_scene(scene, tmp_path)
    loads = rb.integrate(scene).loads
    needed = read(tmp_path)["friction_needed"]
    assert needed["sliding"] == pytest.approx(loads.sliding_friction.max(), rel=1e-12)
    assert needed["torsional"] == pytest.approx(loads.torsional_friction.max(), rel=1e-12)
    both = 1.5 * needed["sliding"], 1.5 * needed["torsional"]
    floor = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml")).geom("floor")
    assert floor.friction == pytest.approx([*both, 0])
