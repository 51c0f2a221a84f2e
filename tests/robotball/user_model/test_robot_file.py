"""Scenes of MJCF and URDF robots roll like the original model with fine steps."""

import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.rotations import Array
from robotball.user_model import robot_file
from robotball.user_model.robot_file import RobotFile, open_robot
from robotball.user_model.robot_scene import scene_of_robot
from tests.messages import naming, unnamed
from tests.motions import pair_of
from tests.robotball.scene_files.scene_texts import PLATE

# An inner body has the free joint and carries the shell, with a weight, on a gimbal. One motor acts
# on both joints of the gimbal, and another slides a mass.
GIMBAL = """<mujoco><default><joint damping=".01" armature=".0002"/></default><worldbody>
<geom type="plane" size="1 1 .1"/><body name="inner" pos="0 0 .2" euler="10 20 0"><freejoint/>
 <geom type="box" size=".05 .04 .03" mass="1" contype="0" conaffinity="0" pos="0 .01 -.05"/>
 <body name="gimbal"><joint name="g1" axis="1 0 0"/><joint name="g2" axis="0 1 0"/>
  <geom type="sphere" size=".2" mass=".6" condim="4"/>
  <body pos=".1 0 0"><geom type="box" size=".01 .01 .01" mass=".1" contype="0" conaffinity="0"/>
  </body></body>
 <body name="slider" pos="0 0 .05">
  <joint name="s" type="slide" axis="0 1 1" stiffness="40" springref=".01" damping="1"/>
  <geom type="box" size=".01 .02 .01" mass=".3" contype="0" conaffinity="0"/></body>
</body></worldbody>
<tendon><fixed name="both"><joint joint="g1" coef="1"/><joint joint="g2" coef="-1"/></fixed>
</tendon>
<actuator><position name="p" tendon="both" kp=".5" kv=".02" forcerange="-.3 .3"/>
 <motor joint="s" gear="3"/></actuator>
<keyframe><key qpos="0 0 .2 1 .1 0 0 .2 -.3 .005" ctrl=".4 .2"/></keyframe></mujoco>"""

# The root is the chassis, which a URDF leaves without a joint; the shell hangs on it.
HULL = """<robot name="hull">
<link name="chassis"><inertial><mass value="1.5"/><origin xyz="0.03 0 -0.04"/>
 <inertia ixx=".003" iyy=".004" izz=".005" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="hull"><inertial><mass value=".5"/>
 <inertia ixx=".0075" iyy=".0075" izz=".0075" ixy="0" ixz="0" iyz="0"/></inertial>
 <collision><geometry><sphere radius=".15"/></geometry></collision></link>
<joint name="axle" type="continuous"><parent link="chassis"/><child link="hull"/>
 <axis xyz="0 1 0"/><dynamics damping=".02"/></joint></robot>"""

# Actuators with internal states: a filter, and an integrator that reaches its limit.
FILTERED = (
    PLATE.replace(
        '<motor name="drive" joint="axle" gear="2"',
        '<general name="drive" joint="axle" gear="2" dyntype="filterexact" dynprm=".2"',
    )
    .replace(
        '<velocity name="fly" joint="spin" kv=".01"/>',
        '<intvelocity name="fly" joint="spin" kp=".05" kv=".001" actrange="-8 4"/>',
    )
    .replace('ctrl=".03 20"', 'ctrl=".12 20" act="-.02 1"')
)

# Asymmetric limits of a joint and of a motor; armature and damping of the motor.
LIMITED = (
    PLATE.replace(
        'gear="2" ctrlrange="-1 1"', 'gear="-2" ctrlrange="-.5 .5" armature=".0004" damping=".002"'
    )
    .replace('<joint name="axle"', '<joint name="axle" actuatorfrcrange="-.1 .04"')
    .replace('kv=".01"', 'kv=".01" forcerange="-.01 .06"')
    .replace('ctrl=".03 20"', 'ctrl="-.2 8"')
)

