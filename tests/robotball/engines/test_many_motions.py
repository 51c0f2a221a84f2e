"""Many motions are those of one at a time, and are refused where they cannot be made."""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.engines.many_motions import differ_in_start
from tests.messages import naming

FIG12 = rb.load_scene("fig12")
STARTS = [replace(FIG12.start, momentum=f * FIG12.start.momentum) for f in (0.5, 1.0, 1.2)]
TIMES = np.linspace(0.0, 0.2, 6)


def test_each_motion_is_that_of_its_own_run() -> None:
    """To the last bit, of many starts and of the scenes that have them; the parts done are told."""
    told: list[float] = []
    motions = [*rb.simulate_many(FIG12, STARTS, TIMES, settings="fast", progress=told.append)]
    scenes = [replace(FIG12, start=each) for each in STARTS]
    of_scenes = rb.simulate_many(scenes, times=TIMES, settings="fast")
    for scene, motion, other in zip(scenes, motions, of_scenes, strict=True):
        alone = rb.simulate(scene, TIMES, settings="fast")
        assert np.array_equal(motion.contact_point, alone.contact_point)
        assert np.array_equal(other.attitude, alone.attitude)
        assert motion.scene.start == scene.start
    assert told == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert not np.array_equal(motions[0].contact_point, motions[1].contact_point)


def test_no_start_is_no_motion() -> None:
    """And no time, as nothing is to be run."""
    assert [*rb.simulate_many("fig12", [])] == []
    assert [*rb.simulate_many([])] == []


def test_starts_go_with_one_scene() -> None:
    """Not with several, which have their own; a device only where an engine has a choice."""
    for scene, starts in ((FIG12, None), ([FIG12], STARTS)):
        with pytest.raises(rb.InputError, match=naming("starts scene")):
            rb.simulate_many(scene, starts)
    with pytest.raises(rb.InputError, match=naming("MuJoCo device")):
        rb.simulate_many(FIG12, STARTS, device="cpu")


def test_scenes_that_differ_in_more_than_their_start_are_told_apart() -> None:
    """Hinges' first angles and rates are a start's; a command, a body or a model is more."""
    other = replace(FIG12, start=STARTS[0])
    tilted = other.with_hinges(angle=[0.3, 0.0])
    assert differ_in_start([FIG12, other, tilted])
    for change in (
        other.with_hinges(command={"frame": 1.0}),
        replace(other, duration=3.0),
        rb.load_scene("fig13"),
        rb.load_scene("three_rotors"),
    ):
        assert not differ_in_start([FIG12, change])
