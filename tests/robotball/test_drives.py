"""Drives in time: their calculus, and both engines' motion under them."""

import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

import robotball as rb
from robotball.drives import Constant, Drive, as_drive
from robotball.engines.mujoco.stepping import stretches
from robotball.parameters import ROLLING_MODELS
from validation import compare

FIG12 = rb.load_scene("fig12")
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


UNSTEADY: dict[str, dict[str, Any]] = {
    "ramp across samples": {"frame_rate": rb.Ramp(initial=2.0, final=4.0, start=1.233, end=3.217)},
    "smooth ramps": {
        "frame_rate": rb.Ramp(initial=2.0, final=4.0, start=1.0, end=3.0, shape="smooth"),
        "rotor_rates": (rb.Ramp(initial=148.0, final=-148.0, start=0.5, end=8.0),),
    },
    "sines": {
        "frame_rate": rb.Sine(mean=2.0, amplitude=1.0, frequency=0.5),
        "rotor_rates": (rb.Sine(mean=148.0, amplitude=20.0, frequency=0.8),),
    },
    "a function": {"frame_rate": lambda t: 2 + np.sin(3 * t)},
    "samples": {
        "frame_rate": rb.Samples(
            times=tuple(np.linspace(0, 10, 41).tolist()),
            values=tuple((2 + np.sin(np.linspace(0, 10, 41))).tolist()),
        )
    },
    "a sum": {
        "frame_rate": rb.Sum(
            (2.0, rb.Ramp(final=1.0, start=1.1, end=2.0), rb.Sine(amplitude=0.5, frequency=0.6))
        )
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("rolling", ROLLING_MODELS)
@pytest.mark.parametrize("name", UNSTEADY)
def test_order_four_is_kept_under_drives_in_time(name: str, rolling: Any) -> None:
    """From 20 to 5 ms the error falls by four to the fourth, breakpoints or not.

    Measured orders 3.60 (samples) to 4.07; path errors at balanced 1.2e-9 to 2.9e-8.
    """
    scene = replace(FIG12, rolling=rolling, **UNSTEADY[name])
    coarse, fine = (compare(scene, settings).path_error for settings in ("fast", "balanced"))
    assert coarse is not None
    assert fine is not None
    assert fine < 9e-8
    assert 3.5 < np.log(coarse / fine) / np.log(4) < 4.3


def test_the_second_form_agrees_under_drives_in_time() -> None:
    """λ₀, forces and torques of (2.4)-(2.5), with dΩ/dt and dk/dt, at MuJoCo's own states."""
    scene = replace(FIG12, **UNSTEADY["sines"])
    agreement = compare(scene, "accurate")
    ours, theirs = agreement.motion.loads, agreement.theory.loads
    # Measured 2.2e-9 N m, 2.7e-9 N and 3.6e-9 N m, of 10 to 20: RK4's error, and the rounding of
    # the armature's torque.
    assert np.abs(ours.motor_torques - theirs.motor_torques).max() < 1.2e-8
    assert np.abs(ours.contact_force - theirs.contact_force).max() < 1.2e-8
    assert np.abs(ours.spin_torque - theirs.spin_torque).max() < 1.2e-8


def test_power_is_torque_times_rate() -> None:
    """What the motors put in is an observable of both engines."""
    agreement = compare(FIG12, "balanced")
    ours, theirs = agreement.motion.motor_powers, agreement.theory.motor_powers
    assert np.abs(theirs).max() > 10  # W
    # Measured 2.3e-6 W of 40: RK4's error.
    assert np.abs(ours - theirs).max() < 1e-5


@pytest.mark.slow
def test_a_torque_limit_that_is_reached_is_reported() -> None:
    """A servo at its limit loses the rate; it is no fault, and the run says from when."""
    weak = (rb.Servo(gain=100.0, torque_limit=3.0), None)
    agreement = compare(replace(FIG12, motors=weak), "balanced")
    assert agreement.finished
    assert agreement.faults == ()
    assert "frame's motor at its torque limit" in [note.text for note in agreement.report.notes]
    assert np.abs(agreement.motion.loads.motor_torques[:, 0]).max() == pytest.approx(3.0, rel=1e-6)


def test_a_steep_ramp_is_no_jump() -> None:
    """A rotor that spins up within a microsecond is driven as any other."""
    steep = rb.Ramp(final=150.0, start=1.0, end=1.000001)
    assert as_drive(steep, 10.0) is steep


# Rates given by functions ------------------------------------------------------------------


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


def of_sine(t: float) -> float:
    return 2 + math.sin(6 * t)


FORMS: dict[str, rb.Custom | Drive | Callable[[float], float]] = {
    "a function alone": of_sine,
    "with its derivative": rb.Custom(of_sine, derivative=lambda t: 6 * math.cos(6 * t)),
    "with its integral": rb.Custom(of_sine, integral=lambda t: 2 * t - math.cos(6 * t) / 6),
}


class OwnDrive:
    """A drive of the user's own: nothing of the library's, but the members of one."""

    breakpoints = ()

    def rate(self, t: float) -> float:
        return of_sine(t)

    def acceleration(self, t: float) -> float:
        return 6 * math.cos(6 * t)

    def angle(self, t: float) -> float:
        return 2 * t + (1 - math.cos(6 * t)) / 6


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


class Jumping(OwnDrive):
    """One that forgot a breakpoint."""

    def rate(self, t: float) -> float:
        return of_sine(t) + 2.0 * (t > 4)


def run(rate: Any) -> rb.Motion:
    """What the equations make of a rate, over 10 s."""
    return rb.integrate(replace(FIG12, frame_rate=rate))


REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "a jump": (
        lambda: run(rb.Custom(lambda t: float(t > 1), breakpoints=(1.0,))),
        r"a drive's rate jumps by 1 rad/s at t = 1 s; ramp it",
    ),
    "a jump that no breakpoint tells": (
        lambda: run(lambda t: 2.0 if t < 3.3 else 2.5),
        r"a drive's rate jumps by 0\.5 rad/s at t = 3\.3 s; ramp it",
    ),
    "a jump of an object of one's own": (
        lambda: run(Jumping()),
        r"a drive's rate jumps by 2 rad/s at t = 4 s; ramp it",
    ),
    "a derivative of something else": (
        lambda: run(rb.Custom(of_sine, derivative=lambda t: -6 * math.cos(6 * t))),
        r"the derivative given for a drive is -\S+ rad/s² at t = \S+ s, where that of its function",
    ),
    "an integral of something else": (
        lambda: run(rb.Custom(of_sine, integral=lambda t: 2 * t)),
        r"the integral given for a drive is \S+ rad at t = \S+ s, where that of its function is",
    ),
    "no rate at all": (
        lambda: run("fast"),
        r"a rate is a number, a function of time, or a drive .*, not 'fast'",
    ),
    "a function for days": (
        lambda: rb.integrate(replace(FIG12, frame_rate=of_sine), np.array([0.0, 1e6])),
        r"a drive's function can be followed to t = 100000 s at most, not to 1e\+06 s",
    ),
    "no number": (lambda: as_drive(lambda t: np.nan, 1.0), r"function gives nan at t = 0 s"),
    "no number later": (
        lambda: rb.integrate(replace(FIG12, frame_rate=lambda t: np.nan if t > 2 else 2.0)),
        r"function gives nan at t = 2\.\d+ s; it must be finite",
    ),
    "a ramp backwards": (
        lambda: rb.Ramp(final=1.0, start=2.0, end=1.0),
        r"a ramp must start at 0 or later and end after that, not from 2 to 1 s",
    ),
    "samples that end early": (
        lambda: run(rb.Samples(times=(0.0, 8.0), values=(0.0, 1.0))),
        r"samples from t = 0 to 8 s do not reach over the run, from 0 to 10 s; give more",
    ),
    "samples that start late": (
        lambda: as_drive(rb.Samples(times=(1.0, 8.0), values=(0.0, 1.0)), 5.0),
        r"samples from t = 1 to 8 s do not reach over the run, from 0 to 5 s",
    ),
    "one sample": (
        lambda: rb.Samples(times=(1.0,), values=(0.0,)),
        r"two or more: not 1 times and 1 values",
    ),
    "samples out of order": (
        lambda: rb.Samples(times=(0.0, 1.0, 1.0), values=(0.0, 1.0, 2.0)),
        r"the times of samples must increase: time 3 is 1 s, after 1 s",
    ),
    "a sample that is no number": (
        lambda: rb.Samples(times=(0.0, 1.0), values=(0.0, math.nan)),
        r"value 2 of the samples must be finite",
    ),
    "a sum of nothing": (lambda: rb.Sum(()), "a sum needs at least one rate"),
    "a function that fails": (
        lambda: run(lambda t: 1 / (t - 4)),
        r"a drive's function fails at t = 4 s: ZeroDivisionError: ",
    ),
    "a part of a sum that fails": (
        lambda: run(rb.Sum((1.0, lambda t: math.sqrt(4.5 - t)))),
        r"a drive's function fails at t = \S+ s: ValueError: ",
    ),
    "no frequency": (
        lambda: rb.Sine(amplitude=1.0, frequency=0.0),
        r"a sine's frequency must be positive and finite, not 0 Hz",
    ),
    "no gain": (lambda: rb.Servo(gain=0.0), r"a servo's gain must be positive"),
    "too few motors": (
        lambda: replace(FIG12, motors=(None,)),
        r"2 hinges need as many motors, or none, not 1",
    ),
    "steady numbers of an unsteady scene": (
        lambda: replace(FIG12, frame_rate=rb.Sine(amplitude=1.0, frequency=1.0)).parameters,
        r"the drives change in time; use parameters_at",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_drives_that_cannot_be_are_refused(name: str) -> None:
    """One line each, with the value."""
    do, words = REFUSED[name]
    with pytest.raises(rb.InputError, match=words):
        do()


def test_steps_end_on_every_sample_and_breakpoint() -> None:
    """Spans are divided evenly, none longer than the timestep, in stretches of bounded length."""
    times, breaks = np.array([0.0, 0.013, 40.0]), (0.5, 7.0)
    parts = list(stretches(times, breaks, timestep=1e-3))
    edges = np.concatenate([part.ends for part in parts])
    counts = np.concatenate([part.counts for part in parts])
    assert set(np.round(edges[:, 1], 9)) >= {0.013, 0.5, 7.0, 40.0}
    np.testing.assert_allclose(edges[1:, 0], edges[:-1, 1], rtol=1e-12)
    assert all(part.counts.sum() <= 2 * 4096 for part in parts)
    assert counts.sum() == 40_001 - 1
    starts = np.concatenate(
        [
            part.samples + before
            for part, before in zip(
                parts, np.cumsum([0, *(int(part.counts.sum()) for part in parts[:-1])]), strict=True
            )
        ]
    )
    assert starts.tolist() == [0, 13]
