"""`integrate`: what it conserves, at which work it changes energy, and how its error falls."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball import equations as eq
from robotball.equations import Vector
from robotball.robot import Ball, Frame
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.scene import Start
from tests.identities import energy_rate
from tests.scenes import FOUR

pytestmark = pytest.mark.core

SECONDS = 10.0


@pytest.fixture(scope="module", params=FOUR)
def scene(request: pytest.FixtureRequest) -> rb.Scene:
    return rb.load_scene(request.param)


def principal_state(scene: rb.Scene, motion: rb.Motion) -> tuple[Vector, Vector]:
    """Columns of ω and γ in principal axes."""
    omega, gamma = (v @ scene.principal_axes for v in (motion.angular_velocity, motion.gamma))
    return tuple(omega.T), tuple(gamma.T)


def world(motion: rb.Motion, v: Array) -> Array:
    """Vectors (n, 3) in frame axes, in world axes."""
    return np.einsum("nij,nj->ni", rotation_matrix(motion.attitude), v)


# Invariants and work -----------------------------------------------------------------------


def test_momentum_of_the_motion_it_returns_is_the_starts(scene: rb.Scene) -> None:
    """M(ω, γ) by (3.1), or L, of the returned ω and γ, in world axes, is M₀ at every time.

    Rounding in ω(M, γ) and back only, since M is put in; measured 4.4e-15 kg m²/s of 5.
    """
    motion = rb.integrate(scene)
    M = np.stack(scene.parameters.momentum(*principal_state(scene, motion)), axis=1)
    M_world = world(motion, M @ scene.principal_axes.T)
    assert np.abs(M_world - scene.start.momentum).max() < 2e-14
    assert np.abs(motion.momentum - scene.start.momentum).max() < 2e-14


def test_rubber_constraint_holds_along_the_motion(scene: rb.Scene) -> None:
    """(ω - Ω, γ) = 0 in a rubber motion, to rounding; a classical ball does spin on the spot.

    Measured 1.3e-15 rad/s, and 5 rad/s in the classical scene.
    """
    motion = rb.integrate(scene)
    omega, gamma = principal_state(scene, motion)
    spin = sum(g * (o - O) for g, o, O in zip(gamma, omega, scene.parameters.Omega, strict=True))
    if scene.rolling == "rubber":
        assert np.abs(spin).max() < 1e-14
    else:
        assert np.abs(spin).max() > 1


def test_energy_gained_is_the_work_of_the_drives(scene: rb.Scene) -> None:
    """E(t) - E(0) = -∫ (Ω, (A⁻¹ω + K)×ω) dt: a balance that neither M nor γ knows of.

    The integral by Gauss's rule on 100 panels of 8 nodes. The motion's own error, measured at
    most 7.1e-12 J, of a work of 8 to 31 J back and forth.
    """
    nodes, weights = np.polynomial.legendre.leggauss(8)
    edges = np.linspace(0.0, SECONDS, 101)
    half = edges[1] / 2
    inner = (edges[:-1, None] + half * (1 + nodes)).ravel()
    p = scene.parameters
    motion = rb.integrate(scene, np.concatenate([[0.0], inner, [SECONDS]]))
    omega, gamma = principal_state(scene, motion)
    E = eq.energy(omega, gamma, p.Omega, p.A, p.d, spinning=scene.rolling == "classical")
    power = energy_rate(omega, p.Omega, p.K, p.A)[1:-1].reshape(100, 8)
    assert np.ptp(E) > 5
    assert abs(E[-1] - E[0] - half * (power @ weights).sum()) < 4e-11


# Accuracy ----------------------------------------------------------------------------------


def test_error_falls_in_proportion_to_the_tolerance(scene: rb.Scene) -> None:
    """The slope of log error on log rtol from 1e-6 to 1e-12 is 1 ± 0.2.

    Measured 0.93 to 1.15: the step is chosen by an estimate, so an error may jump by a factor.
    """
    times = np.linspace(0.0, SECONDS, 21)
    tolerances = 10.0 ** -np.arange(6, 13)
    reference = rb.integrate(scene, times).contact_point
    errors = [
        np.abs(rb.integrate(scene, times, rtol=rtol).contact_point - reference).max()
        for rtol in tolerances
    ]
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.2)


def test_sample_times_do_not_change_the_motion(scene: rb.Scene) -> None:
    """The end is the same to the last bit however densely the motion is sampled."""
    few = rb.integrate(scene, np.array([0.0, SECONDS]))
    many = rb.integrate(scene, np.linspace(0.0, SECONDS, 1001))
    np.testing.assert_array_equal(few.contact_point[-1], many.contact_point[-1])
    np.testing.assert_array_equal(few.attitude[-1], many.attitude[-1])


def test_samples_within_a_step_are_as_good_as_its_ends(scene: rb.Scene) -> None:
    """Every interpolated state is where a run that ends there arrives.

    The interpolant's own error: measured at most 5.4e-13 m.
    """
    times = np.linspace(0.0, 1.0, 8)
    samples = rb.integrate(scene, times).contact_point
    ends = [rb.integrate(scene, np.array([0.0, t])).contact_point[-1] for t in times[1:]]
    assert np.abs(samples[1:] - ends).max() < 5e-12


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ([0.0], r"at least two, not of shape \(1,\)"),
        ([[0.0, 1.0]], r"at least two, not of shape \(1, 2\)"),
        ([0.1, 0.2], r"times must start at 0, not at 0\.1"),
        ([0.0, 1.0, 1.0], "times must increase: 1 follows 1"),
        ([0.0, 2.0, 1.5], r"times must increase: 1\.5 follows 2"),
        ([0.0, float("nan")], "times must be finite"),
        ([0.0, float("inf")], "times must be finite"),
    ],
)
def test_unusable_times_are_refused(times: list[float], message: str) -> None:
    """Times that do not increase from 0, or are not finite, are an InputError that says so."""
    with pytest.raises(rb.InputError, match=message):
        rb.integrate(rb.load_scene("fig12"), np.array(times))


# The same ball in other axes, another place, another time ---------------------------------------


def turned(scene: rb.Scene, rotation: Rotation) -> rb.Scene:
    """The same ball and motion with the frame's own axes turned: v_new = R v."""
    R = rotation.as_matrix()
    ball = scene.ball
    return replace(
        scene,
        ball=Ball(
            shell=replace(ball.shell, axis=R @ ball.shell.axis),
            frame=Frame(ball.frame.mass, R @ ball.frame.inertia @ R.T),
            rotors=tuple(replace(rotor, axis=R @ rotor.axis) for rotor in ball.rotors),
        ),
        start=replace(
            scene.start,
            attitude=multiply(scene.start.attitude, rotation.inv().as_quat(scalar_first=True)),
        ),
    )


