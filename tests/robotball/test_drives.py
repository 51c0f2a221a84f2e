"""Drives in time: rate, acceleration and angle are one another's derivatives and integrals."""

import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

import robotball as rb
from robotball.drives import Constant, Drive, as_drive
from tests.robotball.own_drive import OwnDrive, of_sine
from validation import compare

END = 3.0  # s
FIG12 = rb.load_scene("fig12")

RATES: dict[str, rb.drives.Rate] = {
    "constant": 2.0,
    "linear": rb.Ramp(initial=1.0, final=3.0, start=0.5, end=2.0),
    "smooth": rb.Ramp(initial=1.0, final=-3.0, start=0.5, end=2.0, shape="smooth"),
    "quintic": rb.Ramp(initial=1.0, final=-3.0, start=0.5, end=2.0, shape="quintic"),
    "sine": rb.Sine(mean=1.0, amplitude=2.0, frequency=0.7, phase=0.3),
    "samples": rb.Samples(times=(-0.5, 0.4, 1.0, 1.1, 3.0), values=(1.0, 1.0, -2.0, 4.0, 0.5)),
    "sum": rb.Sum((1.0, rb.Ramp(final=3.0, end=1.0), rb.Sine(amplitude=2.0, frequency=0.7), abs)),
    "kinked": rb.Custom(lambda t: np.exp(-t) * np.cos(5 * t) + abs(t - 1), breakpoints=(1.0,)),
    "sharp": lambda t: math.atan(30 * (t - 1)),
    "with its derivative": rb.Custom(of_sine, derivative=lambda t: 6 * math.cos(6 * t)),
    "with its integral": rb.Custom(of_sine, integral=lambda t: 2 * t - math.cos(6 * t) / 6),
    "an object of one's own": OwnDrive(),
}
DRIVES = {name: as_drive(rate, END) for name, rate in RATES.items()}
every_drive = pytest.mark.parametrize("drive", DRIVES.values(), ids=DRIVES)


@every_drive
def test_the_angle_is_the_integral_of_the_rate(drive: Drive) -> None:
    """By an independent quadrature, split at the breakpoints; columns of times give columns."""
    edges = [0.0, *drive.breakpoints, 2.7]
    area = sum(quad(drive.rate, a, b, epsabs=1e-13)[0] for a, b in pairwise(edges))
    # Measured 3.6e-15 at most, of 13 rad: rounding.
    assert drive.angle(2.7) == pytest.approx(area, abs=1e-14)
    assert drive.angle(0.0) == 0
    times = np.linspace(0.0, END, 7)
    for of_time in (drive.rate, drive.acceleration, drive.angle):
        each = [of_time(t) for t in times.tolist()]
        np.testing.assert_allclose(of_time(times), each, rtol=1e-14)


@every_drive
def test_the_acceleration_is_the_derivative_of_the_rate(drive: Drive) -> None:
    """By the integral's change: the rate at the end of a smooth piece is that of its start plus."""
    for a, b in pairwise([0.0, *drive.breakpoints, 2.7]):
        gained = quad(drive.acceleration, a, b - 1e-13, epsabs=1e-12)[0]
        # Measured 1e-12 at most: what is left out at the end.
        assert gained == pytest.approx(drive.rate(b) - drive.rate(a), abs=4e-12)


def test_a_rate_is_the_one_asked_for() -> None:
    """Before, within and after a ramp, and with a sine's phase, by the formulas of the docs."""
    for name, t, rate in (
        ("linear", 0.2, 1.0), ("linear", 1.25, 2.0), ("linear", 2.5, 3.0),
        ("smooth", 0.875, 1 - 4 * (3 / 16 - 2 / 64)), ("smooth", 2.5, -3.0),
        ("quintic", 0.875, 1 - 4 * (10 / 64 - 15 / 256 + 6 / 1024)),
        ("sine", 0.4, 1 + 2 * math.sin(0.56 * math.pi + 0.3)),
        ("sum", 1.0, 5.0 + 2 * math.sin(1.4 * math.pi)),
    ):  # fmt: skip
        assert DRIVES[name].rate(t) == pytest.approx(rate, rel=1e-14)


def test_samples_are_passed_and_never_overshot() -> None:
    """At each sample its value; between two nothing beyond them, and the slope does not jump."""
    samples = DRIVES["samples"]
    assert isinstance(samples, rb.Samples)
    np.testing.assert_allclose(samples.rate(np.array(samples.times)), samples.values, atol=1e-15)
    for (a, b), ends in zip(pairwise(samples.times), pairwise(samples.values), strict=True):
        between = samples.rate(np.linspace(a, b, 101))
        assert min(ends) - 1e-15 < between.min()
        assert between.max() < max(ends) + 1e-15
    # The slope changes by 3600 /s² at most, over 1e-9 s.
    slopes = [samples.acceleration(np.array(samples.breakpoints) - early) for early in (0.0, 1e-9)]
    assert np.abs(slopes[0] - slopes[1]).max() < 5e-6


def test_a_sum_of_numbers_is_a_number_and_a_steep_ramp_is_no_jump() -> None:
    """So a steady scene stays one, and a rotor may spin up within a microsecond."""
    assert as_drive(rb.Sum((1.0, 2.0)), 10.0) == Constant(3.0)
    steep = rb.Ramp(final=150.0, start=1.0, end=1.000001)
    assert as_drive(steep, 10.0) is steep


def only_on(end: float) -> Callable[[float], float]:
    """2 + sin(3t) from 0 to `end`, and an error elsewhere."""

    def rate(t: float) -> float:
        assert 0 <= t <= end
        return float(2 + np.sin(3 * t))

    return rate


@pytest.mark.parametrize("preset", ["fast", "adaptive"])
@pytest.mark.parametrize("end", [0.003, 0.5])
def test_a_function_is_asked_within_the_run_alone(end: float, preset: str) -> None:
    """Whatever the scene's duration: by both engines, breakpoints at and beyond the end."""
    rate = rb.Custom(only_on(end), breakpoints=(0.0, end, 3 * end))
    scene = replace(FIG12.with_hinges(command={"frame": rate}), duration=0.3)
    assert compare(scene, preset, np.linspace(0.0, end, 11)).agrees


def test_a_function_that_is_not_smooth_is_warned_of() -> None:
    """The warning has the cost, the place and a remedy; with breakpoints there is none."""
    times = np.linspace(0.0, 1.0, 3)
    words = (
        r"a drive's function is not smooth at t = 0\.4 s: its derivative there follows it to "
        r"\S+ rad/s only; give Custom its breakpoints, or its derivative"
    )
    cusp = rb.Custom(lambda t: 2 + 1e-3 * abs(t - 0.4) ** 0.25)
    with pytest.warns(rb.SceneWarning, match=words):
        rb.integrate(FIG12.with_hinges(command={"frame": cusp}), times)
    with warnings.catch_warnings(action="error"):
        kink = rb.Custom(lambda t: 2 + abs(t - 0.4), breakpoints=(0.4,))
        rb.integrate(FIG12.with_hinges(command={"frame": kink}), times)
