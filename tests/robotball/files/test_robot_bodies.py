"""Bodies of any robot, and its plane: told in every way, or refused in a line."""

import numpy as np
import pytest

import robotball as rb
from tests.robotball.files.robot_tables import BOB, FRAME, PENDULUM, SHELL, Load, refused


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


def test_a_pendulum_that_swings_out_of_the_shell_is_told(load: Load) -> None:
    """It hangs at the centre, and at half a turn it is twice the pivot's height away."""
    hung = PENDULUM.replace("-0.02", "0.12") + BOB.replace("-0.11", "0.0")
    with pytest.warns(rb.SceneWarning, match=r"pendulum1 has mass outside the shell: at 0\.2419 m"):
        load(rest=hung)


def test_a_plane_may_be_inclined_and_rough(load: Load) -> None:
    """Gravity's direction is of any length; friction is told as it is."""
    scene = load("gravity_direction = [0.3, 0, -0.4]\n[friction]\nsliding = 0.8\nrolling = 1e-3\n")
    assert scene.gravity_direction == pytest.approx((0.6, 0.0, -0.8), abs=1e-16)
    assert (scene.friction.sliding, scene.friction.torsional) == (0.8, None)
    assert scene.friction.rolling == 1e-3


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


@pytest.mark.parametrize("name", BODIES)
def test_bodies_that_cannot_be_are_refused(load: Load, name: str) -> None:
    """In a line with the key, the value and what to do."""
    tables, words = BODIES[name]
    assert words in refused(load, tables)
