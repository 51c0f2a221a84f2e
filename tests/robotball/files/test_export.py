"""What is exported says the same of the ball as the scene does, in every format."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.files.columns import read_table
from robotball.files.export import formula
from robotball.rotations import Array, rotation_matrix
from tests.random_robots import random_scene

NAMES = ("fig12", "three_rotors", "classical_regular", "wobbling_drive")
# The larger equations take some seconds to be ready.
ROBOTS = [pytest.param(name, marks=pytest.mark.slow) for name in ("pendulum", "robot 1", "robot 2")]


@pytest.fixture(scope="module", params=[*NAMES, *ROBOTS])
def exported(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[rb.Scene, Path]:
    """A scene and the folder of its export; robots have any hinges and motors, off centre."""
    kind, _, number = request.param.partition(" ")
    if kind == "robot":
        scene = random_scene(np.random.default_rng(int(number)))
    else:
        scene = with_pendulum() if kind == "pendulum" else rb.load_scene(kind)
    folder = tmp_path_factory.mktemp("export")
    rb.export_scene(scene, folder, np.linspace(0, 1, 21))
    return scene, folder


def with_pendulum() -> rb.Scene:
    scene = rb.load_scene("fig12")
    pendulum = rb.Pendulum(
        mass=0.05,
        inertia=np.diag([1e-3, 2e-3, 2.5e-3]),
        centre=np.array([0.05, -0.02, -0.3]),
        axis=np.array([0.6, 0.0, 0.8]),
        pivot=np.array([0.02, 0.1, 0.05]),
    )
    shell = replace(scene.ball.shell, offset=0.01)
    ball = replace(scene.ball, shell=shell, pendulums=(pendulum,))
    start = replace(scene.start, hinge_angles=np.array([0.0, 0.0, 0.4]))
    return replace(scene, ball=ball, pendulum_rates=(0.7,), start=start)


def read(folder: Path) -> Any:
    return json.loads((folder / "scene.json").read_text())


def test_the_start_of_all_bodies_makes_the_scenes_momentum(
    exported: tuple[rb.Scene, Path],
) -> None:
    """M from the JSON alone: Σ r×mv + Jω about the contact point (measured 6e-15 kg m²/s)."""
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


def test_the_start_rolls_and_the_hinges_turn_as_commanded(exported: tuple[rb.Scene, Path]) -> None:
    """The shell's lowest point stands still, and each body turns against its parent by its rate."""
    scene, folder = exported
    bodies = {body["name"]: body for body in read(folder)["bodies"]}
    shell = bodies["shell"]
    turning = np.array(shell["start"]["angular_velocity"])
    lowest = np.array([0, 0, 0]) - shell["start"]["position"]
    still = np.array(shell["start"]["velocity"]) + np.cross(turning, lowest)
    assert still == pytest.approx(np.zeros(3), abs=1e-14)
    if scene.rolling == "rubber":
        assert turning[2] == pytest.approx(0.0, abs=1e-14)
    for name, body in bodies.items():
        if hinge := body["hinge"]:
            parent = bodies[hinge["parent"]]["start"]
            more = np.subtract(body["start"]["angular_velocity"], parent["angular_velocity"])
            axis = rotation_matrix(np.array(parent["attitude"])) @ hinge["axis"]
            assert more == pytest.approx(hinge["rate"] * axis, abs=1e-13 * abs(hinge["rate"])), name


def masses(scene: rb.Scene) -> dict[str, tuple[float, Array, Array]]:
    """Mass, centre and inertia of each body."""
    return {name: (b.mass, b.centre, b.inertia) for name, b in scene.ball.named_bodies}


def tensor(six: list[float]) -> Array:
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


SIX = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def floats(text: str | None) -> list[float]:
    return [float(each) for each in (text or "").split()]


def test_the_json_has_the_scenes_masses_and_inertia(exported: tuple[rb.Scene, Path]) -> None:
    """To the last bit; that about the centre by Steiner's theorem sums to the ball's."""
    scene, folder = exported
    data = read(folder)
    for body, (mass, centre, inertia) in zip(data["bodies"], masses(scene).values(), strict=True):
        assert body["mass"] == mass
        assert body["centre_of_mass"] == centre.tolist()
        assert body["inertia"] == inertia.tolist()
    whole = np.sum([body["inertia_about_centre"] for body in data["bodies"]], axis=0)
    assert whole == pytest.approx(scene.ball.inertia, rel=1e-14, abs=1e-15)


