"""Bodies of any robot, and its plane: told in every way, or refused in a line."""

import numpy as np
import pytest

import robotball as rb
from tests.robotball.files.scene_texts import BOB, PENDULUM, SHELL, Load


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
