"""Scene files of any robot: bodies and hinges told in every way, and what is refused."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.files.mjcf import solid_of_mjcf
from robotball.files.urdf import solid_of_urdf

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


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Loads a scene made of these tables; those that are not told are a whole robot's."""

    def load(
        head: str = "", shell: str = SHELL, frame: str = FRAME, rest: str = "", start: str = START
    ) -> rb.Scene:
        path = tmp_path / "mine.toml"
        path.write_text(HEAD + head + shell + frame + rest + start)
        return rb.load_scene(path)

    return load


# Bodies ------------------------------------------------------------------------------------


def test_a_shell_is_told_by_its_wall(load: Load) -> None:
    """By thickness and mass, or density; parts on it move its centre of mass along the axis."""
    by_mass = load().ball.shell
    volume = 4 / 3 * np.pi * (0.2**3 - 0.196**3)
    dense = SHELL.replace("mass = 1.0", f"density = {1 / volume!r}")
    by_density = load(shell=dense).ball.shell
    assert by_density.mass == pytest.approx(1.0, rel=1e-14)
    assert by_density.axial_inertia == pytest.approx(by_mass.axial_inertia, rel=1e-14)
    weight = '[[shell.part]]\nkind = "disc"\nmass = 0.5\nradius = 0.03\ncentre = [0, -0.15, 0]\n'
    weighted = load(shell=SHELL + weight).ball.shell
    assert weighted.mass == 1.5
    assert weighted.offset == pytest.approx(-0.05, rel=1e-14)
    # Steiner, by hand: the wall and the disc about (0, -0.05, 0).
    across = by_mass.axial_inertia + 0.05**2 + 0.5 * (0.03**2 / 4 + 0.1**2)
    assert weighted.axial_inertia == pytest.approx(by_mass.axial_inertia + 0.5 * 0.03**2 / 2)
    assert weighted.transverse_inertia == pytest.approx(across, rel=1e-14)


def test_a_rotors_parts_lie_about_its_axis(load: Load) -> None:
    """A disc without an axis has the rotor's; the centre is where the parts' is."""
    disc = '[[rotor]]\naxis = [0, 0, 2]\npart = [{ kind = "disc", mass = 0.3, radius = 0.05, '
    rotor = load(rest=disc + "centre = [0.02, 0, 0] }]\n").ball.rotors[0]
    assert rotor.mass == 0.3
    assert rotor.axial_inertia == pytest.approx(0.3 * 0.05**2 / 2, rel=1e-15)
    np.testing.assert_array_equal(rotor.centre, [0.02, 0.0, 0.0])


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


def test_a_link_is_mujocos_body_of_the_same_file(tmp_path: Path) -> None:
    """With what a fixed joint holds on it. Measured 3e-17 of 0.007 kg m²: rounding."""
    path = tmp_path / "arm.urdf"
    path.write_text(URDF)
    ours, theirs = solid_of_urdf(path, "arm"), solid_of_mjcf(path, "arm")
    assert ours.mass == pytest.approx(1.3, rel=1e-15)
    np.testing.assert_allclose(ours.centre, theirs.centre, atol=1e-16)
    np.testing.assert_allclose(ours.inertia, theirs.inertia, atol=2e-16)


def test_any_body_is_taken_from_a_file(load: Load, tmp_path: Path) -> None:
    """Laid at its origin and attitude: a quarter turn about x takes y to z."""
    (tmp_path / "arm.urdf").write_text(URDF)
    arm = solid_of_urdf(tmp_path / "arm.urdf", "arm")
    half = repr(np.sqrt(0.5).item())
    laid = f"origin = [0, 0, 0.05], attitude = [{half}, {half}, 0, 0] }}\n"
    hung = load(rest=PENDULUM + 'urdf = { file = "arm.urdf", link = "arm", ' + laid)
    x, y, z = arm.centre
    centre = hung.ball.pendulums[0].centre
    np.testing.assert_allclose(centre, [x, -z, y + 0.05], atol=1e-16)
    moments = np.linalg.eigvalsh(hung.ball.pendulums[0].inertia)
    np.testing.assert_allclose(moments, np.linalg.eigvalsh(arm.inertia), rtol=1e-13)


