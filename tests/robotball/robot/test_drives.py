"""Time-dependent drives: rates, derivatives, integrals and sampling errors."""

import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

import robotball as rb
from robotball.motion import path_error
from robotball.robot.drives import Constant, Drive, as_drive, sampling_error
from robotball.rotations import uneven
from tests.messages import naming
from tests.motions import pair_of
from tests.robotball.robot.own_drive import OwnDrive

END = 3.0  # s
FIG12 = rb.load_scene("fig12")

RATES: dict[str, rb.robot.drives.Rate] = {
    "constant": 2.0,
    "linear": rb.Ramp(initial=1.0, final=3.0, start=0.5, end=2.0),
    "smooth": rb.Ramp(initial=1.0, final=-3.0, start=0.5, end=2.0, shape="smooth"),
    "quintic": rb.Ramp(initial=1.0, final=-3.0, start=0.5, end=2.0, shape="quintic"),
    "sine": rb.Sine(mean=1.0, amplitude=2.0, frequency=0.7, phase=0.3),
    "samples": rb.Samples(times=(-0.5, 0.4, 1.0, 1.1, 3.0), values=(1.0, 1.0, -2.0, 4.0, 0.5)),
    "sum": rb.Sum((1.0, rb.Ramp(final=3.0, end=1.0), rb.Sine(amplitude=2.0, frequency=0.7), abs)),
    "kinked": rb.Custom(lambda t: np.exp(-t) * np.cos(5 * t) + abs(t - 1), breakpoints=(1.0,)),
    "sharp": lambda t: math.atan(30 * (t - 1)),
    "user-defined object": OwnDrive(),
}
DRIVES = {name: as_drive(rate, END) for name, rate in RATES.items()}
every_drive = pytest.mark.parametrize("drive", DRIVES.values(), ids=DRIVES)


@every_drive
def test_the_angle_is_the_integral_of_the_rate(drive: Drive) -> None:
    """Compared with a quadrature split at the breakpoints; arrays of times give arrays."""
    edges = [0.0, *drive.breakpoints, 2.7]
    area = sum(quad(drive.rate, a, b, epsabs=1e-13)[0] for a, b in pairwise(edges))
    # Measured 3.6e-15 at most, of 13 rad: rounding.
    assert drive.angle(2.7) == pytest.approx(area, abs=1e-14)
    assert drive.angle(0.0) == 0
    times = np.linspace(0.0, END, 7)
    for of_time in (drive.rate, drive.acceleration, drive.angle):
        values = [of_time(t) for t in times.tolist()]
        np.testing.assert_allclose(of_time(times), values, rtol=1e-14)


@every_drive
def test_the_acceleration_is_the_derivative_of_the_rate(drive: Drive) -> None:
    """Its integral over each smooth piece is the change of the rate."""
    for a, b in pairwise([0.0, *drive.breakpoints, 2.7]):
        gained = quad(drive.acceleration, a, b - 1e-13, epsabs=1e-12)[0]
        # Measured 1e-12 at most: the omitted end of the piece.
        assert gained == pytest.approx(drive.rate(b) - drive.rate(a), abs=4e-12)


def test_rates_follow_the_documented_formulas() -> None:
    """Before, within and after a ramp, and for a sine with a phase."""
    for name, t, rate in (
        ("linear", 0.2, 1.0),
        ("linear", 1.25, 2.0),
        ("linear", 2.5, 3.0),
        ("smooth", 0.875, 1 - 4 * (3 / 16 - 2 / 64)),
        ("smooth", 2.5, -3.0),
        ("quintic", 0.875, 1 - 4 * (10 / 64 - 15 / 256 + 6 / 1024)),
        ("sine", 0.4, 1 + 2 * math.sin(0.56 * math.pi + 0.3)),
        ("sum", 1.0, 5.0 + 2 * math.sin(1.4 * math.pi)),
    ):
        assert DRIVES[name].rate(t) == pytest.approx(rate, rel=1e-14)


def test_samples_are_interpolated_without_overshoot() -> None:
    """Between two samples the rate stays between their values, with a continuous slope."""
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


def test_a_sum_of_constants_is_a_constant_and_a_steep_ramp_is_allowed() -> None:
    """A steady scene stays steady, and a rotor may spin up within a microsecond."""
    assert as_drive(rb.Sum((1.0, 2.0)), 10.0) == Constant(3.0)
    nested = rb.Sum((1.0, rb.Sum((2.0, rb.Sum((3.0,))))))
    assert nested.terms == (1.0, 2.0, 3.0)
    assert as_drive(nested, 10.0) == Constant(6.0)
    steep = rb.Ramp(final=150.0, start=1.0, end=1.000001)
    assert as_drive(steep, 10.0) is steep


def only_on(end: float) -> Callable[[float], float]:
    """2 + sin(3t) from 0 to `end`, and an error elsewhere."""

    def rate(t: float) -> float:
        assert 0 <= t <= end
        return float(2 + np.sin(3 * t))

    return rate


@pytest.mark.parametrize("preset", ["fast", "exact"])
@pytest.mark.parametrize("end", [0.003, 0.5])
def test_a_function_is_evaluated_only_within_the_run(end: float, preset: str) -> None:
    """By both engines, for any duration of the scene and breakpoints at and beyond the end."""
    rate = rb.Custom(only_on(end), breakpoints=(0.0, end, 3 * end))
    scene = replace(FIG12.with_hinges(command={"frame": rate}), duration=0.3)
    assert pair_of(scene, preset, np.linspace(0.0, end, 11)).agrees