# Each with a change that alters the motion of the scene (control of the test).
ROBOTS = {
    "plate.xml": (PLATE, 'gear="2"', 'gear="-2"'),
    "gimbal.xml": (GIMBAL, 'coef="-1"', 'coef="1"'),
    "hull.urdf": (HULL, 'xyz="0.03 0', 'xyz="-0.03 0'),
    "filtered.xml": (FILTERED, 'dynprm=".2"', 'dynprm=".3"'),
    "limited.xml": (LIMITED, 'armature=".0004"', 'armature=".0005"'),
}


@pytest.fixture
def trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reads files in this process alone; that another one reads them first is tested apart."""
    monkeypatch.setattr(robot_file, "check_loads", lambda path: None)


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def own_steps(
    robot: RobotFile, times: Array, controls: Mapping[str, Callable[[float], float]] = {}
) -> Array:
    """Return contact points (n, 2) of the user's model with a stiffer contact and finer steps."""
    model = robot.model
    model.opt.timestep, model.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    model.opt.cone, model.opt.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 100
    model.opt.noslip_iterations, model.geom_solref[:, 0] = 3, 2e-3
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    points = []
    for t in times:
        while data.time < t - 1e-9:
            for name, control in controls.items():
                data.actuator(name).ctrl = control(data.time + model.opt.timestep / 2)
            mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        points.append(data.geom_xpos[robot.sphere, :2].copy())
    return np.array(points) - points[0]


@pytest.mark.usefixtures("trusted")
@pytest.mark.parametrize("name", ROBOTS)
def test_a_scene_rolls_like_the_original_model_with_fine_steps(name: str, tmp_path: Path) -> None:
    """For any root body, with gears, tendons, servos, filters, slides and springs.

    Measured 3.3e-6, 3.6e-5, 7.4e-6, 7.0e-5 and 2.1e-6 of the path, from the soft contact.
    """
    text, old, new = ROBOTS[name]
    path, times = written(tmp_path, name, text), np.linspace(0.0, 0.6, 13)
    points = own_steps(open_robot(path), times)

    def off(scene: rb.Scene) -> float:
        theory = rb.integrate(scene, times)
        away = np.linalg.norm(points - theory.contact_point, axis=1)
        return float(away.max() / theory.path_scale)

    assert off(rb.load_scene(str(path))) < 2.1e-4
    changed = written(tmp_path, f"changed_{name}", text.replace(old, new))
    assert off(rb.load_scene(changed)) > 1e-3


@pytest.mark.usefixtures("trusted")
def test_controls_may_vary_in_time(tmp_path: Path) -> None:
    """Through a filter and an integrator; measured 4.3e-5 of the path, like constant controls."""
    path, times = written(tmp_path, "filtered.xml", FILTERED), np.linspace(0.0, 0.6, 13)
    drive, fly = rb.Sine(amplitude=0.15, frequency=2.0), rb.Ramp(final=6.0, end=0.4)
    scene = scene_of_robot(
        path, {"robot": path.name, "duration": 0.6}, {"drive": drive, "fly": fly}
    )
    theory = rb.integrate(scene, times)
    points = own_steps(open_robot(path), times, {"drive": drive.rate, "fly": fly.rate})
    away = np.linalg.norm(points - theory.contact_point, axis=1)
    assert away.max() < 1.3e-4 * theory.path_scale
    pair = pair_of(scene, "balanced", times)
    assert pair.path_error < 1.1e-7  # measured 3.6e-8


NAMED = """robot = "mybot.xml"
title = "Mine"
rolling = "rubber"
keyframe = "tilted"
duration = 3
[controls]
drive = { kind = "sine", amplitude = 0.02, frequency = 0.5 }
fly = 15
"""


