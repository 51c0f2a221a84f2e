"""Drives and motors that cannot be are refused in one line, with the value."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.drives import as_drive
from tests.robotball.own_drive import OwnDrive, of_sine

FIG12 = rb.load_scene("fig12")


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
