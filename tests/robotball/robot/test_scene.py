"""Scenes: sample times, scales, initial states, and read-only arrays."""

import copy
import pickle
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import robotball as rb
from robotball.robot import scene as starts
from robotball.robot.formulas import as_vector
from robotball.robot.scene import Start
from robotball.rotations import Array, rotation_matrix
from tests.messages import naming
from tests.vectors import X, Y, Z, gap, units

pytestmark = pytest.mark.core

SCENE = rb.load_scene("fig12")
ROUNDING = 2e-14  # of vectors of length up to 10; measured at most 4.7e-15
UNIT_ROUNDING = 3e-15  # of unit vectors; measured at most 5.6e-16

fractions = st.floats(-0.99, 0.99)
angles = st.floats(-3.1, 3.1)


@given(duration=st.floats(1e-3, 100.0), interval=st.floats(1e-3, 10.0))
def test_sample_times_are_evenly_spaced_within_the_interval(
    duration: float, interval: float
) -> None:
    """From 0 to exactly the duration, with the fewest intervals."""
    times = rb.sample_times(duration, interval)
    assert times[0] == 0
    assert times[-1] == duration
    steps = np.diff(times)
    # Rounding of the last times, relative to the duration: measured 3.7e-16.
    assert np.ptp(steps) <= 2e-15 * duration
    assert steps.max() <= interval * (1 + 1e-9)
    assert len(steps) == 1 or duration / (len(steps) - 1) > interval * (1 - 1e-9)


def test_the_momentum_scale_is_nonzero_for_a_start_from_rest() -> None:
    """|M|; from rest 0.3 (|K| + d|Ω|); d √(g/a) if K and Ω are zero or undefined.

    Fig. 12 has K = (2, 2, 0), Ω = 2 rad/s and d = 0.9 kg m²; then the ball is four times as large.
    """
    at_rest = replace(SCENE, start=Start(SCENE.start.attitude, np.zeros(3)))
    assert SCENE.momentum_scale == pytest.approx(5.0, rel=1e-14)
    assert at_rest.momentum_scale == pytest.approx(0.3 * (8**0.5 + 0.9 * 2), rel=1e-14)
    shell = replace(SCENE.ball.shell, radius=4.0)
    large = replace(at_rest, ball=replace(SCENE.ball, shell=shell), gravity=9.0)
    still = large.with_hinges(command=(0.0, 0.0))
    motors = (rb.Servo(gain=1.0), rb.Servo(gain=1.0))
    for scene in (still, large.with_hinges(motor=motors)):
        assert scene.momentum_scale == pytest.approx(0.9 * 16 * (9 / 4) ** 0.5, rel=1e-14)


def test_the_load_varies_if_a_body_swings_about_its_pivot() -> None:
    """Wheels centred on their pivots keep the ball balanced; others do so at one angle only."""

    def with_wheels(centre: Array) -> rb.Scene:
        wheels = tuple(
            rb.Pendulum(0.1, 1e-3 * np.eye(3), sign * centre, Z, sign * 0.2 * X) for sign in (1, -1)
        )
        hung = map(rb.Hinge, wheels, (1.0, 2.0))
        return replace(SCENE, ball=replace(SCENE.ball, hinges=(*SCENE.ball.hinges, *hung)))

    assert not with_wheels(0.2 * X).load_varies
    assert with_wheels(-0.2 * X).load_varies
    assert with_wheels(0 * X).load_varies


# Forms of a start ----------------------------------------------------------------------------


@given(L=fractions, l=angles, g=st.floats(0.01, 3.1), f=st.floats(0.01, 100.0), c=fractions)
def test_a_section_state_has_its_coordinates(
    L: float, l: float, g: float, f: float, c: float
) -> None:
    """M² = f, M₃ = L, M₁/M₂ = tan l, γ² = 1, (M, γ) = c; g rotates γ about M, left-handed.

    At g = 0 and c = 0, (M×γ)₃ = 0 and γ₃ < 0.
    """
    G = f**0.5
    gamma, M = starts.section_state(L * G, l, g, f, c * G)
    assert gap(gamma @ gamma, 1) < UNIT_ROUNDING
    assert gap(M @ gamma / G, c) < UNIT_ROUNDING
    assert gap(M / G, [*((1 - L * L) ** 0.5 * np.array([np.sin(l), np.cos(l)])), L]) < UNIT_ROUNDING
    level, turned = (starts.section_state(L * G, l, angle, f)[0] for angle in (0.0, g))
    assert abs(np.cross(M / G, level)[2]) < UNIT_ROUNDING
    assert level[2] < 0
    assert gap(np.arctan2(-M @ np.cross(level, turned) / G, level @ turned), g) < UNIT_ROUNDING
    assert gap(gamma, c * M / G + (1 - c * c) ** 0.5 * turned) < UNIT_ROUNDING


@given(gamma=units(), direction=units(), size=st.floats(0.1, 10.0))
def test_world_axes_lie_along_the_momentum(gamma: Array, direction: Array, size: float) -> None:
    """α = -(M - cγ)/√(f - c²) and β = M×γ/√(f - c²) of section 3.3; M in the world is (-, 0, c)."""
    M = size * direction
    c = M @ gamma
    assume(abs(c) < 0.99 * size)
    level = (M @ M - c * c) ** 0.5
    start = starts.along_momentum(gamma, M)
    axes = np.stack([-(M - c * gamma) / level, np.cross(M, gamma) / level, gamma])
    assert gap(rotation_matrix(start.attitude), axes) < ROUNDING
    assert gap(start.momentum, [-float(level), 0.0, float(c)]) < ROUNDING


