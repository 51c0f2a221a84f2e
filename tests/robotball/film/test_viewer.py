"""The viewer: the stage stands as the motion does, keys move its clock, no display is a line."""

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.files.export import poses
from robotball.film.looks import looks_of
from robotball.film.stage import build_stage, pose
from robotball.film.tracks import track_of
from robotball.film.viewer import (
    DOWN,
    HOME,
    LEFT,
    RIGHT,
    SPACE,
    UP,
    Clock,
    check_display,
)
from robotball.rotations import rotation_matrix
from tests.robots import worked


@pytest.mark.parametrize("name", ["three_rotors", "W4"])
def test_the_stage_s_bodies_stand_as_the_motion_s(name: str) -> None:
    """Both balls, by the poses of the library; measured 4e-16 of a matrix."""
    scene = worked(name) if name == "W4" else rb.load_scene(name)
    times = np.linspace(0.0, 0.4, 21)
    motion = rb.integrate(scene, times)
    track, looks = track_of(motion), looks_of(scene.ball)
    stands = track.stands(track.at(times[-1:]))
    model = build_stage(looks, ["#0072B2", "#D55E00"], [1.0, 0.35]).compile()
    data = mujoco.MjData(model)
    ordered = {body: stands[body] for body in looks}
    pose(data, [ordered, ordered])
    mujoco.mj_kinematics(model, data)
    for body, wanted in poses(motion).items():
        turn = rotation_matrix(wanted.attitude[-1])
        for ball in ("ball0_", "ball1_"):
            assert np.abs(data.body(ball + body).xmat.reshape(3, 3) - turn).max() < 1e-14


def test_keys_pause_scrub_and_change_the_speed() -> None:
    """The time never leaves the motion's own."""
    clock = Clock(end=2.0)
    clock.pass_on(0.25)
    assert clock.t == 0.25
    clock.key(UP)
    clock.pass_on(0.25)
    assert clock.t == 0.75
    clock.key(SPACE)
    clock.pass_on(1.0)
    assert clock.t == 0.75
    for code, t in (
        (RIGHT, 1.25),
        (RIGHT, 1.75),
        (RIGHT, 2.0),
        (LEFT, 1.5),
        (HOME, 0.0),
        (LEFT, 0),
    ):
        clock.key(code)
        assert clock.t == t
    clock.key(DOWN)
    assert clock.speed == 1.0
    clock.key(SPACE)
    clock.pass_on(2.5)
    assert clock.t == 0.0  # begun anew


@pytest.mark.parametrize("display", [None, ":4711"])
def test_without_a_display_one_line_says_what_else_there_is(
    monkeypatch: pytest.MonkeyPatch, display: str | None
) -> None:
    """Where there is none, and where the one that is named does not answer."""
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    if display is not None:
        monkeypatch.setenv("DISPLAY", display)
    with pytest.raises(rb.InputError, match="there is no display for a viewer here; --web writes"):
        check_display()
