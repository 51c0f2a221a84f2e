"""Scene files: bodies, hinges, every form of a start, the schema and docs/scene.md."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import jsonschema
import msgspec
import numpy as np
import pytest

import robotball as rb
from bench.scene_page import page, schema
from robotball.files import scene_tables
from robotball.motion import path_error
from robotball.robot.scene import Friction
from robotball.rotations import rotation_matrix
from robotball.scene_files.scene_file import CATALOG
from robotball.scene_files.scene_keys import meaning_of, struct_of
from robotball.user_model.robot_scene import RobotTable
from tests.imports import PROJECT
from tests.messages import naming
from tests.robotball.scene_files.scene_texts import (
    BOB,
    FRAME,
    HEAD,
    PENDULUM,
    PLATE,
    SECTION,
    SHELL,
    START,
    URDF,
    edited,
    robot,
    scene_of,
)

PAGE = PROJECT / "docs" / "scene.md"
EXAMPLES = re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.S)
CLASSICAL = (CATALOG / "classical_regular.toml").read_text()
# Fig. 12 with another rotor axis, so that the frame axes are not principal axes.
AXIS = "[0.5876075828422094, 0.5876075828422094, 0.5562685117572915]"
ASKEW = edited(AXIS, "[1.0, -2.0, 2.0]")
ASKEW_CLASSICAL = edited('rolling = "rubber"', 'rolling = "classical"', ASKEW)


def test_a_shell_is_given_by_its_wall() -> None:
    """By thickness and mass or density; parts shift its centre of mass along the axis."""
    by_mass = scene_of(robot()).ball.shell
    volume = 4 / 3 * np.pi * (0.2**3 - 0.196**3)
    dense = SHELL.replace("mass = 1.0", f"density = {1 / volume!r}")
    by_density = scene_of(robot(shell=dense)).ball.shell
    assert by_density.mass == pytest.approx(1.0, rel=1e-14)
    assert by_density.axial_inertia == pytest.approx(by_mass.axial_inertia, rel=1e-14)
    weight = '[[shell.part]]\nkind = "disc"\nmass = 0.5\nradius = 0.03\ncentre = [0, -0.15, 0]\n'
    weighted = scene_of(robot(shell=SHELL + weight)).ball.shell
    assert weighted.mass == 1.5
    assert weighted.offset == pytest.approx(-0.05, rel=1e-14)
    # Parallel axis theorem: wall and disc about (0, -0.05, 0).
    across = by_mass.axial_inertia + 0.05**2 + 0.5 * (0.03**2 / 4 + 0.1**2)
    assert weighted.axial_inertia == pytest.approx(by_mass.axial_inertia + 0.5 * 0.03**2 / 2)
    assert weighted.transverse_inertia == pytest.approx(across, rel=1e-14)


def test_parts_of_a_rotor_are_aligned_with_its_axis() -> None:
    """A disc without an axis takes that axis; the centre is the centre of mass of the parts."""
    disc = '[[rotor]]\naxis = [0, 0, 2]\npart = [{ kind = "disc", mass = 0.3, radius = 0.05, '
    rotor = scene_of(robot(rest=disc + "centre = [0.02, 0, 0] }]\n")).ball.rotors[0]
    assert rotor.mass == 0.3
    assert rotor.axial_inertia == pytest.approx(0.3 * 0.05**2 / 2, rel=1e-15)
    np.testing.assert_array_equal([rotor.axis, rotor.centre], [[0, 0, 1], [0.02, 0, 0]])


def test_a_pendulum_that_swings_out_of_the_shell_gives_a_warning(tmp_path: Path) -> None:
    """It is farthest away at 180°; the warning points at the line of the caller.

    The file has Windows line ends and a byte order mark.
    """
    text = robot(rest=PENDULUM.replace("-0.02", "0.12") + BOB.replace("-0.11", "0.0"))
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8-sig", newline="\r\n")
    with pytest.warns(rb.SceneWarning, match=naming("pendulum1 shell 0.2419~m")) as caught:
        rb.load_scene(tmp_path / "mine.toml")
    assert caught[0].filename == __file__


LINES = (
    'kind = "point", centre = [0, 0, -0.1]',
    'kind = "rod", begin = [0, 0, 0], end = [0, 0, -0.1]',
)


@pytest.mark.parametrize("part", LINES)
def test_a_point_mass_or_a_thin_rod_may_be_a_pendulum(part: str) -> None:
    """A tiny inertia is added to its zero moments, with little effect on the motion."""
    swing = 'drive = "free"\ninitial_angle = 0.7\n'
    scene = scene_of(robot(rest=f"{PENDULUM}{swing}part = [{{ mass = 0.5, {part} }}]\n"))
    (bob,), times = scene.ball.pendulums, rb.sample_times(2.0)
    thin = replace(bob, inertia=bob.inertia - 0.999e-9 * 0.5 * 0.2**2 * np.eye(3))
    ideal = scene.with_hinges(body={"pendulum1": thin})
    exact = rb.integrate(scene, times)
    # Measured 3e-9 and 4e-9, from the added inertia; 1.2e-10 and 8e-11, error of RK4.
    assert path_error(rb.integrate(ideal, times), exact) < 1e-8
    assert path_error(rb.simulate(scene, times, settings="accurate"), exact) < 3e-10


def test_a_plane_may_be_inclined_and_rough() -> None:
    """The direction of gravity is normalized; friction coefficients are kept."""
    plane = "gravity_direction = [0.3, 0, -0.4]\n[friction]\nsliding = 0.8\nrolling = 1e-3\n"
    scene = scene_of(robot(plane))
    assert scene.gravity_direction == pytest.approx((0.6, 0.0, -0.8), abs=1e-16)
    assert scene.friction == Friction(0.8, None, 1e-3)


def test_hinges_have_motors_commands_and_initial_states(tmp_path: Path) -> None:
    """For every kind of motor; one command is in a file."""
    (tmp_path / "rate.csv").write_text("time,rate\ns,rad/s\n0,4\n2.5,2\n5,0.5\n")
    text = robot(
        frame=FRAME + 'drive = "servo"\nkv = 2.0\nrate = 3.0\narmature = 0.01\n',
        rest=PENDULUM + BOB + 'drive = "position"\nkp = 6.0\nkd = 0.3\nangle = 0.5\n'
        "torque_limit = 0.7\ninitial_angle = 0.2\n"
        + PENDULUM
        + BOB
        + 'drive = "torque"\ntorque = [0.1, { kind = "sine", amplitude = 0.2, '
        "frequency = 1.0 }]\ninitial_rate = -1.0\n"
        + PENDULUM
        + BOB
        + 'drive = "free"\ndamping = 0.01\nstiffness = 0.3\nrest = 0.5\n'
        + PENDULUM
        + BOB
        + 'rate = { kind = "samples", file = "rate.csv" }\n',
    )
    scene = scene_of(text, tmp_path)
    frame, position, torque, free, prescribed = scene.hinges
    assert frame.motor == rb.Servo(2.0, None, 0.01)
    assert position.motor == rb.PositionServo(6.0, 0.3, 0.7)
    assert torque.motor == rb.Torque()
    assert free.motor == rb.Free(0.01, 0.3, 0.5)
    assert prescribed.motor is None
    assert position.command.rate(1.0) == 0.5
    assert torque.command.rate(0.25) == pytest.approx(0.3)
    assert prescribed.command == rb.Samples(times=(0.0, 2.5, 5.0), values=(4.0, 2.0, 0.5))
    assert [hinge.angle for hinge in scene.hinges] == [0.0, 0.2, 0.0, 0.0, 0.0]
    assert [hinge.rate for hinge in scene.hinges] == [3.0, 0.0, -1.0, 0.0, 4.0]


def test_any_robot_may_start_with_an_angular_velocity() -> None:
    """The initial momentum gives the same ω, also with rotating hinges."""
    start = START.replace("[0, 0, 0]", "[1.0, -2.0, 0.5]")
    turning = "initial_angle = 0.4\ninitial_rate = 3.0\ndrive = 'free'\n"
    scene = scene_of(robot(rest=PENDULUM + BOB + turning, start=start))
    # Measured 1e-15: rounding.
    omega = scene.angular_velocity_at(scene.start)
    np.testing.assert_allclose(omega, [1.0, -2.0, 0.5], atol=1e-14)


@pytest.mark.parametrize("text", [ASKEW, ASKEW_CLASSICAL], ids=["rubber", "classical"])
def test_every_form_of_a_start_gives_the_same_start(text: str) -> None:
    """Section coordinates, γ or attitude, and M or ω.

    If the frame axes are not principal, L and g = 0 of (5.5) refer to the principal axes.
    """
    scene = scene_of(text)
    R, M = rotation_matrix(scene.start.attitude), scene.start.momentum
    assert np.abs(scene.principal_axes - np.eye(3)).max() > 0.1
    principal = R @ scene.principal_axes
    # Rounding of numbers up to 5; measured 4.4e-16.
    assert abs((principal.T @ M)[2] - 3.6) < 1e-14
    assert abs(np.cross(principal.T @ M, principal[2])[2]) < 1e-14
    attitude, omega = scene.start.attitude.tolist(), scene.angular_velocity_at(scene.start).tolist()
    gamma, momentum = f"gamma = {R[2].tolist()}\n", f"momentum = {(R.T @ M).tolist()}"
    attitudes = f"attitude = {attitude}\n", f"{gamma}alpha = {R[0].tolist()}\n"
    momenta = momentum, f"momentum_world = {M.tolist()}", f"angular_velocity = {omega}"
    for form in (gamma + momentum, *(a + m for a in attitudes for m in momenta)):
        start = scene_of(edited(SECTION, form, text)).start
        # Rounding: measured 4.4e-16 and 3.6e-15.
        assert np.abs(rotation_matrix(start.attitude) - R).max() < 3e-15, form
        assert np.abs(start.momentum - M).max() < 2e-14, form


def test_section_with_c_gives_a_momentum_with_a_vertical_part() -> None:
    """c of (5.5) is (M, γ), the world Z component of M."""
    start = "section = { L = 3.6, l = 0.6, g = 0.3, f = 25.0, c = 3.0 }"
    M = scene_of(edited(SECTION, start, CLASSICAL)).start.momentum
    # Rounding of numbers up to 5; measured 4.4e-16.
    assert np.abs(M - [-4.0, 0.0, 3.0]).max() < 5e-15


def test_a_start_with_zero_momentum_differs_from_zero_angular_velocity() -> None:
    """With M = 0 a rotating rotor makes the ball rotate; a written file has a comment on it."""
    attitude = "attitude = [0.6, 0.0, 0.8, 0.0]\n"
    rest, still = (
        scene_of(edited(SECTION, attitude + form, CLASSICAL))
        for form in ("rest = true", "angular_velocity = [0.0, 0.0, 0.0]")
    )
    assert np.linalg.norm(rest.angular_velocity_at(rest.start)) > 0.1  # rad/s
    assert not rest.start.momentum.any()
    assert np.abs(rest.start.attitude - [0.6, 0.0, 0.8, 0.0]).max() < 2e-16
    assert np.linalg.norm(still.angular_velocity_at(still.start)) < 1e-13  # rounding
    assert still.start.momentum.any()
    rough = rb.scene_toml(replace(rest, friction=replace(rest.friction, sliding=0.4)))
    (line,) = (line for line in rough.splitlines() if "#" in line)
    assert line.startswith("momentum_world = ")
    assert line.endswith("# M = 0; ω is not, where frame or rotors turn")
    assert "# M = 0" not in rb.scene_toml(still)


def test_the_page_and_the_schema_are_up_to_date() -> None:
    """`python -m bench.scene_page` changes nothing."""
    assert PAGE.read_text() == page()
    assert PAGE.with_name("scene.schema.json").read_text() == schema()


VALIDATOR = jsonschema.Draft202012Validator(rb.scene_schema())


def schema_errors(text: str) -> list[str]:
    """Return paths and messages of the errors found by an independent validator."""
    return [f"{e.json_path}: {e.message}" for e in VALIDATOR.iter_errors(tomllib.loads(text))]


@pytest.mark.parametrize("name", rb.catalog())
def test_catalog_scenes_satisfy_the_schema(name: str) -> None:
    """Also in draft 7, which editors of TOML read: `items: false` would refuse every list."""
    text = (CATALOG / f"{name}.toml").read_text()
    assert schema_errors(text) == []
    assert [*jsonschema.Draft7Validator(rb.scene_schema()).iter_errors(tomllib.loads(text))] == []


def test_schema_refuses_misspelt_keys_and_impossible_numbers() -> None:
    """At any depth; the schema itself is valid."""
    jsonschema.Draft202012Validator.check_schema(rb.scene_schema())
    for old, new, path, name in (
        ("duration", "duratoin", "$", "duratoin"),
        ("[shell]\nradius", "[shell]\nraduis", "$.shell", "raduis"),
        ("axial = 0.023", "axail = 0.023", "$.rotor[0].inertia", "axail"),
        ("radius = 1.0", "radius = -1.0", "$.shell", "-1.0"),
        ('rolling = "rubber"', 'rolling = "sliding"', "$.rolling", "sliding"),
    ):
        errors = schema_errors(edited(old, new))
        assert any(e.startswith(path) and name in e for e in errors), (name, errors)


def whole(example: str) -> str:
    """Return the example completed to a whole scene."""
    given_keys = tomllib.loads(example)
    if "robot" in given_keys:
        return example
    head = [line for line in HEAD.splitlines() if line.split()[0] not in given_keys]
    tables = {"shell": SHELL, "frame": FRAME, "start": START}
    left_out = ("shell", "frame") if "numbers" in given_keys else ()
    rest = [text for key, text in tables.items() if key not in (*given_keys, *left_out)]
    return "\n".join([*head, example, *rest])


@pytest.mark.parametrize("example", EXAMPLES, ids=range(len(EXAMPLES)))
def test_every_documented_example_loads(tmp_path: Path, example: str) -> None:
    """Missing tables and the files that it refers to are added."""
    (tmp_path / "robot.urdf").write_text(URDF)
    chassis = '<body name="chassis"><geom size=".05" mass="1"/></body>'
    (tmp_path / "robot.xml").write_text(f"<mujoco><worldbody>{chassis}</worldbody></mujoco>")
    (tmp_path / "mybot.xml").write_text(PLATE)
    (tmp_path / "wheel.csv").write_text("t,rate\ns,rad/s\n0,0\n4,60\n10,80\n")
    scene = scene_of(whole(example), tmp_path)
    assert np.all(np.isfinite(scene.angular_velocity_at(scene.start)))


def test_the_page_has_each_key_of_every_table() -> None:
    """A row has the key's name and meaning. Keys of the same name may stand in several tables."""
    members = [*vars(scene_tables).values(), RobotTable]
    tables = [table for table in members if hasattr(table, "__struct_fields__")]
    fields = [field for table in tables for field in struct_of(table).fields]
    documented = [field for field in fields if isinstance(field.type, msgspec.inspect.Metadata)]
    assert len(documented) > 100
    for field in documented:
        row = rf"^\| `{field.name}` \|.* {re.escape(meaning_of(field)[0])} \|"
        assert re.search(row, PAGE.read_text(), re.M), field.name
