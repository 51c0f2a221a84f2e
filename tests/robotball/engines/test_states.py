"""The ball's states as engines of other packages have them: rows, starts, bodies, forces."""

from dataclasses import astuple

import numpy as np
import pytest

import robotball as rb
from robotball.engines.states import (
    UNKNOWN_FORCE,
    lifting,
    links_of,
    principal_inertia,
    readings_of,
    start_state,
    state_of_rows,
)
from robotball.rotations import rotation_matrix
from tests.random_robots import random_tree
from tests.scenes import FOUR

RNG = np.random.default_rng(3)
TREES = [random_tree(RNG, framed) for framed in (False, True)]


@pytest.mark.parametrize("name", [*FOUR, "wobbling_drive", "three_rotors"])
def test_a_start_rolls_and_has_the_scenes_momentum(name: str) -> None:
    """Its readings as of any other state: no slip, M, ω and attitude; rubber does not spin.

    Measured 6e-15 kg m²/s and less: roundings.
    """
    scene = rb.load_scene(name)
    rows = start_state(scene).row[None]
    found = readings_of(scene, np.zeros(1), rows, UNKNOWN_FORCE[None], np.nan)
    scale = scene.momentum_scale
    assert found.slip[0] < 1e-13
    assert np.abs(found.momentum[0] - scene.start.momentum).max() < 1e-13 * scale
    expected = scene.angular_velocity_at(scene.start)
    assert np.abs(found.angular_velocity[0] - expected).max() < 1e-12
    turn = rotation_matrix(found.attitude[0]).T @ rotation_matrix(scene.start.attitude)
    assert np.abs(turn - np.eye(3)).max() < 1e-14
    assert (abs(found.spin[0]) < 1e-12) == (scene.rolling == "rubber")
    assert found.touching[0]
    assert found.sound[0]


def test_a_row_is_the_state_and_back() -> None:
    """Of one time and of many; one that is no number, or beyond all, is not sound."""
    scene = rb.load_scene("wobbling_drive")
    row = start_state(scene).row
    rows = np.array([row, row + 0.1, row])
    rows[1, 6:10] = row[6:10]
    again = state_of_rows(rows)
    for one, many in zip(astuple(start_state(scene)), astuple(again), strict=True):
        assert np.array_equal(many[0], one)
    assert np.array_equal(again.row, rows)
    rows[0, 4], rows[2, 0] = np.nan, 1e60
    found = readings_of(scene, np.arange(3.0), rows, np.zeros((3, 3)), 1.0)
    assert found.sound.tolist() == [False, True, False]


def test_bodies_are_put_together_from_places_of_their_own() -> None:
    """Pivots along the tree and centres from them add up to the ball's own; so do moments."""
    for scene in TREES:
        tree, own = scene.ball.tree, links_of(scene)
        at = {"": np.zeros(3)}
        for link, moved in zip(tree, own, strict=True):
            at[link.name] = at[link.parent] + moved.pivot
            assert np.abs(at[link.name] + moved.centre - link.centre).max() < 1e-15
            moments, q = principal_inertia(moved)
            axes = rotation_matrix(q)
            assert np.abs(axes @ np.diag(moments) @ axes.T - link.inertia).max() < 1e-15
            assert np.linalg.det(axes) == pytest.approx(1)


def test_a_contacts_forces_lift_the_ball_whichever_body_they_are_of() -> None:
    """Summed, and turned round where they press it down; without a contact there is none."""
    forces = [np.array([0.1, -0.2, 3.0]), np.array([0.0, 0.3, 1.0])]
    for sign in (1.0, -1.0):
        total = lifting(sign * each for each in forces)
        assert total == pytest.approx([0.1, 0.1, 4.0])
    assert lifting([]).tolist() == [0.0, 0.0, 0.0]
