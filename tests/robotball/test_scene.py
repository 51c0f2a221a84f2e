"""Scene: what it refuses where no file has checked, and its sample times."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import robotball as rb
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
