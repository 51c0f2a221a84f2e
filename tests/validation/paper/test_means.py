"""The means by which the claims are checked: formulas typed twice, point masses, captions."""

from dataclasses import replace

import numpy as np
import pytest

from robotball import catalog, integrate, load_scene
from robotball import equations as eq
from robotball.equations import Parameters, Rolling, as_vector
from robotball.rotations import rotation_matrix
from validation.paper import formulas as f
from validation.paper.captions import CAPTIONS, motion, near_sigma_plus
from validation.paper.formulas import Numbers
from validation.paper.point_masses import moments


@pytest.mark.parametrize("rolling", ["rubber", "classical"])
def test_the_two_typings_of_the_equations_agree(rolling: Rolling) -> None:
    """(3.2), (3.3), (2.4) and (2.5) of formulas.py and of robotball.equations, 20 random states.

    Rounding: measured 3e-14 rad/s² at most of 100.
    """
    for state in f.states(1, 20):
        n, rubber = state.n, rolling == "rubber"
        I, Omega, K = (as_vector(v) for v in (np.diag(n.I), n.Omega, n.K))
        p = Parameters(rolling, I, n.d, n.a, Omega, K)
        M = f.level(state.M, state.gamma) if rubber else state.M
        omega = f.velocity_of(not rubber)(n, M, state.gamma)
        ours = p.angular_velocity(as_vector(M), as_vector(state.gamma))
        assert omega == pytest.approx(ours, abs=1e-13)
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


# Fig. 10's level below 2.08 has a scene too.
STARTED = CAPTIONS | {"fig10_stable": near_sigma_plus(2.0)}


@pytest.mark.parametrize("name", STARTED)
def test_a_scene_of_the_catalog_starts_and_moves_as_its_caption_says(name: str) -> None:
    """α, β, γ, M and the numbers of the equations, to rounding; γ and contact point after 3 s.

    The motion is another integration of another state, typed once more: measured 1.5e-13 m
    (fig07) and 6.2e-14 (fig14) at most, rounding of both.
    """
    caption, scene = STARTED[name], load_scene(name)
    axes = rotation_matrix(scene.start.attitude)
    assert axes == pytest.approx(caption.axes, abs=2e-15)
    assert scene.start.momentum @ axes == pytest.approx(caption.M, abs=1e-14)
    given: Numbers = f.numbers(scene.parameters)
    for each in ("A", "Omega", "K"):
        assert getattr(given, each) == pytest.approx(getattr(caption.n, each), abs=5e-15)
    assert given.d == pytest.approx(0.9, rel=1e-15) or name < "fig11"  # of Figs 12 to 14, chosen
    times = np.array([0.0, 3.0])
    gamma, path = motion(caption, times, 1e-13)
    ours = integrate(scene, times)
    assert np.linalg.norm(ours.contact_point - path, axis=1).max() < 5e-13
    assert np.abs(ours.gamma - gamma).max() < 2e-13


def test_no_figure_is_left_out() -> None:
    """Every scene named after a figure has its caption."""
    assert sorted(STARTED) == [name for name in catalog() if name.startswith("fig")]
