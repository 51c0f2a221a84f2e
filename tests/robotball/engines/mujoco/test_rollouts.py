"""Many runs at once are the runs one by one, to the last bit."""

import ctypes
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Event
from typing import Any
from unittest.mock import Mock

import mujoco.rollout
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco import rollouts
from robotball.errors import mujoco_silent
from robotball.motion import arrays_of
from robotball.processes import at_most
from tests.messages import naming

FIG12 = rb.load_scene("fig12")
SLIPPERY = replace(rb.preset("balanced"), sliding_friction=1.0)
GUESSED = replace(rb.preset("naive"), iterations=1)  # 5e-3 off where a guess is forgotten
UNEVEN = np.array([0.0, 0.131, 0.503, 1.0])  # whose steps have three lengths
MANY = np.linspace(0.0, 1.0, 41) ** 1.5
# A scene, settings and sample times, None for ten a second.
CASES: dict[str, tuple[str, Any, Any]] = {
    "a balanced ball": ("fig12", "fast", None),
    "a classical one": ("classical_regular", "fast", None),
    "a load that varies": ("swinging_frame", "fast", None),
    "servos": ("servo_motors", "fast", None),
    "samples far from even": ("fig12", "fast", UNEVEN),
    "samples near one another": ("fig12", "fast", MANY),
    "steps from a guess": ("fig12", "naive", None),
    "steps from a guess, uneven": ("fig12", GUESSED, UNEVEN),
    "steps chosen by their error": ("fig12", "adaptive", None),
    "a drive that changes": ("wobbling_drive", "fast", None),
    "some that fault": ("fig12", SLIPPERY, None),
    "some that go on": ("fig12", replace(SLIPPERY, stop_at_fault=False), None),
}


# They go the way of a drive that changes, but here: to start processes takes most of the time.
HERE = ("samples near one another", "steps chosen by their error")


def starts_of(scene: rb.Scene, count: int) -> list[rb.Start]:
    rng = np.random.default_rng(3)
    turns = rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1)[:, None]
    return [replace(scene.start, attitude=each) for each in turns]


def check_same(motions: Sequence[rb.ContactMotion], alone: Sequence[rb.ContactMotion]) -> None:
    """Check that motions are equal to the last bit, with their reports."""
    for one, other in zip(motions, alone, strict=True):
        assert one.scene == other.scene
        ours, theirs = dict(arrays_of(one)), dict(arrays_of(other))
        assert {name for name in theirs if not np.array_equal(ours[name], theirs[name])} == set()
        reports = [
            (each.faults, each.notes, each.steps, each.timestep)
            for each in (one.report, other.report)
        ]
        assert reports[0] == reports[1]


