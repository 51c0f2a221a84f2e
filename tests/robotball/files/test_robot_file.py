"""A user's MJCF or URDF robot, as it is: its own model in fine steps rolls as its scene does."""

import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.files import robot_file
from robotball.files.robot_file import RobotFile, open_robot
from robotball.rotations import Array
from validation import compare

# The free joint is the shell's; a plate on an axle with a geared motor, a wheel with a servo.
PLATE = """<mujoco><worldbody><geom type="plane" size="5 5 .1"/>
<body name="ball" pos="0 0 .15"><freejoint/><geom type="sphere" size=".15" mass=".6"/>
 <body name="plate"><joint name="axle" axis="0 1 0" damping=".01"/>
  <geom type="box" size=".06 .05 .004" pos="0 0 -.03" mass=".8" contype="0" conaffinity="0"/>
  <body name="wheel" pos="0 0 -.05"><joint name="spin" axis="0 0 1" damping="1e-4"/>
   <geom type="cylinder" size=".04 .008" mass=".4" contype="0" conaffinity="0"/></body>
 </body></body></worldbody>
<actuator><motor name="drive" joint="axle" gear="2" ctrlrange="-1 1"/>
 <velocity name="fly" joint="spin" kv=".01"/></actuator>
<keyframe><key qpos="0 0 .15 1 .1 0 0 0 0" ctrl=".03 20"/></keyframe></mujoco>"""

# The free joint is an inner body's. The shell is on a gimbal of it, with a weight glued on; one
# motor pulls on both of the gimbal's joints, and another slides a mass.
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

ROBOTS = {"plate.xml": PLATE, "gimbal.xml": GIMBAL, "hull.urdf": HULL}


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def own_steps(robot: RobotFile, times: Array) -> Array:
    """The contact point (n, 2) of the user's own model, its contact stiffer and its steps finer."""
    model = robot.model
    model.opt.timestep, model.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    model.opt.cone, model.opt.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 100
    model.opt.noslip_iterations, model.geom_solref[:, 0] = 3, 2e-3
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    else:
        data.qpos[2] = 0.15
    points = []
    for t in times:
        while data.time < t - 1e-9:
            mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        points.append(data.geom_xpos[robot.sphere, :2].copy())
    return np.array(points) - points[0]


# A change of a robot that its own model does not have, and the scene then rolls elsewhere.
CHANGED = {
    "plate.xml": ('gear="2"', 'gear="-2"'),
    "gimbal.xml": ('coef="-1"', 'coef="1"'),
    "hull.urdf": ('xyz="0.03 0', 'xyz="-0.03 0'),
}


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.filterwarnings("ignore::robotball.errors.SceneWarning")
def test_a_robots_scene_rolls_as_its_own_model_in_fine_steps(name: str, tmp_path: Path) -> None:
    """Wherever the file has its root, with gears, tendons, servos, slides and springs.

    Measured 3.3e-6, 3.6e-5 and 7.4e-6 of the path; the contact's softness dominates.
    """
    path, times = written(tmp_path, name, ROBOTS[name]), np.linspace(0.0, 0.6, 13)
    points = own_steps(open_robot(path), times)

    def off(scene: rb.Scene) -> float:
        theory = rb.integrate(scene, times)
        away = np.linalg.norm(points - theory.contact_point, axis=1)
        return float(away.max() / theory.path_scale)

    assert off(rb.load_scene(str(path))) < 1.1e-4
    changed = written(tmp_path, f"changed_{name}", ROBOTS[name].replace(*CHANGED[name]))
    assert off(rb.load_scene(str(changed))) > 1e-3


@pytest.fixture
def trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reads files in this process alone; that another one reads them first is tested apart."""
    monkeypatch.setattr(robot_file, "check_loads", lambda path: None)


@pytest.mark.usefixtures("trusted")
@pytest.mark.parametrize("preset", ["balanced", "accurate"])
def test_the_recipe_rolls_a_users_robot_right(preset: str, tmp_path: Path) -> None:
    """Measured 1.7e-8 and 2.9e-11 over 3 s: RK4's error, as of any robot."""
    scene = rb.load_scene(str(written(tmp_path, "gimbal.xml", GIMBAL)))
    agreement = compare(scene, preset, np.linspace(0.0, 3.0, 61))
    assert agreement.path_error is not None
    assert agreement.path_error < {"balanced": 5.2e-8, "accurate": 8.7e-11}[preset]
    assert agreement.faults == ()


