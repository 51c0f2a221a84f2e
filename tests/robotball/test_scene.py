"""Scene: what it refuses where no file has checked, and its sample times."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import robotball as rb
from robotball.rotations import Array
from robotball.scene import Start

NAN = float("nan")
SCENE = rb.load_scene("fig12")


@given(duration=st.floats(1e-3, 100.0), interval=st.floats(1e-3, 10.0))
def test_sample_times_are_equal_and_no_further_apart_than_asked(
    duration: float, interval: float
) -> None:
    """From 0 to the duration exactly, in the fewest equal intervals that are short enough."""
    times = rb.sample_times(duration, interval)
    assert times[0] == 0
    assert times[-1] == duration
    steps = np.diff(times)
    # Rounding of the last times, relative to the duration: measured 3.7e-16.
    assert np.ptp(steps) <= 2e-15 * duration
    assert steps.max() <= interval * (1 + 1e-9)
    assert len(steps) == 1 or duration / (len(steps) - 1) > interval * (1 - 1e-9)


@pytest.mark.parametrize("duration", [0.0, -1.0, NAN, float("inf")])
def test_sample_times_need_a_duration(duration: float) -> None:
    """No duration, no times: an InputError with the value."""
    with pytest.raises(rb.InputError, match=f"duration must be positive and finite.*{duration:g}"):
        rb.sample_times(duration)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rolling": "sliding"}, r"rolling must be one of .* not 'sliding'"),
        ({"duration": 0.0}, "duration must be positive and finite, not 0 s"),
        ({"gravity": -9.81}, r"gravity must be positive and finite, not -9\.81 m/s²"),
        ({"rotor_rates": ()}, "1 rotors need as many rates, not 0"),
        ({"frame_rate": NAN}, "a drive's rate at t = 0 s must be finite and .*not nan rad/s"),
        ({"rotor_rates": (NAN,)}, "a drive's rate at t = 0 s must be finite and .*not nan rad/s"),
        (
            {"start": Start(np.array([1.0, 0.0, 0.0, NAN]), np.zeros(3))},
            "attitude is not of unit length: .attitude. = nan",
        ),
        (
            {"start": Start(np.array([1.0, 0.0, 0.0, 0.0]), np.array([NAN, 0.0, 0.0]))},
            "the start's momentum must be finite",
        ),
    ],
)
def test_scene_built_by_hand_is_checked_as_one_from_a_file(
    changes: dict[str, Any], message: str
) -> None:
    """A wrong rolling model, duration, gravity, number of rates or start is an InputError."""
    with pytest.raises(rb.InputError, match=message):
        replace(SCENE, **changes)


def test_the_scale_of_momentum_is_that_of_what_turns_the_ball() -> None:
    """|M|; of a start from rest 0.3 (|K| + d|Ω|); d √(g/a) where nothing turns, or K is no number.

    K = (2, 2, 0), Ω = 2 rad/s and d = 0.9 kg m² of Fig. 12, and the same ball four times as large.
    """
    at_rest = replace(SCENE, start=Start(SCENE.start.attitude, np.zeros(3)))
    assert SCENE.momentum_scale == pytest.approx(5.0, rel=1e-14)
    assert at_rest.momentum_scale == pytest.approx(0.3 * (8**0.5 + 0.9 * 2), rel=1e-14)
    shell = replace(SCENE.ball.shell, radius=4.0)
    large = replace(at_rest, ball=replace(SCENE.ball, shell=shell), gravity=9.0)
    still = replace(large, frame_rate=0.0, rotor_rates=(0.0,))
    motors = (rb.Servo(gain=1.0), rb.Servo(gain=1.0))
    for scene in (still, replace(large, motors=motors)):
        assert scene.momentum_scale == pytest.approx(0.9 * 16 * (9 / 4) ** 0.5, rel=1e-14)


def test_the_load_varies_with_what_swings_off_its_pivot() -> None:
    """Two wheels on their pivots either side of the centre leave the ball in balance; two that hang
    beside their pivots do so at this angle alone.
    """
    place = np.array([0.2, 0.0, 0.0])

    def with_wheels(centre: Array) -> rb.Scene:
        wheels = tuple(
            rb.Pendulum(0.1, 1e-3 * np.eye(3), sign * centre, np.eye(3)[2], sign * place)
            for sign in (1, -1)
        )
        return replace(SCENE, ball=replace(SCENE.ball, pendulums=wheels), pendulum_rates=(1.0, 2.0))

    assert not with_wheels(place).load_varies
    assert with_wheels(-place).load_varies
    assert with_wheels(0 * place).load_varies