def test_a_pendulum_that_swings_out_of_the_shell_is_told(load: Load) -> None:
    """It hangs at the centre, and at half a turn it is twice the pivot's height away."""
    hung = PENDULUM.replace("-0.02", "0.12") + BOB.replace("-0.11", "0.0")
    with pytest.warns(rb.SceneWarning, match=r"pendulum1 has mass outside the shell: at 0\.2419 m"):
        load(rest=hung)


# Hinges ------------------------------------------------------------------------------------


def test_hinges_are_moved_as_told(load: Load) -> None:
    """Motors, commands, and what the hinges start with."""
    scene = load(
        frame=FRAME + 'drive = "servo"\nkv = 2.0\nrate = 3.0\narmature = 0.01\n',
        rest=PENDULUM + BOB + 'drive = "position"\nkp = 6.0\nkd = 0.3\nangle = 0.5\n'
        "torque_limit = 0.7\ninitial_angle = 0.2\n"
        + PENDULUM + BOB + 'drive = "torque"\ntorque = [0.1, { kind = "sine", amplitude = 0.2, '
        "frequency = 1.0 }]\ninitial_rate = -1.0\n"
        + PENDULUM + BOB + 'drive = "free"\ndamping = 0.01\nstiffness = 0.3\nrest = 0.5\n'
        + PENDULUM + BOB + "rate = 4.0\n",
    )  # fmt: skip
    frame, position, torque, free, given = scene.hinges
    assert frame.motor == rb.Servo(2.0, None, 0.01)
    assert position.motor == rb.PositionServo(6.0, 0.3, 0.7)
    assert torque.motor == rb.Torque()
    assert free.motor == rb.Free(0.01, 0.3, 0.5)
    assert given.motor is None
    assert position.command.rate(1.0) == 0.5
    assert torque.command.rate(0.25) == pytest.approx(0.3)
    assert [hinge.angle for hinge in scene.hinges] == [0.0, 0.2, 0.0, 0.0, 0.0]
    assert [hinge.rate for hinge in scene.hinges] == [3.0, 0.0, -1.0, 0.0, 4.0]


def test_samples_are_read_from_a_table_of_numbers(load: Load, tmp_path: Path) -> None:
    """With a line of names, comments, and commas, semicolons or spaces between them."""
    csv = "time,rate\n0,1\n2.5,2\n5,0.5\n"
    for text in (csv, csv.replace(",", "; "), csv.replace(",", " "), "# note\n" + csv):
        (tmp_path / "rate.csv").write_text(text)
        scene = load(frame=FRAME + 'rate = { kind = "samples", file = "rate.csv" }\n')
        assert scene.frame_rate == rb.Samples(times=(0.0, 2.5, 5.0), values=(1.0, 2.0, 0.5))


def test_a_plane_may_be_inclined_and_rough(load: Load) -> None:
    """Gravity's direction is of any length; friction is told as it is."""
    scene = load("gravity_direction = [0.3, 0, -0.4]\n[friction]\nsliding = 0.8\nrolling = 1e-3\n")
    assert scene.gravity_direction == pytest.approx((0.6, 0.0, -0.8), abs=1e-16)
    assert (scene.friction.sliding, scene.friction.torsional) == (0.8, None)
    assert scene.friction.rolling == 1e-3


def test_an_angular_velocity_starts_any_robot(load: Load) -> None:
    """It is the one that the start's momentum gives back, whatever turns at the start."""
    start = START.replace("[0, 0, 0]", "[1.0, -2.0, 0.5]")
    turning = "initial_angle = 0.4\ninitial_rate = 3.0\ndrive = 'free'\n"
    scene = load(rest=PENDULUM + BOB + turning, start=start)
    # Measured 1e-15: rounding.
    omega = scene.angular_velocity_at(scene.start)
    np.testing.assert_allclose(omega, [1.0, -2.0, 0.5], atol=1e-14)


