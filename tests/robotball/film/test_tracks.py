"""Motions between their samples, and where the bodies stand then."""

from collections.abc import Callable

import numpy as np
import pytest

import robotball as rb
from robotball.files.export import poses
from robotball.film import tracks
from robotball.film.tracks import track_of
from robotball.rotations import rotation_matrix
from tests.robots import worked

TIMES = np.linspace(0.0, 0.3, 16)  # s


@pytest.fixture(scope="module")
def scene() -> rb.Scene:
    return rb.load_scene("fig12")


@pytest.mark.parametrize("make", [lambda: rb.load_scene("three_rotors"), lambda: worked("W4")])
def test_the_picture_s_bodies_stand_as_the_library_s(make: Callable[[], rb.Scene]) -> None:
    """At the samples, rotors and pendulums too, by `poses`; measured 7e-16 rad, 5e-16 radii."""
    scene = make()
    motion = rb.integrate(scene, TIMES)
    track = track_of(motion)
    stands = track.stands(track.at(TIMES))
    for (name, body), wanted in zip(scene.ball.named_bodies, poses(motion).values(), strict=True):
        turn, shift = stands[name]
        assert np.abs(turn - rotation_matrix(wanted.attitude)).max() < 1e-14
        centre = turn @ body.centre + shift * scene.ball.radius
        assert np.abs(centre - wanted.position).max() < 1e-14


def test_poses_between_samples_follow_the_motion(scene: rb.Scene) -> None:
    """Half way between samples 20 ms apart; measured 5e-4 and 2e-6 radii."""
    between = (TIMES[:-1] + TIMES[1:]) / 2
    exact = track_of(rb.integrate(scene, np.concatenate([[0.0], between])))
    drawn, wanted = (
        track.stands(track.at(between)) for track in (track_of(rb.integrate(scene, TIMES)), exact)
    )
    for name, (turn, shift) in drawn.items():
        assert np.abs(turn - wanted[name][0]).max() < 2e-3
        assert np.abs(shift - wanted[name][1]).max() < 1e-5


def test_a_long_motion_is_read_part_by_part(
    scene: rb.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Splines through all samples agree to 5e-15 radii; a margin too narrow is 2e-6 off."""
    times = np.linspace(0.0, 2.0, 101)
    track, between = track_of(rb.integrate(scene, times)), (times[:-1] + times[1:]) / 2
    whole = track.stands(track.at(between))
    monkeypatch.setattr(tracks, "PART", 3)
    for name, (turn, shift) in track.stands(track.at(between)).items():
        assert np.array_equal(turn, whole[name][0])
        assert np.abs(shift - whole[name][1]).max() < 2e-14
    monkeypatch.setattr(tracks, "MARGIN", 1)
    assert np.abs(track.stands(track.at(between))["shell"][1] - whole["shell"][1]).max() > 1e-7