def test_a_function_that_is_not_smooth_gives_a_warning() -> None:
    """The warning names the time and the remedy; breakpoints avoid it."""
    times = np.linspace(0.0, 1.0, 3)
    cusp = rb.Custom(lambda t: 2 + 1e-3 * abs(t - 0.4) ** 0.25)
    with pytest.warns(rb.SceneWarning, match=naming("0.4~s breakpoints")):
        rb.integrate(FIG12.with_hinges(command={"frame": cusp}), times)
    with warnings.catch_warnings(action="error"):
        kink = rb.Custom(lambda t: 2 + abs(t - 0.4), breakpoints=(0.4,))
        rb.integrate(FIG12.with_hinges(command={"frame": kink}), times)


def test_the_sampling_error_of_a_sine_is_the_error_of_simpsons_rule() -> None:
    """sin(x)/x - (2 + cos x)/3 of its amplitude at the worst phase, also if it aliases.

    Frequencies below, at and beyond the first whose period divides the step.
    """
    step, stops = 5e-3, np.array([0.0, 0.7, 2.0])
    for frequency in (7.0, 50.0, 100.0, 199.0, 200.0, 201.0, 400.0, 1000.0, 12345.0):
        x = math.pi * frequency * step
        expected = abs(math.sin(x) / x - (2 + math.cos(x)) / 3) / 3  # of the largest rate
        sine = as_drive(rb.Sine(mean=2.0, amplitude=1.0, frequency=frequency), 2.0)
        # Measured 0.9998 at least.
        assert 0.999 < sampling_error([sine], stops, step) / expected < 1.001, frequency
    assert sampling_error([Constant(2.0)], stops, step) == 0.0


def test_cubics_between_breakpoints_have_no_sampling_error() -> None:
    """Samples and smooth ramps with any number of breakpoints, unless a breakpoint is missed."""
    times = np.linspace(0.0, END, 2001)
    samples = as_drive(rb.Samples(times=tuple(times), values=tuple(np.sin(40 * times))), END)
    for drive in (samples, DRIVES["smooth"]):
        # Measured 5.9e-15: rounding of a step of 1.5 ms.
        assert sampling_error([drive], np.array([0.0, *drive.breakpoints, END]), 0.02) < 6e-14
    # Measured 1.2e-3.
    assert sampling_error([DRIVES["samples"]], np.array([0.0, END]), 0.02) > 4e-4


def test_uneven_times_have_no_period() -> None:
    """They cover 0 to the end within the given spacing, and no sine vanishes at all of them."""
    times = uneven(2.0, 0.01)
    assert (times[0], times[-1]) == (0.0, 2.0)
    assert 0 < np.diff(times).min() < np.diff(times).max() <= 0.01
    for frequency in range(1, 1000):
        assert np.abs(np.sin(2 * np.pi * frequency * times)).max() > 0.998  # measured 0.9995


def bump(width: float, height: float) -> Callable[[float], float]:
    """2 rad/s and a smooth pulse within `width` [s] of an uneven time."""

    def rate(t: float) -> float:
        x = (t - 0.5012345) / width
        return 2 + height * (1 - x * x) ** 8 if abs(x) < 1 else 2.0

    return rate


LONG, SHORT = bump(6e-4, 0.03), bump(5e-5, 4e-3)
ENDS = (0.5012345 - 5e-5, 0.5012345, 0.5012345 + 5e-5)


@pytest.mark.parametrize(
    ("rate", "turned", "most"),
    [
        (LONG, 1.0784e-5, 2e-7),  # measured 6.4e-8
        (rb.Custom(SHORT, finest=5e-5), 1.1983e-7, 1.1e-6),  # 3.5e-7
        (rb.Custom(SHORT, breakpoints=ENDS), 1.1983e-7, 2e-9),  # 6.0e-10
    ],
    ids=["plain", "finest", "breakpoints"],
)
def test_both_engines_resolve_a_short_pulse(
    rate: rb.robot.drives.Rate, turned: float, most: float
) -> None:
    """A pulse of 1.2 ms with default settings, one of 0.1 ms with `finest` or breakpoints.

    The frame rotates by the area of the pulse; MuJoCo keeps steps of 5 ms elsewhere.
    """
    scene, times = FIG12.with_hinges(command={"frame": rate}), rb.sample_times(1.0)
    theory = rb.integrate(scene, times)
    assert theory.hinge_angles[-1, 0] - 2.0 == pytest.approx(turned, rel=1e-2)
    motion = rb.simulate(scene, times, settings="balanced")
    assert motion.report.faults == ()
    assert path_error(theory, motion) < most


def test_a_pulse_shorter_than_the_sampling_may_be_missed() -> None:
    """As documented in Custom."""
    drive = as_drive(SHORT, 1.0)
    assert drive.angle(1.0) == pytest.approx(2.0, abs=1e-14)
    assert drive.breakpoints == ()
    assert len(as_drive(rb.Custom(SHORT, finest=5e-5), 1.0).breakpoints) > 20  # 69