@pytest.mark.usefixtures("trusted")
def test_a_scene_file_may_refer_to_a_robot_file(tmp_path: Path) -> None:
    """It adds rolling model, duration and controls; controls given as arguments override it."""
    robot, path = written(tmp_path, "mybot.xml", PLATE), written(tmp_path, "mine.toml", NAMED)
    drive = rb.Sine(amplitude=0.02, frequency=0.5)
    for controls, fly in ((None, 15.0), ({"fly": 7.0}, 7.0)):
        table = {"robot": robot.name, "rolling": "rubber", "duration": 3}
        scene = scene_of_robot(robot, table, {"drive": drive, "fly": fly})
        assert rb.load_scene(path, controls) == replace(scene, name="mine", title="Mine")
    for change, line in {
        ('title = "Mine"', "gravity = 9"): "no key beside robot is called 'gravity'; there are",
        ("keyframe =", "keyfram ="): "no key beside robot is called 'keyfram'; did you mean",
        ("duration = 3", "duration = -3"): "duration must be positive and finite, not -3 s",
        ("fly = 15", "flies = 15"): "no actuator is called 'flies'; there are drive, fly",
        ("mybot.xml", "nobot.xml"): "nobot.xml: ParseXML: Error opening file",
    }.items():
        with pytest.raises(rb.InputError, match=re.escape(line)):
            rb.load_scene(written(tmp_path, "not.toml", NAMED.replace(*change)))
    with pytest.raises(rb.InputError, match=naming("controls file")):
        rb.load_scene("fig12", {"drive": 1.0})


@pytest.mark.usefixtures("trusted")
def test_a_motion_ends_when_a_joint_reaches_its_range(tmp_path: Path) -> None:
    """At the same time as in the original model; the engine ends with the equations.

    Measured difference 4.2e-4 s, from the soft contact of the original model.
    """
    text = PLATE.replace('ctrl=".03 20"', 'ctrl=".2 20"')
    free = rb.load_scene(str(written(tmp_path, "free.xml", text)))
    ranged = text.replace('name="axle"', 'name="axle" range="-90 90"')
    path = written(tmp_path, "ranged.xml", ranged)
    times = np.linspace(0.0, 0.3, 31)
    with pytest.warns(rb.SceneWarning, match=naming("axle -90 90~deg")) as caught:
        pair = pair_of(rb.load_scene(str(path)), "balanced", times)
    reached = float(str(caught[0].message).split("t = ")[1].split(" s,")[0])
    data = (robot := open_robot(path)).start()
    robot.model.opt.timestep, robot.model.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    while data.joint("axle").qpos < np.pi / 2:
        mujoco.mj_step(robot.model, data)
    assert reached == pytest.approx(data.time, abs=1.2e-3)
    assert pair.agrees
    assert len(pair.motion.times) == 1 + int(reached / 0.01)
    theory = pair.theory
    assert theory.reference_error < 1e-12
    assert np.array_equal(
        theory.contact_point, rb.integrate(free, times).contact_point[: len(theory.times)]
    )


@pytest.mark.usefixtures("trusted")
def test_shell_rolling_model_and_keyframe_are_chosen_by_name(tmp_path: Path) -> None:
    """Where several spheres could roll, and instead of what condim and the first keyframe say."""
    two = PLATE.replace("<freejoint/>", '<freejoint/><geom name="other" type="sphere" size=".15"/>')
    two = two.replace("<key ", '<key name="level" qpos="0 0 .15 1 0 0 0 0 0"/><key ')
    path = written(tmp_path, "two.xml", two)
    table = {"robot": path.name, "shell": "other"}
    scene = scene_of_robot(path, {**table, "rolling": "rubber", "keyframe": "tilted"})
    other = open_robot(path, "other")
    assert other.model.geom(other.sphere).name == "other"
    assert scene.rolling == "rubber"
    assert scene.start.attitude[1] > 0.09
    refused: list[tuple[dict[str, Any], str]] = [
        ({"shell": "ball"}, "spheres 0.15~m other ball hull"),
        ({"shell": "plate"}, "sphere 'plate'"),
        ({"keyframe": "up"}, "keyframe 'up' level tilted"),
        ({"controls": {"x": 1.0}}, "actuator 'x' drive"),
    ]
    for choice, facts in refused:
        with pytest.raises(rb.InputError, match=naming(facts)):
            scene_of_robot(path, table | choice)


