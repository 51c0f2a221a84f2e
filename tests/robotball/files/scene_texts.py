"""Scene files as texts, edited or made of tables, and the line that refuses one."""

from collections.abc import Callable
from pathlib import Path

import pytest

import robotball as rb
from robotball.files.scene_file import CATALOG

FIG12 = (CATALOG / "fig12.toml").read_text()
CLASSICAL = (CATALOG / "classical_regular.toml").read_text()
SECTION = "section = { L = 3.6, l = 0.6, g = 0.0, f = 25.0 }"

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

Write = Callable[[str], Path]
Load = Callable[..., rb.Scene]


def edited(old: str, new: str, text: str = FIG12) -> str:
    """The text with its one occurrence of `old` replaced."""
    assert text.count(old) == 1
    return text.replace(old, new)


def with_start(start: str, text: str = FIG12) -> str:
    return edited(SECTION, start, text)


def refusal(path: Path | str) -> str:
    """The message of the InputError that loading gives: one line, which names the file."""
    with pytest.raises(rb.InputError) as caught:
        rb.load_scene(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


def robot(
    head: str = "", shell: str = SHELL, frame: str = FRAME, rest: str = "", start: str = START
) -> str:
    """A scene made of these tables; those that are not given are a whole robot's."""
    return HEAD + head + shell + frame + rest + start
