"""The forms in which a start is given, and what each of them places."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

import robotball as rb
from robotball import scene as starts
from robotball.equations import as_vector
from robotball.rotations import Array, rotation_matrix
from tests.scenes import FOUR
from validation import compare

pytestmark = pytest.mark.core

NAN, INF = float("nan"), float("inf")
UP = np.array([0.0, 0.0, 1.0])
ROUNDING = 2e-14  # of vectors of length up to 10; measured at most 4.7e-15
UNIT_ROUNDING = 3e-15  # of unit vectors; measured at most 5.6e-16

directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
angles = st.floats(-3.1, 3.1)
fractions = st.floats(-0.99, 0.99)


def gap(a: ArrayLike, b: ArrayLike) -> float:
    """The largest difference of two arrays' entries."""
    return float(np.abs(np.asarray(a) - np.asarray(b)).max())


def unit(v: tuple[float, ...]) -> Array:
    length = np.linalg.norm(v)
    assume(length > 0.01)
    return np.array(v) / length


# The section (5.5) ---------------------------------------------------------------------------


@given(L=fractions, l=angles, g=angles, f=st.floats(0.01, 100.0), c=fractions)
def test_section_state_has_the_constants_it_is_given(
    L: float, l: float, g: float, f: float, c: float
) -> None:
    """γ² = 1, M² = f, (M, γ) = c, and M₃ = L, M₁/M₂ = tan l."""
    G = f**0.5
    gamma, M = starts.section_state(L * G, l, g, f, c * G)
    assert abs(gamma @ gamma - 1) < UNIT_ROUNDING
    assert gap(M @ M / f, 1) < UNIT_ROUNDING
    assert gap(M @ gamma / G, c) < UNIT_ROUNDING
    assert gap(M[2] / G, L) < UNIT_ROUNDING
    assert gap(np.arctan2(M[0], M[1]), l) < UNIT_ROUNDING


@given(L=fractions, l=angles, f=st.floats(0.01, 100.0))
def test_section_g_zero_is_where_the_vertical_is_level_with_the_momentum(
    L: float, l: float, f: float
) -> None:
    """At g = 0 (and c = 0), (M×γ)₃ = 0, and of its two halves it is the one with γ₃ < 0."""
    gamma, M = starts.section_state(L * f**0.5, l, 0.0, f)
    assert abs(np.cross(M, gamma)[2]) / f**0.5 < UNIT_ROUNDING
    assert gamma[2] < 0


@given(L=fractions, l=angles, g=st.floats(0.01, 3.1))
def test_section_angle_turns_the_vertical_about_the_momentum(L: float, l: float, g: float) -> None:
    """From g = 0 the vertical turns about M by g, against the right-hand rule."""
    (level, M), (gamma, _) = (starts.section_state(5 * L, l, angle, 25.0) for angle in (0.0, g))
    assert abs(np.arctan2(-M @ np.cross(level, gamma) / 5, level @ gamma) - g) < UNIT_ROUNDING


# γ and M, or γ and α -------------------------------------------------------------------------


@given(gamma=directions, M=directions, size=st.floats(0.1, 10.0))
def test_world_axes_lie_along_the_momentum(
    gamma: tuple[float, ...], M: tuple[float, ...], size: float
) -> None:
    """α = -(M - cγ)/√(f - c²) and β = M×γ/√(f - c²) of section 3.3; M in the world is (-, 0, c)."""
    vertical, momentum = unit(gamma), size * unit(M)
    c = momentum @ vertical
    assume(abs(c) < 0.99 * size)
    level = (momentum @ momentum - c * c) ** 0.5
    start = starts.along_momentum(vertical, momentum)
    alpha, beta, up = rotation_matrix(start.attitude)
    assert gap(alpha, -(momentum - c * vertical) / level) < ROUNDING
    assert gap(beta, np.cross(momentum, vertical) / level) < ROUNDING
    assert gap(up, vertical) < ROUNDING
    assert gap(start.momentum, [-float(level), 0.0, float(c)]) < ROUNDING
    assert gap(rotation_matrix(start.attitude).T @ start.momentum, momentum) < ROUNDING


@given(gamma=directions, alpha=directions)
def test_attitude_of_two_axes_has_them(gamma: tuple[float, ...], alpha: tuple[float, ...]) -> None:
    """The rows of the attitude's matrix are α, β = γ×α and γ."""
    vertical = unit(gamma)
    ahead = np.cross(unit(alpha), vertical)
    assume(np.linalg.norm(ahead) > 0.1)
    ahead /= np.linalg.norm(ahead)
    rows = rotation_matrix(starts.attitude_of_axes(vertical, ahead))
    assert gap(rows, np.stack([ahead, np.cross(vertical, ahead), vertical])) < ROUNDING


def test_axes_that_are_nearly_orthogonal_are_made_so() -> None:
    """α tilted by 1e-6, a caption's rounding, is set right."""
    assert gap(rotation_matrix(starts.attitude_of_axes(UP, tilted(1e-6))), np.eye(3)) < ROUNDING


def test_unit_vectors_are_made_exact() -> None:
    """Six digits of a unit vector pass."""
    near = starts.unit("gamma", np.array([0.577350, 0.577350, 0.577350]))
    assert abs(np.linalg.norm(near) - 1) < 4e-16  # rounding, measured 1.1e-16


# The rubber model's own conditions -------------------------------------------------------------