def test_the_urdf_read_again_has_the_same_bodies(exported: tuple[rb.Scene, Path]) -> None:
    """Masses to the last bit; inertia but for its own asymmetry, which is rounding."""
    scene, folder = exported
    root = ElementTree.parse(folder / "model.urdf").getroot()
    place = {"shell": np.zeros(3)}
    for joint in root.iter("joint"):
        parent = joint.find("parent").get("link")  # type: ignore[union-attr]
        child = joint.find("child").get("link")  # type: ignore[union-attr]
        origin = floats(joint.find("origin").get("xyz"))  # type: ignore[union-attr]
        place[str(child)] = place[str(parent)] + origin
    for link in root.iter("link"):
        mass, centre, inertia = masses(scene)[str(link.get("name"))]
        own = floats(link.find("inertial/origin").get("xyz"))  # type: ignore[union-attr]
        moments = link.find("inertial/inertia")
        assert moments is not None
        assert floats(link.find("inertial/mass").get("value")) == [mass]  # type: ignore[union-attr]
        six = [float(moments.get(n, "")) for n in SIX]
        assert tensor(six) == pytest.approx(inertia, rel=1e-14, abs=1e-18)
        assert place[str(link.get("name"))] + own == pytest.approx(centre, abs=1e-16)
    hinges = [(j.get("name"), floats(j.find("axis").get("xyz"))) for j in root.iter("joint")]  # type: ignore[union-attr]
    assert hinges == [(f"{h.name}_hinge", h.axis.tolist()) for h in scene.hinges]


def test_the_sdf_read_again_has_the_same_bodies(exported: tuple[rb.Scene, Path]) -> None:
    """The same, and gravity and the start's pose."""
    scene, folder = exported
    world = ElementTree.parse(folder / "model.sdf").getroot().find("world")
    assert world is not None
    gravity = scene.gravity * np.array(scene.gravity_direction)
    assert floats(world.findtext("gravity")) == gravity.tolist()
    ball = world.find("model[@name='ball']")
    assert ball is not None
    for link in ball.iter("link"):
        mass, centre, inertia = masses(scene)[str(link.get("name"))]
        place = np.array(floats(link.findtext("pose"))) + floats(link.findtext("inertial/pose"))
        assert float(link.findtext("inertial/mass", "")) == mass
        found = [float(link.findtext(f"inertial/inertia/{name}", "")) for name in SIX]
        assert tensor(found) == pytest.approx(inertia, rel=1e-14, abs=1e-18)
        assert place[:3] == pytest.approx(centre, abs=1e-16)
    pose = floats(ball.findtext("pose"))
    assert pose[:3] == [0, 0, scene.ball.radius]
    (roll, pitch, yaw), turns = pose[3:], []
    for axis, angle in zip(np.eye(3), (roll, pitch, yaw), strict=True):
        turns.append(rotation_matrix(np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])))
    # Of the shell, which is the frame's but for the angle of the hinge between them.
    (shell,) = (body for body in read(folder)["bodies"] if body["name"] == "shell")
    start = rotation_matrix(np.array(shell["start"]["attitude"]))
    assert turns[2] @ turns[1] @ turns[0] == pytest.approx(start, abs=1e-14)


def test_the_mjcf_compiles_to_the_same_bodies_and_start(exported: tuple[rb.Scene, Path]) -> None:
    """MuJoCo's own momentum at the keyframe is the scene's M (measured 4e-15 kg m²/s)."""
    scene, folder = exported
    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for name, (mass, _, inertia) in masses(scene).items():
        assert model.body(name).mass[0] == pytest.approx(mass, rel=1e-15)
        moments = np.sort(model.body(name).inertia)
        assert moments == pytest.approx(np.linalg.eigvalsh(inertia), rel=1e-10)
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    arm = data.subtree_com[1]
    L = data.subtree_angmom[1] + np.cross(arm, scene.ball.mass * data.subtree_linvel[1])
    M = np.cross([0, 0, 1], L) if scene.rolling == "rubber" else L
    assert pytest.approx(scene.start.momentum, abs=1e-13) == M


def test_the_reference_is_a_file_that_can_be_judged(exported: tuple[rb.Scene, Path]) -> None:
    """With the columns and the sample times that are asked for; it is the motion itself."""
    scene, folder = exported
    motion = rb.load_motion(folder / "reference.csv", scene)
    assert motion.times.tolist() == np.linspace(0, 1, 21).tolist()
    assert rb.read_trajectory(folder / "reference.csv").angular_velocity is not None
    assert read(folder)["sample_times"]["count"] == 21


