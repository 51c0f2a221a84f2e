"""simulate_many gives the motions of single runs and refuses unclear requests."""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.engines.many_motions import differ_in_start
from tests.messages import naming

FIG12 = rb.load_scene("fig12")
STARTS = [replace(FIG12.start, momentum=f * FIG12.start.momentum) for f in (0.5, 1.0, 1.2)]
TIMES = np.linspace(0.0, 0.2, 6)


def test_every_motion_equals_the_motion_of_a_single_run() -> None:
    """To the last bit, for many initial states and for many scenes; progress is reported."""
    fractions: list[float] = []
    motions = [*rb.simulate_many(FIG12, STARTS, TIMES, settings="fast", progress=fractions.append)]
    scenes = [replace(FIG12, start=start) for start in STARTS]
    of_scenes = rb.simulate_many(scenes, times=TIMES, settings="fast")
    for scene, motion, other in zip(scenes, motions, of_scenes, strict=True):
        alone = rb.simulate(scene, TIMES, settings="fast")
        assert np.array_equal(motion.contact_point, alone.contact_point)
        assert np.array_equal(other.attitude, alone.attitude)
        assert motion.scene.start == scene.start
    assert fractions == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert not np.array_equal(motions[0].contact_point, motions[1].contact_point)


def test_without_initial_states_there_are_no_motions() -> None:
    """No times are needed then."""
    assert [*rb.simulate_many("fig12", [])] == []
    assert [*rb.simulate_many([])] == []


def test_initial_states_need_exactly_one_scene() -> None:
    """An engine without a choice of devices refuses `device`."""
    for scene, starts in ((FIG12, None), ([FIG12], STARTS)):
        with pytest.raises(rb.InputError, match=naming("starts scene")):
            rb.simulate_many(scene, starts)
    with pytest.raises(rb.InputError, match=naming("MuJoCo device")):
        rb.simulate_many(FIG12, STARTS, device="cpu")


def test_scenes_that_differ_in_more_than_the_initial_state_are_recognised() -> None:
    """Initial hinge angles and rates belong to it; commands, bodies and the model do not."""
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
