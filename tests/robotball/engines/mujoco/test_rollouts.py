"""Runs in parallel are equal to single runs, to the last bit."""

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
GUESSED = replace(rb.preset("naive"), iterations=1)  # an error of 5e-3 if the warm start is dropped
UNEVEN = np.array([0.0, 0.131, 0.503, 1.0])  # gives steps of three lengths
MANY = np.linspace(0.0, 1.0, 41) ** 1.5
# Name: (scene, settings, sample times); None for ten samples per second.
CASES: dict[str, tuple[str, Any, Any]] = {
    "a balanced ball": ("fig12", "fast", None),
    "a classical ball": ("classical_regular", "fast", None),
    "a varying load": ("swinging_frame", "fast", None),
    "servos": ("servo_motors", "fast", None),
    "uneven samples": ("fig12", "fast", UNEVEN),
    "dense samples": ("fig12", "fast", MANY),
    "warm start": ("fig12", "naive", None),
    "warm start, uneven samples": ("fig12", GUESSED, UNEVEN),
    "order 8": ("fig12", "exact", None),
    "a varying drive": ("wobbling_drive", "fast", None),
    "some runs fault": ("fig12", SLIPPERY, None),
    "some runs fault and go on": ("fig12", replace(SLIPPERY, stop_at_fault=False), None),
}


# Run in this process: starting others would take most of the time.
HERE = ("dense samples", "order 8")


def starts_of(scene: rb.Scene, count: int) -> list[rb.Start]:
    rng = np.random.default_rng(3)
    attitudes = rng.normal(size=(count, 4))
    attitudes /= np.linalg.norm(attitudes, axis=1)[:, None]
    return [replace(scene.start, attitude=attitude) for attitude in attitudes]


def check_same(motions: Sequence[rb.ContactMotion], alone: Sequence[rb.ContactMotion]) -> None:
    """Check that motions are equal to the last bit, with their reports."""
    for one, other in zip(motions, alone, strict=True):
        assert one.scene == other.scene
        ours, theirs = dict(arrays_of(one)), dict(arrays_of(other))
        assert {name for name in theirs if not np.array_equal(ours[name], theirs[name])} == set()
        reports = [
            (motion.faults, motion.notes, motion.steps, motion.timestep)
            for motion in (one.report, other.report)
        ]
        assert reports[0] == reports[1]


