"""Users' functions of time, followed by polynomials: values, slopes and integrals, jumps."""

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


def followed(function: Function, *named: float, finest: float | None = None) -> FunctionDrive:
    return FunctionDrive(END, function, named, finest)


def test_slope_and_integral_are_those_of_the_function() -> None:
    """Of a sine, a bell and a polynomial, by closed forms.

    Measured 3e-12 rad/s² (1.5e-11 without AVX2, of slopes up to 26) and 5e-15 rad: roundings.
    """
    for function, slope, area in CASES:
        drive = followed(function)
        assert drive.rate(TIMES) == pytest.approx(function(TIMES), rel=1e-14)
        assert np.abs(drive.acceleration(TIMES) - slope(TIMES)).max() < 2e-11
        assert np.abs(drive.angle(TIMES) - area(TIMES)).max() < 5e-14
        assert drive.breakpoints == ()


def test_a_kink_that_is_named_costs_nothing_and_a_jump_is_refused() -> None:
    """|t - 1| is two lines where its kink is a breakpoint; a step is told with its place."""
    kinked = followed(lambda t: abs(t - 1.0), 1.0)
    assert kinked.polynomials.off.max() < 1e-14
    assert kinked.breakpoints == (1.0,)
    assert kinked.angle(3.0) == pytest.approx(2.5, abs=1e-14)
    assert (kinked.acceleration(0.999), kinked.acceleration(1.001)) == pytest.approx((-1, 1))
    with pytest.raises(InputError, match=naming("2~rad/s 1.…~s ramp")):
        followed(lambda t: float(np.sign(t - 1.2345))).angle(1.0)


def test_a_function_is_looked_at_as_finely_as_it_says() -> None:
    """A pulse of 0.2 ms between two looks is not seen, and is with a `finest` of a tenth of it."""

    def pulse(t: float) -> float:
        return 1.0 + float(np.exp(-(((t - 1.23457) / 1e-4) ** 2)))

    area = 1e-4 * np.sqrt(np.pi)
    assert followed(pulse, finest=2e-5).angle(END) - END == pytest.approx(area, rel=1e-9)
    assert abs(followed(pulse, finest=0.3).angle(END) - END) < 0.1 * area
    quick = followed(pulse, finest=2e-5).breakpoints
    assert len(quick) > 10
    assert abs(np.mean(quick) - 1.23457) < 0.02


def test_pieces_follow_one_another_and_end_where_they_should() -> None:
    """The integral is continuous across edges, and asked beyond neither end."""
    asked: list[float] = []

    def function(t: float) -> float:
        asked.append(t)
        return float(np.cos(t))

    found = polynomials_of(function, [0.5, 1.5, 4.0])
    assert (min(asked), max(asked)) == (0.5, 4.0)
    for edge in found.edges[1:-1].tolist():
        below, above = (found.area(edge + h) for h in (-1e-9, 1e-9))
        assert above - below == pytest.approx(2e-9 * np.cos(edge), abs=1e-14)
    assert found.area(4.0) == pytest.approx(np.sin(4.0) - np.sin(0.5), abs=1e-14)
    assert np.diff(found.edges).max() <= 0.5


def test_held_commands_turn_as_far_as_each_while_it_is_held() -> None:
    """A ramp, a command that another replaces at once, and a last one; at some and at all times.

    As exact as the numbers are.
    """
    held = HeldCommand(Ramp(initial=0.0, final=2.0, start=0.0, end=2.0, shape="linear"))
    for t, rate in ((2.0, -1.0), (2.0, 3.0), (4.0, 0.5)):
        held.hold(t, Constant(rate))
    turned = {0.0: 0.0, 1.0: 0.5, 2.0: 2.0, 3.0: 5.0, 4.0: 8.0, 6.0: 9.0}
    assert [held.angle(t) for t in turned] == list(turned.values())
    assert held.angle(np.array([*turned])) == pytest.approx([*turned.values()], abs=0)