angles = st.floats(-np.pi, np.pi)


@pytest.mark.slow
@settings(max_examples=5, phases=[Phase.generate])  # shrinking would take minutes
@given(angles=st.tuples(angles, angles, angles), name=st.sampled_from(FOUR))
def test_motion_does_not_depend_on_the_axes_of_the_frame(
    angles: tuple[float, float, float], name: str
) -> None:
    """Bodies given in turned axes roll the same path, with ω and γ turned with them.

    The principal axes are found anew and in another order, so every step rounds otherwise: at
    most 5.1e-13 m, 4.7e-13 in γ and 7.3e-12 rad/s of 20.
    """
    scene, rotation = rb.load_scene(name), Rotation.from_euler("zyx", angles)
    times = np.linspace(0.0, 5.0, 26)
    plain, other = (rb.integrate(s, times) for s in (scene, turned(scene, rotation)))
    assert np.abs(other.contact_point - plain.contact_point).max() < 5e-12
    assert np.abs(other.gamma - rotation.apply(plain.gamma)).max() < 1e-11
    assert np.abs(other.angular_velocity - rotation.apply(plain.angular_velocity)).max() < 5e-11


def test_heading_of_the_start_turns_the_path_only(scene: rb.Scene) -> None:
    """Turning the start about the vertical turns the path; ω in frame axes stays.

    Integration error, of steps that differ with q: at most 1.5e-12 m and 7.7e-12 rad/s.
    """
    heading = Rotation.from_euler("z", 0.7)
    start = Start(
        multiply(heading.as_quat(scalar_first=True), scene.start.attitude),
        heading.apply(scene.start.momentum),
    )
    times = np.linspace(0.0, 5.0, 26)
    plain, other = (rb.integrate(s, times) for s in (scene, replace(scene, start=start)))
    R = heading.as_matrix()[:2, :2]
    assert np.abs(other.contact_point - plain.contact_point @ R.T).max() < 1e-11
    assert np.abs(other.angular_velocity - plain.angular_velocity).max() < 4e-11


def test_a_motion_can_be_taken_up_where_it_was_left(scene: rb.Scene) -> None:
    """Ten seconds at once, or five and again five from the state reached, end alike.

    Integration error, of steps that differ: at most 8.3e-13 m.
    """
    whole = rb.integrate(scene, np.array([0.0, 10.0]))
    half = rb.integrate(scene, np.array([0.0, 5.0]))
    again = replace(scene, start=Start(half.attitude[-1], half.momentum[-1]))
    rest = rb.integrate(again, np.array([0.0, 5.0]))
    end = half.contact_point[-1] + rest.contact_point[-1]
    assert np.abs(end - whole.contact_point[-1]).max() < 1e-11


@pytest.mark.parametrize("equations", ["reduced", "multibody"])
def test_the_fraction_that_is_known_is_shown(equations: Literal["reduced", "multibody"]) -> None:
    """It grows from step to step and stays below 1: a stiff motor may take minutes."""
    shown: list[float] = []
    rb.integrate(
        rb.load_scene("fig12"), np.array([0.0, 8.0]), equations=equations, progress=shown.append
    )
    assert len(shown) > 1
    assert shown == sorted(set(shown))
    assert shown[-1] < 1