def test_drives_are_told_by_formula_and_by_samples(tmp_path: Path) -> None:
    """The formula of each kind, with its numbers, gives the samples."""
    scene = replace(
        rb.load_scene("fig12"),
        frame_rate=rb.Ramp(final=3.0, end=0.5, initial=1.0, shape="smooth"),
        rotor_rates=(rb.Sine(amplitude=2.0, frequency=0.7, mean=0.5, phase=0.1),),
    )
    rb.export_scene(scene, tmp_path, np.linspace(0, 1, 11))
    hinges = [body["hinge"] for body in read(tmp_path)["bodies"][1:]]
    assert [each["command"]["kind"] for each in hinges] == ["ramp", "sine"]
    assert hinges[0]["command"]["breakpoints"] == [0.0, 0.5]
    text = hinges[1]["command"]["formula"]
    rows = read_table(tmp_path / "drives.csv").columns
    values = [eval(text, {"t": t, "sin": np.sin, "pi": np.pi}) for t in rows["t"]]
    assert rows["rotor1_command"] == pytest.approx(values, rel=1e-15)
    assert formula(scene.drives[0])["formula"].startswith("1.0 + (3.0 - 1.0)*(3u² - 2u³)")


def test_a_drive_by_a_function_is_told_by_its_samples(tmp_path: Path) -> None:
    """There is no scene.toml then, and drives.csv has its numbers."""
    scene = replace(rb.load_scene("fig12"), frame_rate=lambda t: 2.0 + np.sin(t) ** 3)
    names = [path.name for path in rb.export_scene(scene, tmp_path, np.linspace(0, 1, 11))]
    assert "scene.toml" not in names
    assert {"scene.json", "model.xml", "model.urdf", "model.sdf", "README.md"} < set(names)
    rows = read_table(tmp_path / "drives.csv").columns
    assert rows["frame_command"] == pytest.approx(2.0 + np.sin(rows["t"]) ** 3, rel=1e-12)


def test_the_friction_that_is_told_is_what_the_motion_needs(tmp_path: Path) -> None:
    """The largest of both over the time, as the loads have them."""
    scene = rb.load_scene("fig12")
    rb.export_scene(scene, tmp_path)
    loads = rb.integrate(scene).loads
    needed = read(tmp_path)["friction_needed"]
    assert needed["sliding"] == pytest.approx(loads.sliding_friction.max(), rel=1e-12)
    assert needed["torsional"] == pytest.approx(loads.torsional_friction.max(), rel=1e-12)


def test_pybullet_reads_the_robot(exported: tuple[rb.Scene, Path]) -> None:
    """By its own importers: a body a hinge, of the same masses; left out where it is missing."""
    bullet = pytest.importorskip("pybullet")
    scene, folder = exported
    client = bullet.connect(bullet.DIRECT)
    try:
        urdf = bullet.loadURDF(str(folder / "model.urdf"))
        _, sdf = bullet.loadSDF(str(folder / "model.sdf"))
        for body in (urdf, sdf):
            masses = [
                bullet.getDynamicsInfo(body, link)[0]
                for link in range(-1, bullet.getNumJoints(body))
            ]
            assert masses == pytest.approx([each.mass for _, each in scene.ball.named_bodies])
    finally:
        bullet.disconnect(client)


def test_drake_reads_the_robot(exported: tuple[rb.Scene, Path]) -> None:
    """By its own parser, which gives the plane of the SDF a mass of 1 kg."""
    plant = pytest.importorskip("pydrake.multibody.plant")
    parsing = pytest.importorskip("pydrake.multibody.parsing")
    scene, folder = exported
    for kind, plane in (("urdf", 0.0), ("sdf", 1.0)):
        world = plant.MultibodyPlant(1e-3)
        parsing.Parser(world).AddModels(str(folder / f"model.{kind}"))
        world.Finalize()
        assert world.num_velocities() == 6 + len(scene.hinges)
        mass = world.CalcTotalMass(world.CreateDefaultContext())
        assert mass == pytest.approx(scene.ball.mass + plane)


def test_pinocchio_reads_the_robot(exported: tuple[rb.Scene, Path]) -> None:
    """By its own importer of URDF."""
    pinocchio = pytest.importorskip("pinocchio")
    scene, folder = exported
    model = pinocchio.buildModelFromUrdf(
        str(folder / "model.urdf"), pinocchio.JointModelFreeFlyer()
    )
    assert model.nv == 6 + len(scene.hinges)
    assert sum(each.mass for each in model.inertias) == pytest.approx(scene.ball.mass)