def test_small_rounding_in_a_start_is_corrected() -> None:
    """α tilted by 1e-6, a unit vector of six digits, a vertical momentum of 1e-6 |M| for rubber."""
    near = starts.attitude_of_axes(Z, np.array([np.cos(1e-6), 0.0, np.sin(1e-6)]))
    assert gap(rotation_matrix(near), np.eye(3)) < ROUNDING
    assert abs(np.linalg.norm(starts.unit("gamma", np.full(3, 0.577350))) - 1) < 4e-16
    level = starts.horizontal(np.array([3.0, 4.0, 1e-6]), scale=0.0)
    np.testing.assert_array_equal(level, [3.0, 4.0, 0.0])
    np.testing.assert_array_equal(starts.horizontal(np.zeros(3), scale=0.0), np.zeros(3))
    for shell in (X + 2 * Y, 0 * X):
        starts.check_no_spin(shell, Z)
    size = float(np.linalg.norm(SCENE.start.momentum))
    off = Start(SCENE.start.attitude * (1 + 9e-6), SCENE.start.momentum + 9e-6 * size * Z)
    start = replace(SCENE, start=off).start
    assert abs(np.linalg.norm(start.attitude) - 1) < 4e-16
    np.testing.assert_array_equal(start.momentum, SCENE.start.momentum)


@pytest.mark.parametrize("number", range(5))
def test_a_rubber_ball_with_zero_momentum_starts_at_any_attitude(number: int) -> None:
    """M(ω, γ) = 0 is rounded to 1e-16 of K and dΩ, and all of that may be vertical."""
    attitude = np.random.default_rng(number).normal(size=4)
    attitude /= np.linalg.norm(attitude)
    gamma = as_vector(rotation_matrix(attitude)[2])
    omega = SCENE.parameters.angular_velocity((0.0, 0.0, 0.0), gamma)
    M = rotation_matrix(attitude) @ SCENE.parameters.momentum(omega, gamma)
    assert np.linalg.norm(M) < 1e-14 * SCENE.momentum_scale  # measured 1e-16 to 1.5e-15
    assert replace(SCENE, start=Start(attitude, M)).start.momentum[2] == 0.0
    with pytest.raises(rb.InputError, match=naming("M horizontal")):
        replace(SCENE, start=Start(attitude, 1e-9 * Z))


@pytest.mark.parametrize("name", ["fig12", "classical_regular", "routh_sphere", "servo_motors"])
def test_a_scene_from_another_start_equals_a_new_scene(name: str) -> None:
    """Including its cached values, some of which it takes from the first scene."""
    cached = [key for key, member in vars(rb.Scene).items() if isinstance(member, cached_property)]
    cached.append("momentum_scale")

    def values_of(scene: rb.Scene) -> dict[str, str]:
        values = {}
        for key in cached:
            with suppress(rb.InputError):  # scenes beyond (3.2) and (3.3)
                values[key] = repr(getattr(scene, key))
        return values

    scene = rb.load_scene(name)
    start = replace(scene.start, momentum=3.0 * scene.start.momentum)
    with np.printoptions(precision=17, threshold=10**6):
        before = values_of(scene)
        values = values_of(scene.from_start(start))
        expected = values_of(replace(scene, start=start))
    assert scene.from_start(start) == replace(scene, start=start)
    assert values == expected
    assert [key for key in values if values[key] != before[key]] == ["momentum_scale"]
    assert len(values) > 15


MOTION = rb.simulate(SCENE, rb.sample_times(0.1), settings="fast")
ARRAYS: dict[str, Callable[[rb.Scene, rb.ContactMotion], Array]] = {
    "start": lambda scene, motion: scene.start.momentum,
    "axes of a start": lambda scene, motion: scene.start.to_world,
    "body": lambda scene, motion: scene.ball.shell.axis,
    "ball": lambda scene, motion: scene.ball.inertia,
    "times of a scene": lambda scene, motion: scene.times,
    "motion": lambda scene, motion: motion.momentum,
    "start of a motion": lambda scene, motion: motion.scene.start.attitude,
    "loads": lambda scene, motion: motion.loads.contact_force,
    "report": lambda scene, motion: motion.report.slip,
}


@pytest.mark.parametrize("taken", ["original", "copied", "pickled"])
@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_of_checked_records_are_read_only(name: str, taken: str) -> None:
    """Otherwise the M of a rubber ball could become non-horizontal after the check."""
    ways: dict[str, Callable[[Any], Any]] = {
        "original": lambda value: value,
        "copied": copy.deepcopy,
        "pickled": lambda value: pickle.loads(pickle.dumps(value)),
    }
    array = ARRAYS[name](*map(ways[taken], (SCENE, MOTION)))
    with pytest.raises(ValueError, match="read-only"):
        array[:] = 1.0


def test_arrays_of_the_caller_stay_writable_and_are_copied() -> None:
    attitude, momentum = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.5, 0.0])
    start, times = rb.Start(attitude, momentum), rb.sample_times(0.1)
    motion = rb.simulate(SCENE.from_start(start), times, settings="fast")
    before = motion.times.tolist()
    momentum[:], times[:] = 1.0, 0.0
    assert start.momentum.tolist() == [0.0, 0.5, 0.0]
    assert motion.times.tolist() == before
