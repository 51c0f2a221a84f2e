"""Designs of Fig. 12's ball, and checks of a design's numbers and bodies."""

import math
from typing import Any

import numpy as np
import pytest

from robotball import Design, design
from robotball.robot.ball import shell_inertia
from robotball.rotations import Array

A12, OMEGA12, K12 = np.diag([0.7, 0.6, 0.8]), np.array([0.0, 0.0, 2.0]), np.array([2.0, 2.0, 0.0])
UNBUILDABLE = "can be simulated, but not built: mass would lie outside the shell"


def fig12(**changes: Any) -> Design:
    """Return a design for Fig. 12's numbers, with some arguments changed."""
    return design(**{"A": A12, "Omega": OMEGA12, "K": K12, "radius": 1.0, **changes})


def error(made: Design, A: Array, Omega: Array, K: Array) -> float:
    """Return the largest relative error: of A, of Ω, and of K over |K| + d|Ω|."""
    ball = made.ball
    got_Omega = made.rates[0] * ball.shell.axis
    rates = np.array(made.rates)
    got_K = ball.gyrostatic_inertia @ rates - ball.d * got_Omega
    turning = float(np.linalg.norm(Omega))
    momentum = float(np.linalg.norm(K)) + ball.d * turning
    return max(
        float(np.abs(ball.A - A).max() / np.abs(A).max()),
        float(np.abs(got_Omega - Omega).max() / (turning or 1)),
        float(np.abs(got_K - K).max() / (momentum or 1)),
    )


def check_bodies(made: Design, mass: float | None) -> None:
    """Assert that the bodies have the design's masses and radii and satisfy its limits."""
    ball, limits = made.ball, made.limits
    shell, thickness = ball.shell, limits.shell_thickness
    frame_radius, rotor_radius = limits.radii(ball.radius)
    rounding = 1 + 1e-12
    assert mass is None or ball.mass == pytest.approx(mass, rel=1e-14)
    assert shell.axial_inertia == shell.transverse_inertia
    assert shell.axial_inertia == pytest.approx(
        shell_inertia(ball.radius, shell.mass, thickness), rel=1e-14
    )
    assert limits.shell_mass <= shell.mass * rounding
    assert limits.frame_mass <= ball.frame.mass * rounding
    for rotor, rate in zip(ball.rotors, made.rates[1:], strict=True):
        assert limits.rotor_mass <= rotor.mass * rounding
        assert rotor.axial_inertia <= rotor.mass * rotor_radius**2 * rounding
        assert rotor.transverse_inertia == rotor.axial_inertia / 2
        assert 0 < rate <= limits.rotor_speed * rounding
    # The frame's mass as six points, in pairs at distance c √(3/m) from the centre.
    second = np.trace(ball.frame.inertia) / 2 * np.eye(3) - ball.frame.inertia
    assert np.linalg.eigvalsh(second)[0] > 0
    assert made.reach == pytest.approx(math.sqrt(np.trace(second) / ball.frame.mass), rel=1e-12)
    assert made.buildable == (made.reach <= frame_radius * rounding)
