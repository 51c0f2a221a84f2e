"""A ball or a motion that can hardly be what was meant is run, and warned of in a line."""

import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.motors import Servo
from robotball.rotations import Array
from tests.conftest import Robotball
from validation import compare

FIG12 = rb.load_scene("fig12")
PENDULUM = rb.load_scene("pendulum_robot")
EXAMPLE = Path(__file__).parents[3] / "examples" / "my_robot.toml"
TIMES, SHORT = rb.sample_times(10.0), rb.sample_times(1.0)
WORDS = ("beyond any robot's", "less than its radius", "motor turns at")


def doubts_of(scene: rb.Scene, times: Array = TIMES) -> list[str]:
    """Those of the warnings of a run at the fast preset."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", rb.SceneWarning)
        rb.simulate(scene, times, "fast")
    lines = [str(each.message) for each in caught]
    return [line for line in lines if any(words in line for words in WORDS)]


def in_millimetres() -> rb.Scene:
    """Fig. 12's ball with a radius of 150 m, for so short a time that no path is expected."""
    ball = FIG12.ball
    return replace(FIG12, ball=replace(ball, shell=replace(ball.shell, radius=150.0)))


def slowed() -> rb.Scene:
    """Fig. 12's motion, of 37 radii, a thousand times as slow: rates in mrad/s."""
    frame, rotor = (hinge.rate / 1000 for hinge in FIG12.hinges)
    start = replace(FIG12.start, momentum=FIG12.start.momentum / 1000)
    return replace(FIG12, frame_rate=frame, rotor_rates=(rotor,), start=start)


def with_gain(factor: float) -> rb.Scene:
    """The pendulum robot with another kv: it reaches 4.1 rad/s, and has torque_limit/kv = 3."""
    (motor,) = PENDULUM.motors
    assert isinstance(motor, Servo)
    return replace(PENDULUM, motors=(replace(motor, gain=factor * motor.gain),))


DOUBTS: dict[str, tuple[Callable[[], rb.Scene], Array, str]] = {
    "millimetres": (
        in_millimetres,
        SHORT,
        r"fig12: a radius of 150 m is beyond any robot's; lengths are",
    ),
    "nearly still": (
        slowed,
        TIMES,
        r"the ball rolls 0\.047 m in 10 s, less than its radius of 1 m; check",
    ),
    "no such motor": (
        lambda: with_gain(10.0),
        TIMES,
        r"frame's motor turns at 4.\d+ rad/s, but without load at 0.3 = torque_limit/kv if",
    ),
}


@pytest.mark.parametrize(("make", "times", "words"), DOUBTS.values(), ids=DOUBTS)
def test_what_can_hardly_be_meant_is_told_in_a_line(
    make: Callable[[], rb.Scene], times: Array, words: str
) -> None:
    """Once, with the number, and what to check."""
    (line,) = doubts_of(make(), times)
    assert re.search(words, line), line


SOUND: dict[str, tuple[Callable[[], rb.Scene], Array]] = {
    "a shorter run": (slowed, rb.sample_times(9.0)),
    "a path of few samples": (slowed, np.linspace(0.0, 10.0, 50)),
    "a limit below the stall torque": (lambda: with_gain(3.0), TIMES),
}


@pytest.mark.parametrize(("make", "times"), SOUND.values(), ids=SOUND)
def test_what_may_be_meant_is_not_told(make: Callable[[], rb.Scene], times: Array) -> None:
    """Nothing is said where the run cannot know better."""
    assert doubts_of(make(), times) == []


def test_no_scene_of_ours_is_doubted() -> None:
    """The shortest path, of tilting_gyroscope, is 7 radii long; a motor has 2.1 torque_limit/kv."""
    names: list[str | Path] = [*rb.catalog(), EXAMPLE]
    for scene in map(rb.load_scene, names):
        assert doubts_of(scene, scene.times) == []


def test_compare_tells_it_on_standard_error(robotball: Robotball, tmp_path: Path) -> None:
    """As any warning, and as compare does in Python."""
    scene = tmp_path / "big.toml"
    text = EXAMPLE.read_text().replace("radius = 0.15", "radius = 150", 1)
    scene.write_text(text.replace("thickness = 0.003", "thickness = 3", 1))
    with pytest.warns(rb.SceneWarning, match="big: a radius of 150 m is beyond any robot's"):
        compare(scene, times=rb.sample_times(0.1))
    _, _, err = robotball("compare", scene, "--duration", 0.1, "--no-plots")
    assert "robotball: warning: big: a radius of 150 m is beyond" in err