WARNED = {
    ("hull.urdf", HULL): [
        "hull.urdf plane -0.15",
        "hull.urdf chassis <freejoint/>",
    ],
    ("wheel.xml", PLATE.replace('mass=".4" contype="0"', 'mass=".4"')): [
        "wheel.xml wheel shell"
    ],
    ("walls.xml", PLATE.replace("<worldbody>", '<worldbody><geom name="wall" size=".1" pos="2 0 0"'
     '/><geom size=".1" pos="3 0 0"/><geom size=".1" pos="4 0 0"/>', 1)): [
        "walls.xml wall world check",
    ],
    ("slick.xml", PLATE.replace('mass=".6"', 'mass=".6" condim="1" priority="1"')): [
        "slick.xml condim~1"
    ],
    ("high.xml", PLATE.replace('qpos="0 0 .15', 'qpos="0 0 .16')): [
        "high.xml 0.01~m plane"
    ],
    ("slips.xml", PLATE.replace("<key ", '<key qvel="1 0 0 0 0 0 0 0" ')): [
        "slips.xml 1~m/s"
    ],
    ("looks.xml", PLATE.replace("<worldbody>", '<asset><mesh name="look" file="no.stl"/></asset>'
     '<worldbody>', 1).replace('mass=".6"/>', 'mass=".6"/><geom type="mesh" mesh="look" mass="0" '
     'contype="0" conaffinity="0"/>', 1)): [
        "looks.xml no.stl",
    ],
    ("flat.urdf", HULL.replace('izz=".005"', 'izz=".009"').replace('name="hull">', 'name="hull">'
     '<mujoco><compiler balanceinertia="true"/></mujoco>', 1)): [
        "flat.urdf chassis balanceinertia 0.00533333",
    ],
    ("dense.urdf", HULL.replace('<inertial><mass value=".5"/>\n <inertia ixx=".0075" iyy=".0075" '
     'izz=".0075" ixy="0" ixz="0" iyz="0"/></inertial>', "")): [
        "dense.urdf hull inertial density",
    ],
}  # fmt: skip


def warned(file: tuple[str, str], folder: Path) -> list[str]:
    """Return the warnings of a robot's file."""
    path = written(folder, *file)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        rb.load_scene(str(path))
    return [str(each.message) for each in caught]


@pytest.mark.usefixtures("trusted")
@pytest.mark.parametrize(("file", "lines"), WARNED.items())
def test_implicit_choices_in_a_file_give_warnings(
    file: tuple[str, str], lines: list[str], tmp_path: Path
) -> None:
    """One for each thing that is added, replaced or ignored."""
    messages = warned(file, tmp_path)
    assert [facts for facts in lines if all(unnamed(facts, line) for line in messages)] == []