# What is refused ---------------------------------------------------------------------------

BODIES: dict[str, tuple[dict[str, str], str]] = {
    "a part outside": (
        {"frame": '[frame]\npart = [{ kind = "box", mass = 1, size = [0.3, 0.3, 0.1] }]\n'},
        "frame reaches 0.217945 m from the sphere's centre, beyond the shell's radius 0.2 m; make "
        "it smaller, move it, or make the shell larger",
    ),
    "a part without a mass": (
        {"frame": '[frame]\npart = [{ kind = "sphere", mass = 1, radius = 0.1 }, '
         '{ kind = "box", size = [0.1, 0.1, 0.1] }]\n'},
        "frame.part2: a box needs a mass [kg] or a density [kg/m³]",
    ),
    "a point alone": (
        {"rest": PENDULUM + 'part = [{ kind = "point", mass = 1, centre = [0, 0, -0.1] }]\n'},
        "pendulum1's parts lie on one line, about which nothing resists turning; give a rod its "
        "radius, or a point a sphere's size",
    ),
    "an axis without a direction": (
        {"rest": PENDULUM.replace("[1, 0, 0]", "[0, 0, 0]") + BOB},
        "pendulum1's axis must have a length and a direction, unlike [0.0, 0.0, 0.0]",
    ),
    "parts and numbers": (
        {"frame": FRAME + 'part = [{ kind = "sphere", mass = 1, radius = 0.1 }]\n'},
        "frame gives mass, inertia and part; it takes mass and inertia, or part, or mjcf, or urdf",
    ),
    "no body": (
        {"rest": PENDULUM},
        "pendulum1 gives nothing; it takes mass and inertia, or part, or mjcf, or urdf",
    ),
    "no parts": ({"frame": "[frame]\npart = []\n"}, "frame.part is empty"),
    "no mass": ({"frame": "[frame]\ninertia = [1, 1, 1]\n"}, "frame: key 'mass' is missing"),
    "a shell without a wall": (
        {"shell": SHELL.replace("thickness = 0.004\n", "")},
        "shell: key 'thickness' is missing, or 'inertia' instead of it",
    ),
    "density without thickness": (
        {"shell": SHELL.replace("thickness = 0.004\n", "").replace("mass", "density")},
        "shell: a density needs the wall's thickness [m] as well",
    ),
    "two inertias": (
        {"shell": SHELL + 'inertia = "thin"\n'},
        "shell takes thickness or inertia, not both",
    ),
    "a shell weighted beside its axis": (
        {"shell": SHELL + '[[shell.part]]\nkind = "sphere"\nmass = 1\nradius = 0.01\n'
         "centre = [0.1, 0, 0]\n"},
        "shell's centre of mass is 0.05 m off its axis; what is not symmetric about the axis "
        "belongs to the frame",
    ),
    "a shell that is no gyroscope": (
        {"shell": SHELL + '[[shell.part]]\nkind = "box"\nmass = 1\nsize = [0.1, 0.1, 0.02]\n'},
        "shell is not symmetric about its axis: its inertia is off by 0.0004 of 0.0",
    ),
    "a rotor that is no gyroscope": (
        {"rest": "[[rotor]]\naxis = [0, 0, 1]\n"
         'part = [{ kind = "box", mass = 1, size = [0.1, 0.05, 0.02] }]\n'},
        "rotor1 is not symmetric about its axis: its inertia is off by 0.0003125 of 0.00104167 "
        "kg m²; such a body is a pendulum",
    ),
    "two moments": (
        {"frame": "[frame]\nmass = 1\ninertia = [1, 1]\n"},
        "frame.inertia takes three moments, or three rows of three",
    ),
    "one table instead of many": (
        {"rest": "[pendulum]\naxis = [1, 0, 0]\n"},
        "pendulum: a scene may have many; write [[pendulum]] for each",
    ),
    "an unknown part": (
        {"frame": '[frame]\npart = [{ kind = "bax", mass = 1 }]\n'},
        "frame.part1.kind: unknown value 'bax'; it takes point, sphere, box",
    ),
    "a part's unknown key": (
        {"frame": '[frame]\npart = [{ kind = "sphere", mass = 1, raduis = 1 }]\n'},
        "frame.part1: unknown key 'raduis'; did you mean 'radius'?",
    ),
    "a file that is not there": (
        {"frame": '[frame]\nurdf = { file = "no.urdf", link = "arm" }\n'},
        "no.urdf: No such file or directory",
    ),
    "a plane that goes up": (
        {"head": "gravity_direction = [1, 0, 0.5]\n"},
        "gravity_direction must press the ball on the plane: its Z is 0.447214, and must be",
    ),
    "no gravity": (
        {"head": "gravity_direction = [0, 0, 0]\n"},
        "gravity_direction must have a length and a direction",
    ),
    "no friction": (
        {"head": "[friction]\nsliding = 0\n"},
        "the sliding friction must be positive and finite, not 0",
    ),
}  # fmt: skip


