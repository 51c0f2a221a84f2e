"""What the paper's claims are checked by: formulas typed twice, point masses, exponents."""

from dataclasses import replace

import numpy as np
import pytest

from robotball import equations as eq
from robotball import load_scene
from robotball.equations import Parameters, Rolling, as_vector
from robotball.rotations import rotation_matrix
from validation.paper import formulas as f
from validation.paper.captions import CAPTIONS
from validation.paper.formulas import Numbers
from validation.paper.point_masses import moments
from validation.paper.section_4 import FIG5
from validation.paper.section_5_3 import ensemble, six_exponents


def parameters_of(n: Numbers, rolling: Rolling) -> Parameters:
    I, Omega, K = (as_vector(v) for v in (np.diag(n.I), n.Omega, n.K))
    return Parameters(rolling, I, n.d, n.a, Omega, K)


@pytest.mark.parametrize("rolling", ["rubber", "classical"])
def test_the_two_typings_of_the_equations_agree(rolling: Rolling) -> None:
    """(3.2), (3.3), (2.4) and (2.5) of formulas.py and of robotball.equations, 100 random states.

    Rounding: measured 3e-14 rad/s² at most.
    """
    for state in f.states(1):
        n, p = state.n, parameters_of(state.n, rolling)
        rubber = rolling == "rubber"
        M = f.level(state.M, state.gamma) if rubber else state.M
        velocity = f.rubber_velocity if rubber else f.classical_velocity
        ours = p.angular_velocity(as_vector(M), as_vector(state.gamma))
        assert velocity(n, M, state.gamma) == pytest.approx(ours, abs=1e-13)
        omega = velocity(n, M, state.gamma)
        spin = f.spin_torque(n, omega, state.gamma) if rubber else 0.0
        rate, torque = eq.full_angular_acceleration(
            as_vector(omega),
            as_vector(state.gamma),
            p.Omega,
            as_vector(n.Omega_rate),
            p.k,
            as_vector(n.k_rate),
            p.I,
            p.d,
            spin_free=rubber,
        )
        assert spin == pytest.approx(torque, abs=2e-13)
        assert f.acceleration(n, omega, state.gamma, spin) == pytest.approx(rate, abs=2e-13)


def test_a_point_mass_ball_is_a_shell_a_frame_and_rotors() -> None:
    """Balanced, its shell and rotors dynamically symmetric, and of the stated mass; to rounding."""
    for moment in moments(2):
        ball = moment.ball
        centre = sum(each.masses @ (each.centre + each.points) for each in ball.bodies)
        assert np.linalg.norm(centre) < 1e-15
        for each in (ball.shell, *ball.rotors):
            inertia = sum(
                m * (r @ r * np.eye(3) - np.outer(r, r))
                for m, r in zip(each.masses, each.points, strict=True)
            )
            side = f.across(each.axis)[0]
            assert inertia @ each.axis == pytest.approx(each.moment(each.axis) * each.axis)
            assert inertia @ side == pytest.approx(each.moment(side) * side)
        assert ball.numbers.d == pytest.approx(ball.mass * ball.a**2)


def test_forces_on_the_points_are_the_rates_of_their_momenta() -> None:
    """Σ m du/dt and Σ r×m du/dt are the rates of the momenta in space, by differences: 1e-7."""
    h = 1e-5
    for moment in moments(3, count=5):
        ball, v, omega = moment.ball, moment.v, moment.omega
        v_rate, omega_rate = np.array([0.3, -0.2, 0.5]), np.array([0.7, 0.1, -0.4])

        ends = []
        for t in (-h, h):
            shell, frame, *rotors = (replace(b, rate=b.rate + t * b.rate_rate) for b in ball.bodies)
            later = replace(ball, shell=shell, frame=frame, rotors=tuple(rotors))
            ends.append(np.array(later.momenta(v + t * v_rate, omega + t * omega_rate)[:2]))
        p, G, _ = ball.momenta(v, omega)
        # The momentum p is along v, so that moving on at v does not change G about the centre.
        slopes = (ends[1] - ends[0]) / (2 * h) + np.cross(omega, [p, G])
        assert ball.rates(v, omega, v_rate, omega_rate) == pytest.approx(slopes.ravel(), abs=1e-7)


def test_a_search_finds_all_zeros_on_the_sphere() -> None:
    """γ×Aγ has the six axes; and (Ω,γ) = 0 adds no isolated one."""
    euler = f.zeros(lambda gamma: f.cross(gamma, FIG5.A @ gamma), 50)
    assert len(euler) == 6
    assert np.abs(np.abs(euler).max(axis=1) - 1).max() < 1e-12


def test_returns_are_where_a_motion_comes_back() -> None:
    """x' = -y, y' = x from (1, 0) passes y = 0 upwards after 2π, at (1, 0) again."""
    start = np.array([1.0, 0.0])
    passed = f.returns(
        lambda x: np.array([-x[1], x[0]]), start, np.array([0.0, 1.0]), 13.0, rtol=1e-11
    )
    assert len(passed) == 2
    assert np.abs(passed - start).max() < 1e-9


@pytest.mark.slow
def test_six_exponents_add_up_to_the_divergence() -> None:
    """Of Fig. 14 over 3000 s: the sum is that of λ₁ and λ₆ of 16 long runs, ± 0.01 1/s."""
    caption = CAPTIONS["fig14"]
    six = six_exponents(caption.n, caption.M, caption.axes[2], 3000.0)
    assert six.sum() == pytest.approx(sum(ensemble().mean), abs=0.01)
    assert list(six) == sorted(six, reverse=True)


@pytest.mark.parametrize("name", CAPTIONS)
def test_the_catalog_starts_as_the_captions_say(name: str) -> None:
    """α, β, γ, M and the numbers of the equations: to rounding."""
    caption, scene = CAPTIONS[name], load_scene(name)
    axes = rotation_matrix(scene.start.attitude)
    assert axes == pytest.approx(caption.axes, abs=2e-15)
    assert scene.start.momentum @ axes == pytest.approx(caption.M, abs=1e-14)
    given: Numbers = f.numbers(scene.parameters)
    n = caption.n
    for ours, printed in ((given.A, n.A), (given.Omega, n.Omega), (given.K, n.K)):
        assert ours == pytest.approx(printed, abs=5e-15)
