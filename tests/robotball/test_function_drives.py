"""Any function of time may be a rate, and is as good as a drive of the library's."""

import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import robotball as rb
from robotball.drives import Drive
from tests.robotball.own_drive import OwnDrive, of_sine
from validation import compare

FIG12 = rb.load_scene("fig12")


def only_on(end: float) -> Callable[[float], float]:
    """2 + sin(3t) from 0 to `end`, and an error elsewhere."""

    def rate(t: float) -> float:
        assert 0 <= t <= end
        return float(2 + np.sin(3 * t))

    return rate


@pytest.mark.parametrize("preset", ["fast", "balanced", "adaptive"])
@pytest.mark.parametrize("end", [0.003, 2.5, 12.0])
def test_a_function_is_asked_within_the_run_alone(end: float, preset: str) -> None:
    """Whatever the scene's duration, 10 s: by both engines, breakpoints at and beyond the end."""
    rate = rb.Custom(only_on(end), breakpoints=(0.0, end, 3 * end))
    times = np.linspace(0.0, end, 11)
    agreement = compare(replace(FIG12, frame_rate=rate), preset, times)
    assert agreement.agrees
    assert agreement.scene.duration == 10.0


def test_an_interpolant_and_a_square_root_turn_the_frame() -> None:
    """A spline that gives NaN outside, and a root with no value there."""
    nodes, times = np.linspace(0.0, 2.0, 9), np.linspace(0.0, 2.0, 51)
    spline = CubicSpline(nodes, 2 + np.sin(nodes), extrapolate=False)
    rates: list[Any] = [spline, lambda t: math.sqrt(t + 1e-3)]
    for rate in rates:
        assert compare(replace(FIG12, frame_rate=rate), "adaptive", times).agrees


SINES = rb.Sine(mean=2.0, amplitude=1.0, frequency=3 / np.pi)

FORMS: dict[str, rb.Custom | Drive | Callable[[float], float]] = {
    "a function alone": of_sine,
    "with its derivative": rb.Custom(of_sine, derivative=lambda t: 6 * math.cos(6 * t)),
    "with its integral": rb.Custom(of_sine, integral=lambda t: 2 * t - math.cos(6 * t) / 6),
}

FORMS["an object of one's own"] = OwnDrive()


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMS)
def test_adaptive_keeps_its_tolerance_under_a_function(name: str) -> None:
    """As good as a Sine, and in no more steps; loads and angles to rounding."""
    times = np.linspace(0.0, 5.0, 26)
    ours = compare(replace(FIG12, frame_rate=FORMS[name]), "adaptive", times)
    exact = compare(replace(FIG12, frame_rate=SINES), "adaptive", times)
    # Measured 1.7e-14 to 2.5e-14, rounding; 5e-10 with differences over 2 ms.
    assert (ours.path_error or 1.0) < 1e-13
    assert ours.report.steps <= 1.02 * exact.report.steps  # measured the same
    loads, right = ours.theory.loads, exact.theory.loads
    # Measured 3.6e-13 N m at most of 20: the slope of polynomials, whose rounding is magnified.
    assert np.abs(loads.motor_torques - right.motor_torques).max() < 2e-12
    # Measured 5.3e-15 rad of 10.
    assert np.abs(ours.theory.hinge_angles - exact.theory.hinge_angles).max() < 2e-14


def test_a_function_that_is_not_smooth_is_warned_of() -> None:
    """What its derivative costs, where, and what to give; with breakpoints there is no warning."""
    times = np.linspace(0.0, 1.0, 11)

    def rough(t: float) -> float:
        return 2 + 1e-3 * abs(t - 0.4) ** 0.25

    words = (
        r"a drive's function is not smooth at t = 0\.4 s: its derivative there follows it to "
        r"\S+ rad/s only; give Custom its breakpoints, or its derivative"
    )
    with pytest.warns(rb.SceneWarning, match=words):
        rb.integrate(replace(FIG12, frame_rate=rough), times)
    with warnings.catch_warnings(action="error"):
        kink = rb.Custom(lambda t: 2 + abs(t - 0.4), breakpoints=(0.4,))
        rb.integrate(replace(FIG12, frame_rate=kink), times)
