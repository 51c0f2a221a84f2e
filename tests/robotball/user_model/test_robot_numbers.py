"""The numbers of a robot's own file have paths, and the file with others is the author's."""

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
    """Those of the first robot."""
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
def test_numbers_are_called_as_the_file_has_them(name: str, numbers: RobotNumbers) -> None:
    """By the last words of a path: an element by its name or its tag, after that of its body."""
    assert numbers.path_of(name) == PATHS[name]


REFUSED = {
    "plate.maas": "'plate.maas' plate.geom.mass",
    "mass": "'mass' ball.shell.mass plate.geom.mass pendulum.geom.mass",
    "drive.gear": "file written",
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_name_of_none_or_of_several_is_refused(name: str, numbers: RobotNumbers) -> None:
    """With its neighbours; of what stands nowhere in the file, with what to do."""
    with pytest.raises(rb.InputError) as refused:
        numbers.path_of(name)
    assert unnamed(REFUSED[name], str(refused.value)) == []


def test_a_file_with_other_numbers_is_the_authors(numbers: RobotNumbers) -> None:
    """One attribute differs, and a keyframe more; the model has the number, the scene too."""
    scene = numbers.scene({"plate.geom.mass": 0.9, "plate.geom.pos.z": -0.04})
    assert scene.ball.mass == pytest.approx(2.3, rel=1e-12)
    text = numbers.text({"plate.geom.mass": 0.9, "plate.geom.pos.z": -0.04}, scene)
    own = FIRST.read_text()
    assert text.replace('pos="0 0 -0.04" mass="0.9"', 'pos="0 0 -.03" mass=".8"') != own
    lines = set(text.splitlines()) - set(own.splitlines())
    assert len(lines) == 2
    model = mujoco.MjModel.from_xml_string(text)
    assert model.body("plate").mass[0] == 0.9
    assert model.body("plate").ipos[2] == -0.04
    assert model.key("fitted").ctrl.tolist() == [0.06, 0.5, 40]


def test_numbers_that_cannot_be_are_refused(numbers: RobotNumbers) -> None:
    """In a line with the file."""
    with pytest.raises(rb.InputError, match=naming("first_robot.xml compile")):
        numbers.scene({"ball.shell.mass": -1.0})


def test_a_scene_file_may_name_the_robot(tmp_path: Path) -> None:
    """With its controls; the numbers are the robot's."""
    path = tmp_path / "mine.toml"
    path.write_text(f'robot = "{FIRST}"\nduration = 2.0\ncontrols.drive = 0.01\n')
    found = numbers_of(path)
    assert found.known["wheel.kv"].value == 0.01
    scene = found.scene({})
    assert (scene.actuators[0].command, scene.duration) == (0.01, 2.0)


def moving(numbers: RobotNumbers) -> rb.Scene:
    """The first robot in a motion in which everything turns."""
    scene = numbers.scene({}).with_hinges(
        angle={"plate": 0.3, "pendulum": -0.2}, rate={"plate": 2.0, "flywheel": 3.0}
    )
    attitude = turned(np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.1, 0.2, 0.3]))
    scene = replace(scene, start=rb.Start(attitude, np.zeros(3)))
    momentum = scene.momentum_of(np.array([1.0, 2.0, 3.0]))
    return replace(scene, start=rb.Start(attitude, momentum))


def test_the_model_starts_as_the_scene(numbers: RobotNumbers) -> None:
    """Attitude, angular velocity and hinges are the scene's; it rolls, on the plane."""
    scene, robot = moving(numbers), numbers.robot
    data = robot.start_as(scene, None)
    axes = data.geom_xmat[robot.sphere].reshape(3, 3)
    to_world = rotation_matrix(scene.start.attitude)
    # Measured at most 1e-16 of all of them, rounding.
    assert np.abs(axes - to_world).max() < 1e-14
    assert np.abs(to_world.T @ robot.moving(data)[:3] - [1.0, 2.0, 3.0]).max() < 1e-12
    assert np.abs(robot.slip(data)).max() < 1e-12
    assert abs(robot.above_plane(data)[1]) < 1e-14
    assert data.qvel[6:].tolist() == [2.0, 0.0, 3.0]


@pytest.mark.parametrize("name", ["plate", "pendulum", "flywheel"])
def test_a_links_sensors_read_what_the_engine_has(name: str, numbers: RobotNumbers) -> None:
    """Its attitude and its angular velocity in its own axes, by the chain of its joints."""
    scene, robot = moving(numbers), numbers.robot
    model, data = robot.model, robot.start_as(scene, None)
    body, turning = model.body(name).id, np.zeros(6)
    kind = mujoco.mjtObj.mjOBJ_XBODY
    mujoco.mj_objectVelocity(model, data, kind, body, turning, 1)
    start = rb.integrate(scene, np.array([0.0, 0.1]))
    for sensor, read in (("gyro", turning[:3]), ("attitude", data.xquat[body])):
        given = rb.Sensor(f"{name}_{sensor}", start.times[:1], read[None].copy())
        # Measured 4e-16.
        assert np.abs(apart(given, start, np.array([0]), {})).max() < 1e-12
