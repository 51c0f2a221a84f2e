"""Functions of time as drives: polynomial approximation, derivatives, integrals and jumps."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.special import erf

from robotball.errors import InputError
from robotball.robot.drives import Constant, Ramp
from robotball.robot.function_drives import FunctionDrive, HeldCommand, polynomials_of
from tests.messages import naming

END = 3.0
TIMES = np.linspace(0.0, END, 1001)


Function = Callable[[Any], Any]
CASES: list[tuple[Function, Function, Function]] = [
    (lambda t: np.sin(7 * t), lambda t: 7 * np.cos(7 * t), lambda t: (1 - np.cos(7 * t)) / 7),
    (
        lambda t: np.exp(-((t - 1) ** 2)),
        lambda t: -2 * (t - 1) * np.exp(-((t - 1) ** 2)),
        lambda t: np.sqrt(np.pi) / 2 * (erf(t - 1) + erf(1)),
    ),
    (lambda t: t**3 - t, lambda t: 3 * t**2 - 1, lambda t: t**4 / 4 - t**2 / 2),
]


def approximated(
    function: Function, *breakpoints: float, finest: float | None = None
) -> FunctionDrive:
    return FunctionDrive(END, function, breakpoints, finest)


def test_derivative_and_integral_match_closed_forms() -> None:
    """For a sine, a bell curve and a polynomial.

    Measured 3e-12 rad/s² (1.5e-11 without AVX2), of up to 26, and 5e-15 rad: rounding.
    """
    for function, slope, area in CASES:
        drive = approximated(function)
        assert drive.rate(TIMES) == pytest.approx(function(TIMES), rel=1e-14)
        assert np.abs(drive.acceleration(TIMES) - slope(TIMES)).max() < 2e-11
        assert np.abs(drive.angle(TIMES) - area(TIMES)).max() < 5e-14
        assert drive.breakpoints == ()


def test_a_kink_at_a_breakpoint_is_exact_and_a_jump_is_refused() -> None:
    """With a breakpoint at its kink, |t - 1| is two lines; the error names the time of a jump."""
    kinked = approximated(lambda t: abs(t - 1.0), 1.0)
    assert kinked.polynomials.off.max() < 1e-14
    assert kinked.breakpoints == (1.0,)
    assert kinked.angle(3.0) == pytest.approx(2.5, abs=1e-14)
    assert (kinked.acceleration(0.999), kinked.acceleration(1.001)) == pytest.approx((-1, 1))
    with pytest.raises(InputError, match=naming("2~rad/s 1.…~s ramp")):
        approximated(lambda t: float(np.sign(t - 1.2345))).angle(1.0)


def test_finest_sets_the_shortest_pulse_that_is_resolved() -> None:
    """A pulse of 0.2 ms is missed by coarse sampling, and found with a `finest` of 20 μs."""

    def pulse(t: float) -> float:
        return 1.0 + float(np.exp(-(((t - 1.23457) / 1e-4) ** 2)))

    area = 1e-4 * np.sqrt(np.pi)
    assert approximated(pulse, finest=2e-5).angle(END) - END == pytest.approx(area, rel=1e-9)
    assert abs(approximated(pulse, finest=0.3).angle(END) - END) < 0.1 * area
    quick = approximated(pulse, finest=2e-5).breakpoints
    assert len(quick) > 10
    assert abs(np.mean(quick) - 1.23457) < 0.02


def test_the_integral_is_continuous_across_pieces() -> None:
    """The function is never evaluated outside its interval."""
    asked: list[float] = []

    def function(t: float) -> float:
        asked.append(t)
        return float(np.cos(t))

    pieces = polynomials_of(function, [0.5, 1.5, 4.0])
    assert (min(asked), max(asked)) == (0.5, 4.0)
    for edge in pieces.edges[1:-1].tolist():
        below, above = (pieces.area(edge + h) for h in (-1e-9, 1e-9))
        assert above - below == pytest.approx(2e-9 * np.cos(edge), abs=1e-14)
    assert pieces.area(4.0) == pytest.approx(np.sin(4.0) - np.sin(0.5), abs=1e-14)
    assert np.diff(pieces.edges).max() <= 0.5


def test_the_angle_of_held_commands_is_the_sum_over_their_intervals() -> None:
    """Exact for a ramp, a command replaced at the same time, and a last one."""
    held = HeldCommand(Ramp(initial=0.0, final=2.0, start=0.0, end=2.0, shape="linear"))
    for t, rate in ((2.0, -1.0), (2.0, 3.0), (4.0, 0.5)):
        held.hold(t, Constant(rate))
    turned = {0.0: 0.0, 1.0: 0.5, 2.0: 2.0, 3.0: 5.0, 4.0: 8.0, 6.0: 9.0}
    assert [held.angle(t) for t in turned] == list(turned.values())
    assert held.angle(np.array([*turned])) == pytest.approx([*turned.values()], abs=0)
