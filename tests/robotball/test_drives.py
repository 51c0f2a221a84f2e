"""Drives in time: their calculus, and both engines' motion under them."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

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
    "sine": rb.Sine(mean=1.0, amplitude=2.0, frequency=0.7, phase=0.3),
    "custom": rb.Custom(lambda t: np.exp(-t) * np.cos(5 * t) + abs(t - 1), breakpoints=(1.0,)),
}


@pytest.mark.parametrize("name", DRIVES)
def test_the_angle_is_the_integral_of_the_rate(name: str) -> None:
    """By an independent quadrature, split at the breakpoints."""
    drive = DRIVES[name]
    edges = [0.0, *drive.breakpoints, 2.7]
    area = sum(quad(drive.rate, a, b, epsabs=1e-13)[0] for a, b in pairwise(edges))
    # Measured 4.4e-16 at most: rounding.
    assert drive.angle(2.7) == pytest.approx(area, abs=4e-15)
    assert drive.angle(0.0) == 0


@pytest.mark.parametrize("name", DRIVES)
def test_the_acceleration_is_the_derivative_of_the_rate(name: str) -> None:
    """By the integral's change: the rate at the end of a smooth piece is that of its start plus."""
    drive = DRIVES[name]
    for a, b in pairwise([0.0, *drive.breakpoints, 2.7]):
        gained = quad(drive.acceleration, a, b - 1e-13, epsabs=1e-12)[0]
        # Measured 1.4e-10 (custom, by differences) and 8e-13 at most else.
        tolerance = 5e-10 if name == "custom" else 4e-12
        assert gained == pytest.approx(drive.rate(b) - drive.rate(a), abs=tolerance)


@pytest.mark.parametrize("name", DRIVES)
def test_columns_of_times_give_columns(name: str) -> None:
    """A drive told a column of times answers as for each time."""
    drive, times = DRIVES[name], np.linspace(0.0, 3.0, 7)
    for tell in (drive.rate, drive.acceleration, drive.angle):
        np.testing.assert_allclose(tell(times), [tell(t) for t in times.tolist()], rtol=1e-14)


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
}


@pytest.mark.slow
@pytest.mark.parametrize("rolling", ROLLING_MODELS)
@pytest.mark.parametrize("name", UNSTEADY)
def test_order_four_is_kept_under_drives_in_time(name: str, rolling: Any) -> None:
    """From 20 to 5 ms the error falls by four to the fourth, breakpoints or not.

    Measured orders 3.75 to 4.07; path errors at balanced 1.2e-9 to 2.9e-8.
    """
    scene = replace(FIG12, rolling=rolling, **UNSTEADY[name])
    coarse, fine = (compare(scene, settings).path_error for settings in ("fast", "balanced"))
    assert coarse is not None
    assert fine is not None
    assert fine < 9e-8
    assert 3.7 < np.log(coarse / fine) / np.log(4) < 4.3


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


def test_a_torque_limit_that_is_reached_is_reported() -> None:
    """A servo at its limit loses the rate, and the run says from when."""
    weak = (rb.Servo(gain=100.0, torque_limit=3.0), None)
    agreement = compare(replace(FIG12, motors=weak), "balanced")
    assert agreement.finished
    assert "frame's motor at its torque limit" in [fault.text for fault in agreement.faults]
    assert np.abs(agreement.motion.loads.motor_torques[:, 0]).max() == pytest.approx(3.0, rel=1e-6)


def test_a_steep_ramp_is_no_jump() -> None:
    """A rotor that spins up within a microsecond is driven as any other."""
    steep = rb.Ramp(final=150.0, start=1.0, end=1.000001)
    assert as_drive(steep) is steep


REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "a jump": (
        lambda: as_drive(rb.Custom(lambda t: float(t > 1), breakpoints=(1.0,))),
        r"a drive's rate jumps by 1 rad/s at t = 1 s; ramp it",
    ),
    "no number": (lambda: as_drive(lambda t: np.nan), r"function gives nan at t = 0 s"),
    "no number later": (
        lambda: rb.integrate(replace(FIG12, frame_rate=lambda t: np.nan if t > 2 else 2.0)),
        r"function gives nan at t = 2\.\d+ s; it must be finite",
    ),
    "a ramp backwards": (
        lambda: rb.Ramp(final=1.0, start=2.0, end=1.0),
        r"a ramp must start at 0 or later and end after that, not from 2 to 1 s",
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