@pytest.mark.parametrize("case", CASES)
def test_each_parallel_run_equals_a_single_run(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In threads and in processes, with and without faults; four of the five start at once."""
    name, settings, times = CASES[case]
    scene = rb.load_scene(name)
    starts, times = starts_of(scene, 5), np.linspace(0.0, 1.0, 11) if times is None else times
    if case == "some runs fault and go on":  # one diverges, which stops a thread of MuJoCo
        starts[3] = replace(starts[3], momentum=1e4 * starts[3].momentum)
    monkeypatch.setattr(rollouts, "_ABREAST", 4)
    done: list[float] = []
    with at_most(1 if case in HERE else 2):
        motions = [*rb.simulate_many(scene, starts, times, settings=settings, progress=done.append)]
    assert done == [0.2, 0.4, 0.6, 0.8, 1.0]
    alone = [rb.simulate(replace(scene, start=item), times, settings=settings) for item in starts]
    check_same(motions, alone)
    lengths = [len(item.times) for item in motions]
    faulty = sum(bool(item.report.faults) for item in motions)
    if "some" in case:
        assert 0 < faulty < 5
        assert min(lengths) < max(lengths)


def test_overlapping_silent_blocks_restore_warnings_when_both_have_ended() -> None:
    """The warning handler stays silent until the last block ends."""
    before = mujoco.get_mju_user_warning()
    messages: list[str] = []
    mujoco.set_mju_user_warning(messages.append)
    handlers = [mujoco.get_mju_user_warning()]
    one, other = mujoco_silent(), mujoco_silent()
    for enter in (one, other):
        enter.__enter__()
    for leave in (one, other):
        leave.__exit__(None, None, None)
        handlers.append(mujoco.get_mju_user_warning())
    mujoco.set_mju_user_warning(before)
    assert handlers[1] != handlers[0]
    assert handlers[2] == handlers[0]


def test_closing_the_iterator_cancels_queued_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four runs are queued; after the first, only the one being stepped is completed."""
    closed, stepped, shutdown = Event(), Mock(), ThreadPoolExecutor.shutdown

    def rollout(*arguments: Any, **options: Any) -> Any:
        stepped()
        assert stepped.call_count == 1 or closed.wait()
        return mujoco.rollout.rollout(*arguments, **options)

    def close(threads: ThreadPoolExecutor, **options: Any) -> None:
        shutdown(threads, wait=False, **options)
        closed.set()
        shutdown(threads)

    monkeypatch.setattr(rollouts, "rollout", rollout)
    monkeypatch.setattr(rollouts, "_ABREAST", 4)
    monkeypatch.setattr(ThreadPoolExecutor, "shutdown", close)
    with at_most(1):
        motions = iter(rb.simulate_many(FIG12, starts_of(FIG12, 5), np.linspace(0.0, 0.1, 3)))
        next(motions)
        del motions
    assert stepped.call_count <= 2  # 4 if queued runs are not cancelled


def test_a_long_run_in_parts_equals_a_single_run() -> None:
    """6000 steps in two parts; sample times are not multiples of the step."""
    times, starts = np.linspace(0.0, 30.0, 77), starts_of(FIG12, 2)
    alone = [rb.simulate(replace(FIG12, start=start), times) for start in starts]
    check_same([*rb.simulate_many(FIG12, starts, times)], alone)


def test_a_start_that_needs_another_model_runs_separately() -> None:
    """The first model has no hinge for its rotor, which is at rest; the second needs one."""
    scene, times = rb.load_scene("zero_rotor"), np.linspace(0.0, 0.5, 6)
    angles = np.full(len(scene.hinges), 0.1)
    turned = replace(scene.with_hinges(angle=angles), start=starts_of(scene, 1)[0])
    scenes = [scene, scene.with_hinges(angle=angles), turned]
    check_same([*rb.simulate_many(scenes, times=times)], [rb.simulate(s, times) for s in scenes])


def test_scenes_may_differ_in_drives_and_bodies() -> None:
    """Each scene gets its own model; a Python function as a drive runs in this process."""
    times = np.linspace(0.0, 0.5, 6)
    scenes = [
        FIG12,
        FIG12.with_hinges(command={"frame": lambda t: 1.0 + 0.1 * t}),
        rb.load_scene("classical_regular"),
    ]
    check_same([*rb.simulate_many(scenes, times=times)], [rb.simulate(s, times) for s in scenes])


def test_any_engine_runs_many_starts() -> None:
    """The multibody engine runs them one by one; an empty list gives no motions."""
    starts, times = starts_of(FIG12, 2), np.linspace(0.0, 0.5, 6)
    motions = [*rb.simulate_many(FIG12, starts, times, engine="multibody")]
    assert [motion.scene.start for motion in motions] == starts
    assert [*rb.simulate_many(FIG12, [], times)] == []


def test_a_start_that_is_predicted_to_fail_gives_a_warning() -> None:
    """One scene is checked at its largest momentum; several scenes are checked one by one.

    At 10 M the ball of Fig. 12 needs 26.9 m of torsional friction; it has 20 m.
    """
    times = np.linspace(0.0, 0.1, 6)
    fast = replace(FIG12.start, momentum=10 * FIG12.start.momentum)
    starts = [FIG12.start, fast, *starts_of(FIG12, 2)]
    scenes = [replace(FIG12, start=start) for start in (FIG12.start, fast)]
    scenes[0] = replace(scenes[0], name="other")
    for arguments in ({"scene": FIG12, "starts": starts}, {"scene": scenes}):
        with at_most(1), pytest.warns(rb.SceneWarning, match=r"fig12.* needs 26\.9") as caught:
            next(rb.simulate_many(**arguments, times=times))
        assert len(caught) == 1


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


@pytest.mark.parametrize(("arguments", "facts"), REFUSED)
def test_invalid_arguments_are_refused_at_the_call(
    arguments: dict[str, Any], facts: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not when the first motion is requested. CUDA is made unavailable."""
    monkeypatch.setattr(ctypes, "CDLL", Mock(side_effect=OSError))
    whole: dict[str, Any] = {"scene": FIG12, "starts": starts_of(FIG12, 1)} | arguments
    with pytest.raises(rb.InputError, match=naming(facts)):
        rb.simulate_many(**whole)


@pytest.mark.parametrize("starts", [42, [FIG12.start, "x"]])
def test_compare_many_refuses_invalid_starts(starts: Any) -> None:
    """With the check of `simulate_many`."""
    with pytest.raises(rb.InputError, match=naming("starts Start(attitude,~momentum)")):
        rb.compare_many(FIG12, starts)


@pytest.mark.parametrize("scene", [FIG12, rb.load_scene("wobbling_drive")])
def test_scenes_are_created_only_when_they_run(
    scene: rb.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first of 2100 motions creates only a few scenes."""
    starts = [*starts_of(scene, 3)] * 700
    made = Mock(side_effect=rb.Scene.from_start)
    monkeypatch.setattr(rb.Scene, "from_start", lambda *arguments: made(*arguments))
    with at_most(1):
        motion = next(rb.simulate_many(scene, starts, np.linspace(0.0, 0.5, 6), settings="fast"))
    assert motion.scene.start == replace(scene, start=starts[0]).start
    assert made.call_count < 300  # measured 69, since 64 runs start at once, and 6
