"""A start told in any form is the same start, and rest is M = 0."""

import re
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.rotations import rotation_matrix
from tests.robotball.files.scene_texts import CLASSICAL, FIG12, Write, edited, with_start

# Fig. 12's ball with its rotor laid elsewhere, so that the frame's axes are not principal ones.
ASKEW = re.sub(r"(?m)^axis = .*", "axis = [1.0, -2.0, 2.0]", FIG12)
ASKEW_CLASSICAL = edited('rolling = "rubber"', 'rolling = "classical"', ASKEW)


def vector(v: Any) -> str:
    return str([float(x) for x in v])


@pytest.mark.parametrize(
    "text",
    [FIG12, CLASSICAL, ASKEW, ASKEW_CLASSICAL],
    ids=["rubber", "classical", "askew rubber", "askew classical"],
)
def test_every_form_of_a_start_gives_the_same_start(write: Write, text: str) -> None:
    """The section's state, given as γ and M, as attitudes and as ω, is the same state."""
    scene = rb.load_scene(write(text))
    R = rotation_matrix(scene.start.attitude)
    alpha, gamma = vector(R[0]), vector(R[2])
    attitude, momentum = vector(scene.start.attitude), vector(R.T @ scene.start.momentum)
    omega = vector(scene.angular_velocity_at(scene.start))
    attitudes = f"attitude = {attitude}", f"gamma = {gamma}\nalpha = {alpha}"
    momenta = (
        f"momentum = {momentum}",
        f"momentum_world = {vector(scene.start.momentum)}",
        f"angular_velocity = {omega}",
    )
    forms = [f"{a}\n{m}" for a in attitudes for m in momenta]
    forms.append(f"gamma = {gamma}\nmomentum = {momentum}")
    for form in forms:
        other = rb.load_scene(write(with_start(form, text)))
        # Rounding: measured 4.4e-16 and 3.6e-15.
        assert np.abs(rotation_matrix(other.start.attitude) - R).max() < 3e-15, form
        assert np.abs(other.start.momentum - scene.start.momentum).max() < 2e-14, form


def test_section_is_one_of_the_principal_axes(write: Write) -> None:
    """For a ball whose frame axes are askew, L and g = 0 of (5.5) hold in the principal axes."""
    scene = rb.load_scene(write(ASKEW))
    assert np.abs(scene.principal_axes - np.eye(3)).max() > 0.1
    R = rotation_matrix(scene.start.attitude) @ scene.principal_axes
    M, gamma = R.T @ scene.start.momentum, R[2]
    # Rounding of numbers up to 5; measured 4.4e-16.
    assert abs(M[2] - 3.6) < 1e-14
    assert abs(np.cross(M, gamma)[2]) < 1e-14


def test_section_with_c_gives_a_momentum_with_a_vertical_part(write: Write) -> None:
    """c of (5.5) is (M, γ), which is M's world Z."""
    start = "section = { L = 3.6, l = 0.6, g = 0.3, f = 25.0, c = 3.0 }"
    M = rb.load_scene(write(with_start(start, CLASSICAL))).start.momentum
    # Rounding of numbers up to 5; measured 4.4e-16.
    assert np.abs(M - [-4.0, 0.0, 3.0]).max() < 5e-15


def test_rest_is_no_momentum_and_standing_still_is_another_start(write: Write) -> None:
    """A rotor that turns at the start turns a ball with M = 0; what to give for ω = 0 is told."""
    attitude = "attitude = [0.6, 0.0, 0.8, 0.0]\n"
    rest, still = (
        rb.load_scene(write(with_start(attitude + form, CLASSICAL)))
        for form in ("rest = true", "angular_velocity = [0.0, 0.0, 0.0]")
    )
    assert np.linalg.norm(rest.angular_velocity_at(rest.start)) > 0.1  # rad/s
    assert not rest.start.momentum.any()
    assert np.abs(rest.start.attitude - [0.6, 0.0, 0.8, 0.0]).max() < 2e-16
    assert np.linalg.norm(still.angular_velocity_at(still.start)) < 1e-13  # rounding
    assert still.start.momentum.any()
    assert "# M = 0; ω is not, where frame or rotors turn" in rb.scene_toml(rest)
    assert "# M = 0" not in rb.scene_toml(still)
    with pytest.raises(rb.InputError, match=r"rest \(M = 0; a ball that stands still has angular_"):
        rb.load_scene(write(with_start(attitude, CLASSICAL)))
