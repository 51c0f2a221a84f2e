"""Drives in time: rate, acceleration and angle are one another's derivatives and integrals."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

import robotball as rb
from robotball.drives import Constant, Drive, as_drive

DRIVES: dict[str, Drive] = {
    "constant": Constant(2.0),
    "linear": rb.Ramp(initial=1.0, final=3.0, start=0.5, end=2.0),
    "smooth": rb.Ramp(initial=1.0, final=-3.0, start=0.5, end=2.0, shape="smooth"),
    "quintic": rb.Ramp(initial=1.0, final=-3.0, start=0.5, end=2.0, shape="quintic"),
    "sine": rb.Sine(mean=1.0, amplitude=2.0, frequency=0.7, phase=0.3),
    "samples": rb.Samples(times=(-0.5, 0.4, 1.0, 1.1, 3.0), values=(1.0, 1.0, -2.0, 4.0, 0.5)),
    "sum": as_drive(
        rb.Sum((1.0, rb.Ramp(final=3.0, end=1.0), rb.Sine(amplitude=2.0, frequency=0.7), abs)), 3.0
    ),
    "function": as_drive(
        rb.Custom(lambda t: np.exp(-t) * np.cos(5 * t) + abs(t - 1), breakpoints=(1.0,)), 3.0
    ),
}


@pytest.mark.parametrize("name", DRIVES)
def test_the_angle_is_the_integral_of_the_rate(name: str) -> None:
    """By an independent quadrature, split at the breakpoints."""
    drive = DRIVES[name]
    edges = [0.0, *drive.breakpoints, 2.7]
    area = sum(quad(drive.rate, a, b, epsabs=1e-13)[0] for a, b in pairwise(edges))
    # Measured 1.3e-15 at most: rounding.
    assert drive.angle(2.7) == pytest.approx(area, abs=4e-15)
    assert drive.angle(0.0) == 0


@pytest.mark.parametrize("name", DRIVES)
def test_the_acceleration_is_the_derivative_of_the_rate(name: str) -> None:
    """By the integral's change: the rate at the end of a smooth piece is that of its start plus."""
    drive = DRIVES[name]
    for a, b in pairwise([0.0, *drive.breakpoints, 2.7]):
        gained = quad(drive.acceleration, a, b - 1e-13, epsabs=1e-12)[0]
        # Measured 8e-13 at most: what is left out at the end.
        assert gained == pytest.approx(drive.rate(b) - drive.rate(a), abs=4e-12)


@pytest.mark.parametrize("name", DRIVES)
def test_columns_of_times_give_columns(name: str) -> None:
    """A drive told a column of times answers as for each time."""
    drive, times = DRIVES[name], np.linspace(0.0, 3.0, 7)
    for tell in (drive.rate, drive.acceleration, drive.angle):
        np.testing.assert_allclose(tell(times), [tell(t) for t in times.tolist()], rtol=1e-14)


def test_a_quintic_ramp_starts_and_ends_without_a_jerk() -> None:
    """Acceleration and its slope are zero at both ends, to the cube and square of what is near."""
    ramp, near = rb.Ramp(final=1.0, end=1.0, shape="quintic"), 1e-4
    assert ramp.rate(0.5) == 0.5
    for t in (near, 1 - near):
        assert abs(ramp.acceleration(t)) == pytest.approx(30 * near**2, rel=3e-4)


def test_samples_are_passed_and_never_overshot() -> None:
    """At each sample its value; between two nothing beyond them, and the slope does not jump."""
    samples = DRIVES["samples"]
    assert isinstance(samples, rb.Samples)
    np.testing.assert_allclose(samples.rate(np.array(samples.times)), samples.values, atol=1e-15)
    for (a, b), ends in zip(pairwise(samples.times), pairwise(samples.values), strict=True):
        between = samples.rate(np.linspace(a, b, 101))
        assert min(ends) - 1e-15 < between.min()
        assert between.max() < max(ends) + 1e-15
    for t in samples.breakpoints:
        # The slope changes by 3600 /s² at most, over 1e-9 s.
        assert abs(samples.acceleration(t) - samples.acceleration(t - 1e-9)) < 5e-6


def test_a_sum_of_numbers_is_a_number() -> None:
    """So a steady scene stays one."""
    assert as_drive(rb.Sum((1.0, 2.0)), 10.0) == Constant(3.0)


def test_a_steep_ramp_is_no_jump() -> None:
    """A rotor that spins up within a microsecond is driven as any other."""
    steep = rb.Ramp(final=150.0, start=1.0, end=1.000001)
    assert as_drive(steep, 10.0) is steep
