"""As many rotors as the momentum needs: none, one along it, or two where one is too slow."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import robotball as rb
from robotball import Limits
from robotball.designing import ROTOR_SHARE, _best, _margin, _request, share, two_rings
from tests.random_balls import random_axis, random_ball, ring_ball
from tests.robotball.designs import A12, K12, OMEGA12, check_bodies, error, fig12, numbers


def test_a_ball_whose_momentum_is_that_of_shell_and_mass_needs_no_rotor() -> None:
    """K = -(J_s + d)Ω for some J_s and d; a K beside it needs one."""
    made = fig12(K=(0.0, 0.0, -1.9))
    assert made.rotor_rates == ()
    assert made.ball.shell.axial_inertia + made.ball.d == pytest.approx(0.95, rel=1e-14)
    assert numbers(made)[2] == pytest.approx([0.0, 0.0, -1.9], rel=1e-14)
    Omega = np.array([0.3, -0.7, 1.9])
    assert fig12(Omega=Omega, K=-0.95 * Omega).rotor_rates == ()
    for K in ((0.0, 0.0, -1.5), (0.0, 0.0, 1.9), (1e-6, 0.0, -1.9), (0.0, 0.0, 0.0)):
        assert len(fig12(K=K).rotor_rates) == 1


def test_the_one_rotor_lies_along_the_momentum_that_shell_and_mass_leave() -> None:
    """Its axis is that of K + (J_s + d)Ω and j φ̇ its length."""
    made = fig12()
    (rotor,) = made.ball.rotors
    h = K12 + (made.ball.shell.axial_inertia + made.ball.d) * OMEGA12
    assert rotor.axial_inertia * made.rotor_rates[0] * rotor.axis == pytest.approx(h, rel=1e-14)


def test_without_a_turning_frame_the_shells_axis_is_z() -> None:
    """Ω = 0 leaves the axis free; K = 0 as well leaves no rotor."""
    made = fig12(Omega=(0, 0, 0))
    assert made.frame_rate == 0
    assert made.ball.shell.axis.tolist() == [0, 0, 1]
    assert len(made.rotor_rates) == 1
    assert fig12(Omega=(0, 0, 0), K=(0, 0, 0)).rotor_rates == ()


def test_slower_rotors_are_heavier_and_at_last_two() -> None:
    """Where one at the largest rate would break the frame's triangle inequality, two do not."""
    slow, slower = (
        fig12(limits=Limits(rotor_speed=speed, rotor_radius=0.9)) for speed in (19.5, 18.5)
    )
    assert len(slow.ball.rotors) == 1
    assert len(slower.ball.rotors) == 2
    assert slower.rotor_rates == (18.5, 18.5)
    for made in (slow, slower):
        check_bodies(made, None)
        assert made.buildable
        assert error(made, A12, OMEGA12, K12) < 1e-14


@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.01, 0.99),
)
def test_two_rings_have_the_moments_asked_of_them(seed: int, cosine: float) -> None:
    """Σ j = T, Σ j n = g and Σ j n nᵀ = g gᵀ/T + τ e eᵀ, to rounding."""
    rng = np.random.default_rng(seed)
    T, e = rng.uniform(0.1, 10), random_axis(rng)
    g = T * cosine * random_axis(rng)
    tau = float(T - g @ g / T)
    j_n = two_rings(T, g, e, tau)
    j = np.linalg.norm(j_n, axis=1)
    N = np.einsum("ra,rb->ab", j_n, j_n / j[:, None])
    request = np.outer(g, g) / T + tau * np.outer(e, e)
    # Measured at most 6e-16 T over 2e4 draws.
    assert j.sum() == pytest.approx(T, rel=1e-14)
    assert np.abs(j_n.sum(axis=0) - g).max() < 1e-14 * T
    assert np.abs(N - request).max() < 1e-14 * T


