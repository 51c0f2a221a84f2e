"""Requests to engines, and warnings of runs that are probably not intended."""

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.engines.engine import request_of
from robotball.robot.motors import Servo
from robotball.rotations import Array
from tests.messages import naming, unnamed
from tests.off_engine import OFF

FIG12 = rb.load_scene("fig12")
PENDULUM = rb.load_scene("pendulum_robot")
EXAMPLE = Path(__file__).parents[3] / "examples" / "my_robot.toml"


def test_an_engine_without_preparation_runs_the_scene_from_another_initial_state() -> None:
    start = rb.load_scene("fig13").start
    motion = OFF.prepare(FIG12, OFF.presets["as it comes"])(
        np.array([0.0, 0.1]), replace(FIG12, start=start)
    )
    assert motion.momentum[0] == pytest.approx(start.momentum, abs=1e-12)


@pytest.mark.parametrize("run", [rb.integrate, rb.simulate])
def test_a_scene_is_accepted_as_an_object_a_name_or_a_file(run: Any) -> None:
    """A Scene, a name in the catalog, and a path as str or Path give the same motion."""
    times = rb.sample_times(0.1)
    assert run("fig12", times).attitude.tolist() == run(FIG12, times).attitude.tolist()
    from_file = rb.load_scene(EXAMPLE)
    for scene in (EXAMPLE, str(EXAMPLE), from_file):
        assert run(scene, times).scene.name == from_file.name
    with pytest.raises(rb.InputError, match=naming("scene 'fig120'")):
        run("fig120", times)


def test_a_request_takes_settings_or_an_accuracy() -> None:
    """Either gives the request its name; settings of another engine are refused."""
    assert request_of(settings="fast").name == "fast"
    assert request_of(accuracy=1e-6).name == "to 1e-06"
    assert request_of(settings="fast", keep_going=True).settings != rb.preset("fast")
    for refused, pattern in (
        ({"settings": OFF.presets["as it comes"]}, "MuJoCo needs Settings, not EngineSett"),
        ({"settings": "fast", "accuracy": 1e-6}, "give settings or an accuracy, not both"),
        ({"accuracy": 1e-15}, "accuracy must be at least 1e-11, .* less than 1, not 1e-15"),
        ({"accuracy": 1.0}, "accuracy must be at least .* less than 1, not 1"),
        ({"accuracy": np.nan}, "accuracy must be at least .* less than 1, not nan"),
    ):
        with pytest.raises(rb.InputError, match=pattern):
            rb.simulate(FIG12, **refused)
    with pytest.raises(rb.InputError, match=naming("fault accuracy")):
        request_of(accuracy=1e-6, keep_going=True)


SLOW = [hinge.rate / 1000 for hinge in FIG12.hinges]
LESS = replace(FIG12.start, momentum=FIG12.start.momentum / 1000)
# The motion of Fig. 12, 37 radii long, at 1/1000 of its rates.
SLOWED = replace(FIG12.with_hinges(command=SLOW), start=LESS)


def with_gain(factor: float) -> rb.Scene:
    """Return the pendulum robot with kv scaled; originally 4.1 rad/s, torque_limit/kv = 3."""
    motor = PENDULUM.hinges[0].motor
    assert isinstance(motor, Servo)
    return PENDULUM.with_hinges(motor=[replace(motor, gain=factor * motor.gain)])


TIMES = rb.sample_times(10.0)
# Scene, times and the facts of the warning; None if the run gives no reason for one.
DOUBTS: dict[str, tuple[rb.Scene, Array, str | None]] = {
    "nearly still": (SLOWED, TIMES, "0.047~m 10~s radius 1~m"),
    "no such motor": (
        with_gain(10.0),
        TIMES,
        "frame motor 4.…~rad/s torque_limit/kv~=~0.3",
    ),
    "a shorter run": (SLOWED, rb.sample_times(9.0), None),
    "a path of few samples": (SLOWED, np.linspace(0.0, 10.0, 50), None),
    "a limit below the stall torque": (with_gain(3.0), TIMES, None),
}


@pytest.mark.parametrize(("scene", "times", "facts"), DOUBTS.values(), ids=DOUBTS)
def test_a_run_that_is_probably_not_intended_causes_one_warning(
    scene: rb.Scene, times: Array, facts: str | None
) -> None:
    """It names the number and the check to make."""
    lines = doubts_of(scene, times)
    assert len(lines) == (facts is not None)
    assert facts is None or unnamed(facts, lines[0]) == []


def doubts_of(scene: rb.Scene, times: Array) -> list[str]:
    """Return the warnings of a run with an engine that gives no others."""
    loose: dict[str, Any] = {"rtol": 1e-6}
    settings = replace(rb.engine_named("multibody").presets["best"], **loose)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", rb.SceneWarning)
        rb.simulate(scene, times, settings=settings, engine="multibody")
    return [str(warning.message) for warning in caught]


def test_scenes_of_the_catalog_cause_no_such_warning() -> None:
    """The shortest path, of tilting_gyroscope, is 7 radii; a motor has 2.1 torque_limit/kv."""
    names: list[str | Path] = [*rb.catalog(), EXAMPLE]
    for scene in map(rb.load_scene, names):
        assert doubts_of(scene, rb.sample_times(scene.duration, 0.1)) == []