def test_rubber_momentum_is_made_horizontal_and_others_refused() -> None:
    """A vertical part of 1e-6 |M| is dropped, one of 1e-3 is refused with both numbers."""
    near = starts.horizontal(np.array([3.0, 4.0, 1e-6]), scale=0.0)
    np.testing.assert_array_equal(near, [3.0, 4.0, 0.0])
    np.testing.assert_array_equal(starts.horizontal(np.zeros(3), scale=0.0), np.zeros(3))
    with pytest.raises(rb.InputError, match=r"\(3\.1\): \(M, gamma\) = 0\.005 of \|M\| = 5 kg"):
        starts.horizontal(np.array([3.0, 4.0, 0.005]), scale=5.0)
    with pytest.raises(rb.InputError, match="M is not horizontal"):
        starts.horizontal(np.array([3.0, 4.0, NAN]), scale=5.0)


@pytest.mark.parametrize("number", range(20))
def test_a_rubber_ball_whose_momentum_is_zero_starts_at_any_attitude(number: int) -> None:
    """By ω with M(ω, γ) = 0, whose rounding is 1e-16 of K and dΩ: all of it may be vertical."""
    scene = rb.load_scene("fig12")
    attitude = np.random.default_rng(number).normal(size=4)
    attitude /= np.linalg.norm(attitude)
    gamma = as_vector(rotation_matrix(attitude)[2])
    omega = scene.parameters.angular_velocity((0.0, 0.0, 0.0), gamma)
    M = rotation_matrix(attitude) @ scene.parameters.momentum(omega, gamma)
    assert np.linalg.norm(M) < 1e-14 * scene.momentum_scale  # measured 1e-16 to 1.5e-15
    rolling = replace(scene, start=starts.Start(attitude, M))
    assert rolling.start.momentum[2] == 0.0
    upright = starts.Start(attitude, np.array([0.0, 0.0, 1e-9]))
    with pytest.raises(rb.InputError, match="M is not horizontal"):
        replace(scene, start=upright)


def test_a_start_that_is_nearly_on_the_model_is_the_same_in_both_engines() -> None:
    """M_z of 9e-6 |M| and an attitude as long as 1 + 9e-6, given by Python, are set right once."""
    scene, times = rb.load_scene("fig12"), np.linspace(0.0, 5.0, 51)
    size = float(np.linalg.norm(scene.start.momentum))
    off = np.array([0.0, 0.0, 9e-6 * size])
    near = starts.Start(scene.start.attitude * (1 + 9e-6), scene.start.momentum + off)
    started = replace(scene, start=near)
    np.testing.assert_array_equal(started.start.momentum, scene.start.momentum)
    # Measured 1.4e-12, RK4's error; 1.5e-6 where M_z is left to the equations alone.
    assert (compare(started, "accurate", times).path_error or 1.0) < 6e-12


def test_a_shell_that_does_not_spin_on_the_spot_passes() -> None:
    """(ω - Ω, γ) = 0, of a rolling shell and of one at rest."""
    starts.check_no_spin(np.array([1.0, 2.0, 0.0]), UP)
    starts.check_no_spin(np.zeros(3), UP)


def tilted(tilt: float) -> Array:
    return np.array([np.cos(tilt), 0.0, np.sin(tilt)])


def section(L: float, f: float, c: float) -> Callable[[], object]:
    return lambda: starts.section_state(L, 0.6, 0.0, f, c)


REFUSED: list[tuple[Callable[[], object], str]] = [
    (section(1.0, 0.0, 0.0), r"f = M² must be positive, not 0"),
    (section(1.0, -4.0, 0.0), r"f = M² must be positive, not -4"),
    (section(1.0, NAN, 0.0), r"f = M² must be positive, not nan"),
    (section(5.1, 25.0, 0.0), r"\|L\| = 5\.1 must not exceed sqrt\(f\) = 5"),
    (section(NAN, 25.0, 0.0), r"\|L\| = nan must not exceed"),
    (section(1.0, 25.0, -5.0), r"\|c\| = 5 must be smaller than sqrt\(f\) = 5"),
    (section(1.0, 25.0, NAN), r"\|c\| = nan must be smaller"),
    (
        lambda: starts.along_momentum(UP, np.zeros(3)),
        r"no horizontal part .* give alpha or a quaternion",
    ),
    (
        lambda: starts.along_momentum(UP, 3 * UP),
        r"no horizontal part .* give alpha or a quaternion",
    ),
    (
        lambda: starts.attitude_of_axes(UP, tilted(1e-3)),
        r"not orthogonal: \(gamma, alpha\) = 0\.001",
    ),
    (lambda: starts.unit("gamma", 1.001 * UP), r"gamma is not of unit length: \|gamma\| = 1\.001"),
    (lambda: starts.unit("alpha", np.array([NAN, 0, 0])), "alpha is not of unit length.*nan"),
    (lambda: starts.unit("alpha", np.array([INF, 0, 0])), "alpha is not of unit length.*inf"),
    (
        lambda: starts.check_no_spin(np.array([1.0, 2.0, 0.1]), UP),
        r"forbids \(2\.2\): \(ω - Ω, γ\) = 0\.1 rad/s",
    ),
]


@pytest.mark.parametrize(("start", "message"), REFUSED)
def test_a_start_that_cannot_be_is_refused(start: Callable[[], object], message: str) -> None:
    """With its numbers, the limit, and what to give instead."""
    with pytest.raises(rb.InputError, match=message):
        start()


@pytest.mark.parametrize("name", FOUR)
def test_start_rolls_as_its_angular_velocity_says(name: str) -> None:
    """A scene's angular velocity at its start is the ω with which `integrate` sets out."""
    scene = rb.load_scene(name)
    motion = rb.integrate(scene, np.array([0.0, 0.01]))
    assert gap(motion.angular_velocity[0], scene.angular_velocity_at(scene.start)) < ROUNDING
    assert gap(motion.momentum[0], scene.start.momentum) < ROUNDING