def refused(load: Load, tables: dict[str, str]) -> str:
    """The one line that a scene of these tables gives, without the file's name."""
    with pytest.raises(rb.InputError) as caught:
        load(**tables)
    message = str(caught.value)
    assert "\n" not in message
    return message.split("mine.toml: ")[1]


@pytest.mark.parametrize("name", BODIES)
def test_bodies_that_cannot_be_are_refused(load: Load, name: str) -> None:
    """In a line with the key, the value and what to do."""
    tables, words = BODIES[name]
    assert words in refused(load, tables)


HINGES: dict[str, tuple[str, str]] = {
    "no gain": ('drive = "servo"\n', "drive = \"servo\" needs the key 'kv' [N m s/rad]"),
    "no position gain": (
        'drive = "position"\nangle = 0\n',
        "drive = \"position\" needs the key 'kp' [N m/rad]",
    ),
    "no angle": (
        'drive = "position"\nkp = 1\n',
        "drive = \"position\" needs the key 'angle' [rad]",
    ),
    "no torque": ('drive = "torque"\n', "drive = \"torque\" needs the key 'torque' [N m]"),
    "a gain of nothing": (
        'drive = "servo"\nkv = 0\n',
        "a servo's gain must be positive and finite, not 0 N m s/rad",
    ),
    "a negative gain": (
        'drive = "position"\nkp = -6\nangle = 1\n',
        "a position servo's gain must be positive and finite, not -6 N m/rad",
    ),
    "a negative damping": (
        'drive = "free"\ndamping = -1\n',
        "a free hinge's damping, where it is not 0, must be positive and finite, not -1",
    ),
    "another motor's gain": (
        'drive = "servo"\nkv = 1\nkp = 1\n',
        'kp belongs to drive = "position", not to "servo"',
    ),
    "a gain of no motor": ("kv = 1\n", 'kv belongs to drive = "servo", not to "prescribed"'),
    "a limit of no motor": (
        "torque_limit = 1\n",
        'torque_limit belongs to drive = "servo" or "position", not to "prescribed"',
    ),
    "a rate of a position servo": (
        'drive = "position"\nkp = 1\nangle = 1\nrate = 2\n',
        'rate belongs to drive = "prescribed" or "servo", not to "position"',
    ),
    "a start beside the rate": (
        "rate = 1\ninitial_rate = 2\n",
        'initial_rate belongs to drive = "servo" or "position" or "torque" or "free", not to',
    ),
    "an unknown drive": (
        'drive = "servoo"\n',
        "drive: unknown value 'servoo'; it takes free, position, prescribed, servo, torque",
    ),
    "an unknown rate": (
        'rate = { kind = "rmap", final = 1, end = 1 }\n',
        "rate.kind: unknown value 'rmap'; it takes ramp, sine, samples",
    ),
    "a rate without a kind": (
        "rate = { final = 1, end = 1 }\n",
        "rate: key 'kind' is missing; it takes ramp, sine, samples",
    ),
    "words": ('rate = "fast"\n', "rate: it must be a number or a table or a list, not text"),
    "a sum of nothing": ("rate = []\n", "a sum needs at least one rate"),
    "samples too short": (
        'rate = { kind = "samples", times = [0, 3], values = [1, 2] }\n',
        "samples from t = 0 to 3 s do not reach over the run, from 0 to 5 s",
    ),
    "half the samples": (
        'rate = { kind = "samples", times = [0, 5] }\n',
        "samples: key 'values' is missing, or 'file' instead",
    ),
    "samples twice": (
        'rate = { kind = "samples", times = [0, 5], values = [1, 2], file = "x.csv" }\n',
        "samples take a file, or times and values, not both",
    ),
    "samples of no file": (
        'rate = { kind = "samples", file = "x.csv" }\n',
        "x.csv: No such file or directory",
    ),
    "samples in other units": (
        'rate = { kind = "samples", file = "rpm.csv" }\n',
        "rpm.csv: rate is in rpm; samples take rad/s, rad, N m",
    ),
    "samples of two hinges": (
        'rate = { kind = "samples", file = "many.csv" }\n',
        "many.csv: samples take two columns, time and value, not t, a, b",
    ),
    "samples without numbers": (
        'rate = { kind = "samples", file = "bad.csv" }\n',
        "bad.csv: line 3: rate is 'x', and must be a number",
    ),
}


