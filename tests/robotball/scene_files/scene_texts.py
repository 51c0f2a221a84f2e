"""Texts of scene files: an edited catalog scene, and a robot assembled from tables."""

from pathlib import Path

import robotball as rb
from robotball.scene_files.scene_file import CATALOG, read_scene

FIG12 = (CATALOG / "fig12.toml").read_text()
SECTION = "section = { L = 3.6, l = 0.6, g = 0.0, f = 25.0 }"

HEAD = 'title = "mine"\nrolling = "classical"\nduration = 5.0\n'
SHELL = "[shell]\nradius = 0.2\nmass = 1.0\nthickness = 0.004\naxis = [0, 1, 0]\n"
FRAME = "[frame]\nmass = 1.0\ninertia = [0.002, 0.002, 0.003]\n"
PENDULUM = "[[pendulum]]\naxis = [1, 0, 0]\npivot = [0, 0, -0.02]\n"
BOB = "mass = 1.5\ninertia = [0.0009, 0.0009, 0.0009]\ncentre = [0, 0, -0.11]\n"
START = "[start]\nattitude = [1, 0, 0, 0]\nangular_velocity = [0, 0, 0]\n"

URDF = """<robot name="r"><link name="base"/>
<link name="arm"><inertial><origin xyz="0.01 0.02 -0.03" rpy="0.3 -0.2 0.5"/><mass value="0.8"/>
 <inertia ixx="0.002" ixy="0.0001" ixz="0" iyy="0.003" iyz="-0.0002" izz="0.0025"/></inertial>
</link><link name="bob"><inertial><mass value="0.5"/>
 <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
 <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="weld" type="fixed"><parent link="arm"/><child link="bob"/>
 <origin xyz="0 0 -0.1" rpy="0 0.4 0.1"/></joint></robot>"""

# The shell has the free joint; a plate on an axle with a geared motor, a wheel with a servo.
PLATE = """<mujoco><worldbody><geom type="plane" size="5 5 .1"/>
<body name="ball" pos="0 0 .15"><freejoint/><geom name="hull" type="sphere" size=".15" mass=".6"/>
 <body name="plate"><joint name="axle" axis="0 1 0" damping=".01"/>
  <geom type="box" size=".06 .05 .004" pos="0 0 -.03" mass=".8" contype="0" conaffinity="0"/>
  <body name="wheel" pos="0 0 -.05"><joint name="spin" axis="0 0 1" damping="1e-4"/>
   <geom type="cylinder" size=".04 .008" mass=".4" contype="0" conaffinity="0"/></body>
 </body></body></worldbody>
<actuator><motor name="drive" joint="axle" gear="2" ctrlrange="-1 1"/>
 <velocity name="fly" joint="spin" kv=".01"/></actuator>
<keyframe><key name="tilted" qpos="0 0 .15 1 .1 0 0 0 0" ctrl=".03 20"/></keyframe></mujoco>"""


def edited(old: str, new: str, text: str = FIG12) -> str:
    """Return the text with its only occurrence of `old` replaced."""
    assert text.count(old) == 1
    return text.replace(old, new)


def robot(
    head: str = "", shell: str = SHELL, frame: str = FRAME, rest: str = "", start: str = START
) -> str:
    """Return a scene file made of these tables and the default ones of a robot."""
    return HEAD + head + shell + frame + rest + start


def scene_of(text: str, folder: Path = Path()) -> rb.Scene:
    """Return the scene of a file with this text in this folder."""
    return read_scene(folder / "mine.toml", text)
