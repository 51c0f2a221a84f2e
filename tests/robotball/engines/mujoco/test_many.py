"""Many runs at once are the runs one by one, to the last bit."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco import many
from robotball.motion import arrays_of
from robotball.processes import at_most

FIG12 = rb.load_scene("fig12")
SLIPPERY = replace(rb.preset("balanced"), name="slippery", sliding_friction=0.3)
# A scene, settings, and the most bytes of rows that are held, for several batches and stretches.
CASES: dict[str, tuple[rb.Scene, Any]] = {
    "threads": (FIG12, "fast"),
    "a load that varies": (rb.load_scene("swinging_frame"), "fast"),
    "runs that fault": (FIG12, SLIPPERY),
    "steps from a guess": (FIG12, "naive"),
    "steps chosen by their error": (FIG12, "adaptive"),
    "a drive that changes": (rb.load_scene("wobbling_drive"), "fast"),
}


def starts_of(scene: rb.Scene, count: int) -> list[rb.Start]:
    rng = np.random.default_rng(3)
    turns = rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1)[:, None]
    return [replace(scene.start, attitude=each) for each in turns]


def check_same(one: rb.ContactMotion, other: rb.ContactMotion) -> None:
    """Check that two motions are equal to the last bit, with their reports."""
    assert one.scene == other.scene
    ours, theirs = dict(arrays_of(one)), dict(arrays_of(other))
    assert {name for name in theirs if not np.array_equal(ours[name], theirs[name])} == set()
    reports = [
        (each.report.faults, each.report.notes, each.report.steps, each.report.timestep)
        for each in (one, other)
    ]
    assert reports[0] == reports[1]


@pytest.mark.parametrize("case", CASES)
def test_each_motion_is_that_of_a_run_alone(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In threads, in processes, and where some of the runs fault; in several batches."""
    scene, settings = CASES[case]
    starts, times = starts_of(scene, 5), np.linspace(0.0, 1.0, 11)
    monkeypatch.setattr(many, "_BYTES", 2e5)
    done: list[float] = []
    with at_most(2):
        motions = [*rb.simulate_many(scene, starts, times, settings, progress=done.append)]
    assert done == [0.2, 0.4, 0.6, 0.8, 1.0]
    alone = [rb.simulate(replace(scene, start=each), times, settings) for each in starts]
    for one, other in zip(motions, alone, strict=True):
        check_same(one, other)
    faulty = [bool(each.report.faults) for each in alone]
    assert any(faulty) == (case in ("runs that fault", "steps from a guess"))
    assert not (case == "runs that fault" and all(faulty))


def test_a_long_run_is_looked_at_stretch_by_stretch() -> None:
    """Of 6000 steps; the times of the samples are no multiples of the step."""
    times, starts = np.linspace(0.0, 30.0, 77), starts_of(FIG12, 2)
    for one, start in zip(rb.simulate_many(FIG12, starts, times), starts, strict=True):
        check_same(one, rb.simulate(replace(FIG12, start=start), times))


def test_a_start_whose_hinges_turn_otherwise_runs_alone() -> None:
    """The first start's model has no hinge for a rotor that stands; the second's rotor is turned."""
    scene = rb.load_scene("zero_rotor")
    still = replace(scene.start, angles=np.zeros(len(scene.hinges)))
    turned = replace(scene.start, angles=np.full(len(scene.hinges), 0.1))
    times = np.linspace(0.0, 0.5, 6)
    motions = [*rb.simulate_many(scene, [still, turned], times)]
    check_same(motions[1], rb.simulate(replace(scene, start=turned), times))


def test_any_engine_takes_many_starts() -> None:
    """The equations' own engine runs them one after another; no starts are no motions."""
    starts, times = starts_of(FIG12, 2), np.linspace(0.0, 0.5, 6)
    motions = [*rb.simulate_many(FIG12, starts, times, engine="multibody")]
    assert [each.scene.start for each in motions] == starts
    assert [*rb.simulate_many(FIG12, [], times)] == []


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"settings": "wild"}, "no preset is called 'wild'"),
    ({"engine": "none"}, "no engine is called 'none'"),
    ({"times": np.array([0.0, 0.0])}, "times"),
]


@pytest.mark.parametrize(("asked", "message"), REFUSED)
def test_what_cannot_run_is_refused_at_once(asked: dict[str, Any], message: str) -> None:
    """Before the first motion is asked for."""
    with pytest.raises(rb.InputError, match=message):
        rb.simulate_many(FIG12, starts_of(FIG12, 1), **asked)