@pytest.mark.parametrize("case", CASES)
def test_each_motion_is_that_of_a_run_alone(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In threads, in processes, and where some of the runs fault; of five, four begin at once."""
    name, settings, times = CASES[case]
    scene = rb.load_scene(name)
    starts, times = starts_of(scene, 5), np.linspace(0.0, 1.0, 11) if times is None else times
    if case == "some that go on":  # and one that breaks, where MuJoCo's threads stop
        starts[3] = replace(starts[3], momentum=1e4 * starts[3].momentum)
    monkeypatch.setattr(rollouts, "_ABREAST", 4)
    done: list[float] = []
    with at_most(1 if case in HERE else 2):
        motions = [*rb.simulate_many(scene, starts, times, settings=settings, progress=done.append)]
    assert done == [0.2, 0.4, 0.6, 0.8, 1.0]
    alone = [rb.simulate(replace(scene, start=each), times, settings=settings) for each in starts]
    check_same(motions, alone)
    lengths = [len(each.times) for each in motions]
    faulty = sum(bool(each.report.faults) for each in motions)
    if "some" in case:
        assert 0 < faulty < 5
        assert min(lengths) < max(lengths)


def test_silent_blocks_of_two_threads_may_overlap() -> None:
    """MuJoCo warns as before once both have ended, and not until then."""
    before = mujoco.get_mju_user_warning()
    said: list[str] = []
    mujoco.set_mju_user_warning(said.append)
    warns = [mujoco.get_mju_user_warning()]
    one, other = mujoco_silent(), mujoco_silent()
    for enter in (one, other):
        enter.__enter__()
    for leave in (one, other):
        leave.__exit__(None, None, None)
        warns.append(mujoco.get_mju_user_warning())
    mujoco.set_mju_user_warning(before)
    assert warns[1] != warns[0]
    assert warns[2] == warns[0]


def test_runs_that_nobody_waits_for_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the four that have begun when the first motion is taken, only the second is stepped too.

    That one is stepped when the iterator is closed, and it ends after that.
    """
    closed, stepped, shutdown = Event(), Mock(), ThreadPoolExecutor.shutdown

    def rollout(*given: Any, **named: Any) -> Any:
        stepped()
        assert stepped.call_count == 1 or closed.wait()
        return mujoco.rollout.rollout(*given, **named)

    def close(threads: ThreadPoolExecutor, **named: Any) -> None:
        shutdown(threads, wait=False, **named)
        closed.set()
        shutdown(threads)

    monkeypatch.setattr(rollouts, "rollout", rollout)
    monkeypatch.setattr(rollouts, "_ABREAST", 4)
    monkeypatch.setattr(ThreadPoolExecutor, "shutdown", close)
    with at_most(1):
        motions = iter(rb.simulate_many(FIG12, starts_of(FIG12, 5), np.linspace(0.0, 0.1, 3)))
        next(motions)
        del motions
    assert stepped.call_count <= 2  # 4 where runs are not left out


def test_a_long_run_is_looked_at_part_by_part() -> None:
    """Of 6000 steps in two parts; the times of the samples are no multiples of the step."""
    times, starts = np.linspace(0.0, 30.0, 77), starts_of(FIG12, 2)
    alone = [rb.simulate(replace(FIG12, start=each), times) for each in starts]
    check_same([*rb.simulate_many(FIG12, starts, times)], alone)


def test_a_start_that_turns_other_hinges_runs_alone() -> None:
    """The model of the first start has no hinge for a rotor that stands, the second's has."""
    scene, times = rb.load_scene("zero_rotor"), np.linspace(0.0, 0.5, 6)
    angles = np.full(len(scene.hinges), 0.1)
    turned = replace(scene.with_hinges(angle=angles), start=starts_of(scene, 1)[0])
    scenes = [scene, scene.with_hinges(angle=angles), turned]
    check_same([*rb.simulate_many(scenes, times=times)], [rb.simulate(s, times) for s in scenes])


def test_scenes_may_differ_in_drives_and_bodies() -> None:
    """Each has a model of its own then; a user's function, which no other process has, runs too."""
    times = np.linspace(0.0, 0.5, 6)
    scenes = [
        FIG12,
        FIG12.with_hinges(command={"frame": lambda t: 1.0 + 0.1 * t}),
        rb.load_scene("classical_regular"),
    ]
    check_same([*rb.simulate_many(scenes, times=times)], [rb.simulate(s, times) for s in scenes])


def test_any_engine_takes_many_starts() -> None:
    """The equations' own engine runs them one after another; no starts are no motions."""
    starts, times = starts_of(FIG12, 2), np.linspace(0.0, 0.5, 6)
    motions = [*rb.simulate_many(FIG12, starts, times, engine="multibody")]
    assert [each.scene.start for each in motions] == starts
    assert [*rb.simulate_many(FIG12, [], times)] == []


def test_a_start_that_is_predicted_to_fail_is_warned_of() -> None:
    """Wherever it stands: of one scene it has the most momentum; each of several is looked at.

    At 10 M the ball of Fig. 12 needs 26.9 m of torsional friction, of 20.
    """
    times = np.linspace(0.0, 0.1, 6)
    fast = replace(FIG12.start, momentum=10 * FIG12.start.momentum)
    starts = [FIG12.start, fast, *starts_of(FIG12, 2)]
    scenes = [replace(FIG12, start=each) for each in (FIG12.start, fast)]
    scenes[0] = replace(scenes[0], name="other")
    for given in ({"scene": FIG12, "starts": starts}, {"scene": scenes}):
        with at_most(1), pytest.warns(rb.SceneWarning, match=r"fig12.* needs 26\.9") as said:
            next(rb.simulate_many(**given, times=times))
        assert len(said) == 1


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"settings": "wild"}, "preset 'wild'"),
    ({"engine": "none"}, "engine 'none'"),
    ({"times": np.array([0.0, 0.0])}, "times"),
    ({"device": "cuda"}, "MuJoCo device"),
    ({"engine": "newton", "device": "tpu"}, "'tpu' cpu cuda"),
    ({"engine": "newton", "device": "cuda"}, "'cuda' cpu CUDA"),
    ({"starts": 42}, "starts 0 42"),
    ({"starts": [FIG12.start, "x"]}, "1 'x'"),
    ({"starts": None}, "starts scene"),
    ({"scene": [FIG12]}, "starts scene"),
]


@pytest.mark.parametrize(("asked", "facts"), REFUSED)
def test_what_cannot_run_is_refused_at_once(
    asked: dict[str, Any], facts: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before the first motion is asked for; here on a machine without a driver for CUDA."""
    monkeypatch.setattr(ctypes, "CDLL", Mock(side_effect=OSError))
    whole: dict[str, Any] = {"scene": FIG12, "starts": starts_of(FIG12, 1)} | asked
    with pytest.raises(rb.InputError, match=naming(facts)):
        rb.simulate_many(**whole)


@pytest.mark.parametrize("starts", [42, [FIG12.start, "x"]])
def test_a_start_that_is_none_is_refused_where_many_are_compared(starts: Any) -> None:
    """By the one check that `simulate_many` has."""
    with pytest.raises(rb.InputError, match=naming("starts Start(attitude,~momentum)")):
        rb.compare_many(FIG12, starts)


@pytest.mark.parametrize("scene", [FIG12, rb.load_scene("wobbling_drive")])
def test_no_scene_is_made_before_its_turn(scene: rb.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 2000 starts, the last of which the scene refuses, the first motion needs a few scenes."""
    starts = [*starts_of(scene, 3)] * 700
    made = Mock(side_effect=rb.Scene.from_start)
    monkeypatch.setattr(rb.Scene, "from_start", lambda *given: made(*given))
    with at_most(1):
        motion = next(rb.simulate_many(scene, starts, np.linspace(0.0, 0.5, 6), settings="fast"))
    assert motion.scene.start == replace(scene, start=starts[0]).start
    assert made.call_count < 300  # measured 69, as 64 runs begin at once, and 6