WARNED = {
    ("hull.urdf", HULL): [
        "hull.urdf: the file has no plane; one is added at height 0",
        "hull.urdf: chassis hangs on the world, where it cannot roll; it gets a free joint",
        "hull.urdf: it starts 0.15 m in the plane; the equations start on it",
    ],
    ("high.xml", PLATE.replace('qpos="0 0 .15', 'qpos="0 0 .16')): [
        "high.xml: it starts 0.01 m above the plane; the equations start on it"
    ],
    ("slips.xml", PLATE.replace("<key ", '<key qvel="1 0 0 0 0 0 0 0" ')): [
        "slips.xml: its contact point starts at 1 m/s; the equations start without slipping"
    ],
    ("ranged.xml", PLATE.replace('name="axle"', 'name="axle" range="-90 90"')): [
        "ranged.xml: axle: the equations have no range, and let the joint go on"
    ],
    ("dense.urdf", HULL.replace('<inertial><mass value=".5"/>\n <inertia ixx=".0075" iyy=".0075" '
     'izz=".0075" ixy="0" ixz="0" iyz="0"/></inertial>', "")): [
        "dense.urdf: hull has no inertial; its geoms give it a mass by their density",
    ],
}  # fmt: skip


@pytest.mark.usefixtures("trusted")
@pytest.mark.parametrize(("file", "lines"), WARNED.items())
def test_what_a_file_does_in_silence_is_warned_of(
    file: tuple[str, str], lines: list[str], tmp_path: Path
) -> None:
    """What is added, what the equations begin with instead, and what they leave out."""
    path = written(tmp_path, *file)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        rb.load_scene(str(path))
    said = [str(each.message) for each in caught]
    assert [line for line in lines if line not in said] == []


# A line of a refusal, and what is put in place of what in PLATE for it.
REFUSED = {
    "no sphere can touch the plane":
        ('type="sphere" size=".15"', 'type="box" size=".1 .1 .1"'),
    "the sphere passes through the plane":
        ('size="5 5 .1"', 'size="5 5 .1" contype="0" conaffinity="0"'),
    "several spheres of 0.15 m could roll: ball, ball":
        ("<freejoint/>", '<freejoint/><geom type="sphere" size=".15" pos="0 0 .1"/>'),
    "arm has a ball joint; take three hinges":
        ("<freejoint/>",
         '<freejoint/><body name="arm"><joint type="ball"/><geom size=".1"/></body>'),
    "ball hangs on the world by joints that are no free one":
        ("<freejoint/>", '<joint type="slide" axis="1 0 0"/><joint axis="0 1 0"/>'),
    "pull acts on apart, which is not inside the robot":
        ("</worldbody>\n<actuator>",
         '<body><joint name="apart"/><geom size=".1"/></body></worldbody><actuator>'
         '<motor name="pull" joint="apart"/>'),
    "the sphere slides without friction": ('mass=".6"', 'mass=".6" condim="1" priority="1"'),
    "an equality constraint is not supported":
        ("<actuator>", '<equality><joint joint1="axle" joint2="spin"/></equality><actuator>'),
    "the drag of a medium": ("<worldbody>", '<option density="1.2"/><worldbody>'),
    "drive: an actuator with a state of its own is not supported":
        ('<motor name="drive"', '<general dyntype="filter" dynprm=".1" name="drive"'),
    "fly: forcerange -1 2 is not the same both ways":
        ('kv=".01"', 'kv=".01" forcerange="-1 2"'),
    "the file has 2 planes":
        ("<worldbody>", '<worldbody><geom type="plane" size="1 1 1" pos="0 0 -1"/>'),
    "XML parse error": ("</mujoco>", ""),
}  # fmt: skip


@pytest.mark.usefixtures("trusted")
@pytest.mark.parametrize(("message", "change"), REFUSED.items())
def test_what_cannot_be_compared_is_refused_in_one_line(
    message: str, change: tuple[str, str], tmp_path: Path
) -> None:
    """With the file's name, and what would help."""
    bare = PLATE[: PLATE.index("<keyframe>")] + "</mujoco>"
    assert change[0] in bare
    path = written(tmp_path, "mybot.xml", bare.replace(*change))
    with pytest.raises(rb.InputError) as refusal:
        rb.load_scene(str(path))
    line = str(refusal.value)
    assert line.startswith(f"{path}: ")
    assert message in line


def test_a_file_that_takes_too_much_is_refused(tmp_path: Path) -> None:
    """It is read in a process of its own first; a device, which has no end, not at all."""
    hungry = PLATE.replace("<mujoco>", '<mujoco><size memory="100G"/>')
    with pytest.raises(rb.InputError, match="it takes more than 500 MB to load"):
        rb.load_scene(str(written(tmp_path, "hungry.xml", hungry)))
    (tmp_path / "zero.xml").symlink_to("/dev/zero")
    with pytest.raises(rb.InputError, match="it is no regular file"):
        rb.load_scene(str(tmp_path / "zero.xml"))
