"""A whole robot's tables in a scene file, a link in URDF, and the line that refuses a robot."""

from collections.abc import Callable

import pytest

import robotball as rb

Load = Callable[..., rb.Scene]

SHELL = """
[shell]
radius = 0.2
mass = 1.0
thickness = 0.004
axis = [0, 1, 0]
"""
FRAME = """
[frame]
mass = 1.0
inertia = [0.002, 0.002, 0.003]
"""
PENDULUM = """
[[pendulum]]
axis = [1, 0, 0]
pivot = [0, 0, -0.02]
"""
BOB = """
mass = 1.5
inertia = [0.0009, 0.0009, 0.0009]
centre = [0, 0, -0.11]
"""
START = """
[start]
attitude = [1, 0, 0, 0]
angular_velocity = [0, 0, 0]
"""
HEAD = 'title = "mine"\nrolling = "classical"\nduration = 5.0\n'

URDF = """
<robot name="r">
  <link name="base"/>
  <link name="arm">
    <inertial>
      <origin xyz="0.01 0.02 -0.03" rpy="0.3 -0.2 0.5"/>
      <mass value="0.8"/>
      <inertia ixx="0.002" ixy="0.0001" ixz="0" iyy="0.003" iyz="-0.0002" izz="0.0025"/>
    </inertial>
  </link>
  <link name="bob">
    <inertial>
      <mass value="0.5"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/>
    </inertial>
  </link>
  <joint name="hinge" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="weld" type="fixed">
    <parent link="arm"/><child link="bob"/><origin xyz="0 0 -0.1" rpy="0 0.4 0.1"/>
  </joint>
</robot>
"""


def refused(load: Load, tables: dict[str, str]) -> str:
    """The one line that a scene of these tables gives, without the file's name."""
    with pytest.raises(rb.InputError) as caught:
        load(**tables)
    message = str(caught.value)
    assert "\n" not in message
    return message.split("mine.toml: ")[1]