@pytest.mark.parametrize("free", [True, False], ids=["any mass", "a mass"])
def test_a_share_keeps_every_bound_by_its_margin(free: bool) -> None:
    """And one of them by no more: of the frame's moments and mass, and of its reach.

    Measured 1.6e-13 of the margin: rounding. Two rotors may weigh less than what is allowed for.
    """
    rng, rotors = np.random.default_rng(3), set()
    for _ in range(200):
        real = random_ball(rng, int(rng.integers(4))) if rng.random() < 0.8 else ring_ball(rng, 3)
        ball, light = real.ball, rng.uniform(0.2, 0.9)
        limits = Limits(
            shell_thickness=real.thickness,
            frame_radius=real.frame_radius,
            rotor_radius=real.rotor_radius,
            rotor_speed=1.5 * max(map(abs, real.rotor_rates), default=1.0),
            shell_mass=light * ball.shell.mass,
            frame_mass=light * ball.frame.mass,
            rotor_mass=light * min((each.mass for each in ball.rotors), default=0.0) / 4,
        )
        B = np.asarray(np.linalg.inv(ball.A), dtype=float)
        mass = None if free else ball.mass
        request = _request(B, real.Omega, real.K, ball.radius, mass, limits)
        found = share(request, request.frame_radius)
        assert found is not None
        total = found.shell_mass + found.frame_mass + found.rotor_masses.sum()
        s = total + request.shell_factor * found.shell_mass
        flat = np.eye(3) - found.axes[:, :, None] * found.axes[:, None, :]
        frame = (1 - s) * np.eye(3) - 2 * request.B
        frame -= np.einsum("r,rij->ij", found.axial_inertias, flat)
        # A single rotor takes a part of the margin for a slower rate, in each direction.
        slower = ROTOR_SHARE * found.margin * (len(found.axes) == 1)
        moment = np.linalg.eigvalsh(frame + slower * flat.sum(axis=0))[0] - slower
        room = found.frame_mass * request.frame_radius**2 - np.trace(frame) / 2
        kept = [moment, found.frame_mass - request.frame, room]
        shell = found.shell_mass - request.shell
        assert shell >= found.margin * (1 - 1e-9)
        least = min(kept if free else [*kept, shell])
        rotors.add(len(found.axes))
        if len(found.axes) < 2:
            assert least == pytest.approx(found.margin, rel=1e-11)
        else:
            assert least >= found.margin * (1 - 1e-9)
    assert rotors == {0, 1, 2}


@pytest.mark.parametrize("seed", range(4))
def test_two_rotors_share_the_inertia_as_well_as_they_can(seed: int) -> None:
    """No T of a fine scan, from |g| to where the frame is nothing, keeps all bounds by more."""
    real = ring_ball(np.random.default_rng(seed), 3)
    ball, limits = (
        real.ball,
        Limits(rotor_speed=real.rotor_rates[0], rotor_radius=real.rotor_radius),
    )
    B = np.asarray(np.linalg.inv(ball.A), dtype=float)
    request = _request(B, real.Omega, real.K, ball.radius, ball.mass, limits)
    s, _, margin = _best(request, 2, request.frame_radius)
    least = np.linalg.norm(request.momentum(np.array(s))) / request.speed
    T = np.linspace(least, (1 - 3 * s) / 2, 2001)
    scanned = _margin(request, 2, request.frame_radius, np.full_like(T, s), T)
    # Measured -3e-7 at most, as the scan is coarser; the end |g| alone keeps them by 9e-4 less.
    assert scanned.max() - margin < 1e-9
    assert scanned.max() - scanned[0] > 1e-4


def test_the_speed_that_a_refusal_names_is_enough() -> None:
    """To four digits, and no less is."""
    slow = Limits(rotor_speed=5.0, rotor_radius=0.9, buildable=True)
    with pytest.raises(rb.InputError, match="rotor speed: at most 5 rad/s is allowed") as refusal:
        fig12(limits=slow)
    needed = re.search(r"needs ([\d.]+) rad/s: ([\d.]+) rad/s more", str(refusal.value))
    assert needed is not None
    speed = float(needed[1])
    assert float(needed[2]) == pytest.approx(speed - 5, abs=6e-3)
    assert len(fig12(limits=replace(slow, rotor_speed=speed * 1.001)).ball.rotors) == 2
    with pytest.raises(rb.InputError, match="rotor speed"):
        fig12(limits=replace(slow, rotor_speed=speed * 0.999))