# Facts of a refusal: (old, new) text in PLATE that causes it.
TWO_JOINTS = (
    '<tendon><fixed name="two"><joint joint="axle" coef="1"/><joint joint="spin" coef="1"/>'
    "</fixed></tendon><actuator>"
)
REFUSED = {
    "sphere plane touch":
        ('type="sphere" size=".15"', 'type="box" size=".1 .1 .1"'),
    "sphere plane through":
        ('size="5 5 .1"', 'size="5 5 .1" contype="0" conaffinity="0"'),
    "spheres 0.15~m ball hull --shell":
        ("<freejoint/>", '<freejoint/><geom type="sphere" size=".15" pos="0 0 .1"/>'),
    "arm ball~joint":
        ("<freejoint/>",
         '<freejoint/><body name="arm"><joint type="ball"/><geom size=".1"/></body>'),
    "ball <freejoint/> joint~0 joint~1":
        ("<freejoint/>", '<joint type="slide" axis="1 0 0"/><joint axis="0 1 0"/>'),
    "equality":
        ("<actuator>", '<equality><joint joint1="axle" joint2="spin"/></equality><actuator>'),
    "medium": ("<worldbody>", '<option density="1.2"/><worldbody>'),
    "drive muscle PID DC":
        ('<motor name="drive"', '<general dyntype="muscle" name="drive"'),
    "drive time~constant 0~s":
        ('<motor name="drive"', '<general dyntype="filter" dynprm="0" name="drive"'),
    "axle 0~rad 0.0872665 1.0472":
        ('name="axle"', 'name="axle" range="5 60"'),
    "axle actuatorfrcrange":
        ("<mujoco>", '<mujoco><default><joint actuatorfrcrange="-1 1"/></default><actuator>'
         '<motor joint="axle"/></actuator>'),
    "flag gravity contacts":
        ("<worldbody>", '<option><flag gravity="disable"/></option><worldbody>'),
    "actuator delay": ('gear="2"', 'gear="2" delay=".01" nsample="5"'),
    "actuatorfrcrange armature tendon":
        ("<actuator>",
         '<tendon><fixed armature="1"><joint joint="spin" coef="1"/></fixed></tendon><actuator>'),
    "both armature damping joint":
        ("<actuator>", f'{TWO_JOINTS}<motor name="both" tendon="two" armature=".001"/>'),
    "two armature damping joint":
        ("<actuator>", f'{TWO_JOINTS}<motor name="two" tendon="two" damping=".001"/>'),
    "hull cart one~robot":
        ("<worldbody>", '<worldbody><body name="cart" pos="0 0 .1"><freejoint/>'
         '<geom size=".01" mass=".1"/></body>'),
    "no.stl rock":
        ("<worldbody>", '<asset><mesh name="look" file="no.stl"/></asset><worldbody>'
         '<body name="rock"><geom type="mesh" mesh="look"/></body>'),
    "line plate impossible~inertia 3~exceeds~1.5~+~1":
        ('<joint name="axle"',
         '<inertial pos="0 0 0" mass="1" diaginertia="1 1.5 3"/><joint name="axle"'),
    "line closed~at~the~end": ("</mujoco>", ""),
    "line plate mass <inertial>":
        ('<joint name="axle"', '<inertial pos="0 0 0" mass="0" diaginertia="1 1 1"/>'
         '<joint name="axle"'),
    "line axle axis": ('axis="0 1 0"', 'axis="0 0 0"'),
    "gravity plane 0~0~-9.81": ("<worldbody>", '<option gravity="0 0 9.81"/><worldbody>'),
    "axle stiffness -1": ('<joint name="axle"', '<joint stiffness="-1" name="axle"'),
}  # fmt: skip


def refusal(change: tuple[str, str], folder: Path) -> str:
    """Return the message with which the robot is refused after a change, but for the folder."""
    bare = PLATE[: PLATE.index("<keyframe>")] + "</mujoco>"
    assert change[0] in bare
    path = written(folder, "mybot.xml", bare.replace(*change))
    with pytest.raises(rb.InputError) as refused:
        rb.load_scene(str(path))
    return str(refused.value).removeprefix(f"{folder}/")


@pytest.mark.usefixtures("trusted")
def test_an_impossible_inertia_of_a_urdf_is_refused_with_its_moments(tmp_path: Path) -> None:
    """MuJoCo gives no line of a URDF."""
    path = tmp_path / "hull.urdf"
    path.write_text(HULL.replace('izz=".005"', 'izz=".008"'))
    with pytest.raises(rb.InputError, match=naming("chassis 0.008~exceeds~0.004~+~0.003")) as error:
        open_robot(path)
    assert ": :" not in str(error.value)


@pytest.mark.parametrize(("facts", "change"), REFUSED.items())
def test_robots_that_cannot_be_compared_are_refused_in_one_line(
    facts: str, change: tuple[str, str], tmp_path: Path
) -> None:
    """With the name of the file and the remedy."""
    message = refusal(change, tmp_path)
    assert message.startswith("mybot.xml: ")
    assert unnamed(facts, message) == []
