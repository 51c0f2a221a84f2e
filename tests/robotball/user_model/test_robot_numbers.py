"""Numbers of a robot file: their paths, and the file written with other values."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.fit.scene_numbers import numbers_of
from robotball.fit.sensing import apart
from robotball.rotations import rotation_matrix, turned
from robotball.user_model.mended_file import RobotNumbers, robot_numbers
from tests.messages import naming, unnamed

FIRST = Path("examples/first_robot.xml").absolute()


@pytest.fixture(scope="module")
def numbers() -> RobotNumbers:
    """Return the numbers of the example robot."""
    return robot_numbers(FIRST)


PATHS = {
    "shell.mass": "ball.shell.mass",
    "plate.mass": "plate.geom.mass",
    "plate.pos.z": "plate.geom.pos.z",
    "axle.damping": "plate.axle.damping",
    "wheel.kv": "wheel.kv",
    "kp": "lean.kp",
}


@pytest.mark.parametrize("name", PATHS)
def test_a_number_is_found_by_the_end_of_its_path(name: str, numbers: RobotNumbers) -> None:
    """A path consists of body, element and attribute; an element has its name or its tag."""
    assert numbers.path_of(name) == PATHS[name]


REFUSED = {
    "plate.maas": "'plate.maas' plate.geom.mass",
    "mass": "'mass' ball.shell.mass plate.geom.mass pendulum.geom.mass",
    "drive.gear": "file written",
}


@pytest.mark.parametrize("name", REFUSED)
def test_an_unknown_or_ambiguous_name_is_refused(name: str, numbers: RobotNumbers) -> None:
    """The error lists similar paths, or says that the number must be written in the file."""
    with pytest.raises(rb.InputError) as refused:
        numbers.path_of(name)
    assert unnamed(REFUSED[name], str(refused.value)) == []


def test_a_file_with_other_numbers_changes_only_these(numbers: RobotNumbers) -> None:
    """One line of the file changes, and a keyframe is added; scene and model have the numbers."""
    scene = numbers.scene({"plate.geom.mass": 0.9, "plate.geom.pos.z": -0.04})
    assert scene.ball.mass == pytest.approx(2.3, rel=1e-12)
    text = numbers.text({"plate.geom.mass": 0.9, "plate.geom.pos.z": -0.04}, scene)
    original = FIRST.read_text()
    assert text.replace('pos="0 0 -0.04" mass="0.9"', 'pos="0 0 -.03" mass=".8"') != original
    lines = set(text.splitlines()) - set(original.splitlines())
    assert len(lines) == 2
    model = mujoco.MjModel.from_xml_string(text)
    assert model.body("plate").mass[0] == 0.9
    assert model.body("plate").ipos[2] == -0.04
    assert model.key("fitted").ctrl.tolist() == [0.06, 0.5, 40]


def test_impossible_numbers_are_refused(numbers: RobotNumbers) -> None:
    """The error names the file."""
    with pytest.raises(rb.InputError, match=naming("first_robot.xml compile")):
        numbers.scene({"ball.shell.mass": -1.0})


def test_a_scene_file_of_a_robot_has_the_numbers_of_the_robot(tmp_path: Path) -> None:
    """With the controls of the scene file."""
    path = tmp_path / "mine.toml"
    path.write_text(f'robot = "{FIRST}"\nduration = 2.0\ncontrols.drive = 0.01\n')
    scene_numbers = numbers_of(path)
    assert scene_numbers.known["wheel.kv"].value == 0.01
    scene = scene_numbers.scene({})
    assert (scene.actuators[0].command, scene.duration) == (0.01, 2.0)


def moving(numbers: RobotNumbers) -> rb.Scene:
    """Return the example robot with all hinges and the shell rotating."""
    scene = numbers.scene({}).with_hinges(
        angle={"plate": 0.3, "pendulum": -0.2}, rate={"plate": 2.0, "flywheel": 3.0}
    )
    attitude = turned(np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.1, 0.2, 0.3]))
    scene = replace(scene, start=rb.Start(attitude, np.zeros(3)))
    momentum = scene.momentum_of(np.array([1.0, 2.0, 3.0]))
    return replace(scene, start=rb.Start(attitude, momentum))


def test_the_model_starts_in_the_initial_state_of_the_scene(numbers: RobotNumbers) -> None:
    """Attitude, angular velocity and hinges are equal; the sphere touches the plane and rolls."""
    scene, robot = moving(numbers), numbers.robot
    data = robot.start_as(scene, None)
    axes = data.geom_xmat[robot.sphere].reshape(3, 3)
    to_world = rotation_matrix(scene.start.attitude)
    # Measured at most 1e-16: rounding.
    assert np.abs(axes - to_world).max() < 1e-14
    assert np.abs(to_world.T @ robot.moving(data)[:3] - [1.0, 2.0, 3.0]).max() < 1e-12
    assert np.abs(robot.slip(data)).max() < 1e-12
    assert abs(robot.above_plane(data)[1]) < 1e-14
    assert data.qvel[6:].tolist() == [2.0, 0.0, 3.0]


@pytest.mark.parametrize("name", ["plate", "pendulum", "flywheel"])
def test_sensors_of_a_link_agree_with_mujoco(name: str, numbers: RobotNumbers) -> None:
    """Attitude, and angular velocity in body axes."""
    scene, robot = moving(numbers), numbers.robot
    model, data = robot.model, robot.start_as(scene, None)
    body, turning = model.body(name).id, np.zeros(6)
    kind = mujoco.mjtObj.mjOBJ_XBODY
    mujoco.mj_objectVelocity(model, data, kind, body, turning, 1)
    start = rb.integrate(scene, np.array([0.0, 0.1]))
    for sensor, read in (("gyro", turning[:3]), ("attitude", data.xquat[body])):
        log = rb.Sensor(f"{name}_{sensor}", start.times[:1], read[None].copy())
        # Measured 4e-16.
        assert np.abs(apart(log, start, np.array([0]), {})).max() < 1e-12