@pytest.mark.parametrize("body", ["frame", "pendulum1"])
@pytest.mark.parametrize("name", HINGES)
def test_hinges_that_cannot_be_are_refused(
    load: Load, tmp_path: Path, name: str, body: str
) -> None:
    """With the body whose hinge it is."""
    (tmp_path / "bad.csv").write_text("t,rate\n0,1\n1,x\n")
    (tmp_path / "rpm.csv").write_text("t,rate\ns,rpm\n0,1\n5,2\n")
    (tmp_path / "many.csv").write_text("t,a,b\n0,1,2\n5,2,3\n")
    keys, words = HINGES[name]
    tables = {"frame": FRAME + keys} if body == "frame" else {"rest": PENDULUM + BOB + keys}
    message = refused(load, tables)
    assert words in message
    assert message.startswith(body)


BAD_URDF: dict[str, tuple[str, str]] = {
    "no link": (URDF.replace('"arm"', '"leg"'), "no link is called 'arm'; there are base, leg"),
    "one that moves": (
        URDF.replace('"fixed"', '"continuous"'),
        "link 'arm' carries 'bob', which moves on it; take each as a body of its own",
    ),
    "no XML": ("<robot>", "no XML: "),
    "no robot": ("<mujoco/>", "no URDF: its root is <mujoco>, not <robot>"),
    "no number": (URDF.replace('"0.8"', '"heavy"'), "inertial: value takes 1 finite numbers"),
    "no mass": (URDF.replace('"0.8"', '"0"'), "link 'arm''s inertial has no mass: 0 kg"),
    "a circle": (
        URDF.replace('<child link="bob"/>', '<child link="arm"/>'),
        "link 'arm' hangs on itself",
    ),
    "a far link": (URDF.replace('<child link="bob"/>', '<child link="bab"/>'), "did you mean bob"),
}


@pytest.mark.parametrize("name", BAD_URDF)
def test_a_urdf_file_that_cannot_be_used_is_refused(tmp_path: Path, name: str) -> None:
    """In a line that names the file."""
    text, words = BAD_URDF[name]
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    with pytest.raises(rb.InputError, match=r"arm\.urdf: ") as caught:
        solid_of_urdf(path, "arm")
    assert words in str(caught.value)
