"""The ball as engines of other packages see it: states, initial states, links and forces."""

from dataclasses import astuple, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.engines.adapter import World
from robotball.engines.states import (
    UNKNOWN_FORCE,
    _state_of_rows,
    force_on_ball,
    links_of,
    motions_of,
    principal_inertia,
    readings_of,
    start_state,
    start_states,
)
from robotball.robot.scene import Friction
from robotball.rotations import rotation_matrix
from tests.random_robots import random_tree
from tests.robotball.theory.test_friction import sphere
from tests.scenes import FOUR

RNG = np.random.default_rng(3)
TREES = [random_tree(RNG, framed) for framed in (False, True)]


@pytest.mark.parametrize("name", [*FOUR, "wobbling_drive", "three_rotors"])
def test_the_initial_state_rolls_with_the_scenes_momentum(name: str) -> None:
    """Its readings have no slip, and the scene's M, ω and attitude; a rubber ball does not spin.

    Measured 6e-15 kg m²/s or less: rounding.
    """
    scene = rb.load_scene(name)
    rows = start_state(scene).row[None]
    readings = readings_of(scene, np.zeros(1), rows, UNKNOWN_FORCE[None], np.nan)
    scale = scene.momentum_scale
    assert readings.slip[0] < 1e-13
    assert np.abs(readings.momentum[0] - scene.start.momentum).max() < 1e-13 * scale
    expected = scene.angular_velocity_at(scene.start)
    assert np.abs(readings.angular_velocity[0] - expected).max() < 1e-12
    turn = rotation_matrix(readings.attitude[0]).T @ rotation_matrix(scene.start.attitude)
    assert np.abs(turn - np.eye(3)).max() < 1e-14
    assert (abs(readings.spin[0]) < 1e-12) == (scene.rolling == "rubber")
    assert readings.touching[0]
    assert readings.sound[0]


def test_the_initial_states_of_many_starts_are_those_of_each() -> None:
    """To the last bit, with slip and spin."""
    scene = rb.load_scene("classical_regular")
    slips = [[0.0, 0.0, 0.0], [0.2, -0.1, 0.0]]
    attitudes = RNG.normal(size=(2, 4))
    attitudes /= np.linalg.norm(attitudes, axis=1, keepdims=True)
    starts = [
        rb.Start(attitude, scene.start.momentum, np.array(slip))
        for attitude, slip in zip(attitudes, slips, strict=True)
    ]
    scenes = [replace(scene, friction=Friction(sliding=0.3), start=start) for start in starts]
    states = start_states(scenes)
    for i, own in enumerate(scenes):
        assert np.array_equal(states.row[i], start_state(own).row)
    slipping = states.velocity - np.cross(states.omega, states.centre)
    assert slipping == pytest.approx(np.array(slips), abs=1e-14)


def test_rows_and_states_convert_into_each_other() -> None:
    """For one time and for many. A state that is not finite or is too large is not sound."""
    scene = rb.load_scene("wobbling_drive")
    row = start_state(scene).row
    rows = np.array([row, row + 0.1, row])
    rows[1, 6:10] = row[6:10]
    again = _state_of_rows(rows)
    for one, many in zip(astuple(start_state(scene)), astuple(again), strict=True):
        assert np.array_equal(many[0], one)
    assert np.array_equal(again.row, rows)
    rows[0, 4], rows[2, 0] = np.nan, 1e60
    readings = readings_of(scene, np.arange(3.0), rows, np.zeros((3, 3)), 1.0)
    assert readings.sound.tolist() == [False, True, False]


def test_links_with_relative_positions_make_up_the_ball() -> None:
    """Pivots summed along the tree, centres of mass and principal moments agree with the ball."""
    for scene in TREES:
        tree, links = scene.ball.tree, links_of(scene)
        at = {"": np.zeros(3)}
        for link, relative in zip(tree, links, strict=True):
            at[link.name] = at[link.parent] + relative.pivot
            assert np.abs(at[link.name] + relative.centre - link.centre).max() < 1e-15
            moments, q = principal_inertia(relative)
            axes = rotation_matrix(q)
            assert np.abs(axes @ np.diag(moments) @ axes.T - link.inertia).max() < 1e-15
            assert np.linalg.det(axes) == pytest.approx(1)


def test_contact_forces_are_summed_to_the_force_on_the_ball() -> None:
    """Whichever body the engine reports them for; without a contact the force is zero."""
    forces = [np.array([0.1, -0.2, 3.0]), np.array([0.0, 0.3, 1.0])]
    for sign in (1.0, -1.0):
        total = force_on_ball(sign * force for force in forces)
        assert total == pytest.approx([0.1, 0.1, 4.0])
    assert force_on_ball([]).tolist() == [0.0, 0.0, 0.0]


def test_a_ball_without_hinges_keeps_its_angular_velocity() -> None:
    """It has no frame that turns in it. Its empty rows of rates were an error."""
    scene: Any = sphere((0.5, 0.0), (0.0, 5.0, 0.0), Friction())
    angles, rates = World.hinges_at(SimpleNamespace(scene=scene), 0.0)  # type: ignore[arg-type]
    assert angles.shape == rates.shape == (0,)
    state = start_states([scene])
    cost: Any = {"timestep": 1.0, "steps": 1, "seconds": 0.0}
    label, settings = rb.engine_named("dart").label, rb.preset("balanced")
    (motion,) = motions_of([scene], np.zeros(1), state.row[:, None], label, settings, **cost)
    for omega in (state.omega[0], motion.angular_velocity[0]):
        assert omega == pytest.approx([0.0, 5.0, 0.0], abs=1e-14)
