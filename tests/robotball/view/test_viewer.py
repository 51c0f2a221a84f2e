"""The viewer: keys control its clock; a missing display is reported."""

import pytest

import robotball as rb
from robotball.view.viewer import Clock, check_display
from tests.messages import naming

SPACE, HOME, RIGHT, LEFT, DOWN, UP = 32, 268, 262, 263, 264, 265  # GLFW's key codes


def test_keys_pause_scrub_and_change_the_speed() -> None:
    """The time stays within the motion."""
    clock = Clock(end=2.0)
    for code, seconds, t in (
        (None, 0.25, 0.25), (UP, 0.25, 0.75), (SPACE, 1.0, 0.75), (RIGHT, 0, 1.25),
        (RIGHT, 0, 1.75), (RIGHT, 0, 2.0), (LEFT, 0, 1.5), (HOME, 0, 0.0), (LEFT, 0, 0.0),
        (DOWN, 0, 0.0), (SPACE, 1.5, 1.5), (None, 1.0, 0.0),  # restarted
    ):  # fmt: skip
        if code is not None:
            clock.key(code)
        clock.pass_on(seconds)
        assert clock.t == t


@pytest.mark.parametrize("display", [None, ":4711"])
def test_without_a_display_the_error_names_the_alternative(
    monkeypatch: pytest.MonkeyPatch, display: str | None
) -> None:
    """No display is set, or the one that is set does not respond."""
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    if display is not None:
        monkeypatch.setenv("DISPLAY", display)
    with pytest.raises(rb.InputError, match=naming("display --web")):
        check_display()
