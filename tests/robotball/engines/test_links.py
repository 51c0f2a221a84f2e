"""The tree of links is the ball, and its state says what the equations say."""

import numpy as np
import pytest

import robotball as rb
from robotball.engines.links import State, links_of, readings_of, start_state
from robotball.rotations import conjugate, multiply, rotation_matrix

pytestmark = pytest.mark.core

SCENES = ["fig12", "classical_chaotic", "three_rotors", "wobbling_drive"]


def states_of(motion: rb.Motion) -> State:
    """The shell's and the hinges' states of a motion by the equations."""
    shell, a = motion.scene.ball.shell, motion.scene.ball.radius
    half = motion.hinge_angles[:, :1] / 2
    back = conjugate(np.concatenate([np.cos(half), np.sin(half) * shell.axis], axis=1))
    frame = rotation_matrix(motion.attitude)
    own = motion.angular_velocity - motion.hinge_rates[:, :1] * shell.axis
    turning = np.einsum("nij,nj->ni", frame, own)
    centre = np.column_stack([motion.contact_point, np.full(len(motion.times), a)])
    return State(
        centre, np.cross(turning, [0.0, 0.0, a]), multiply(motion.attitude, back), turning,
        motion.hinge_angles, motion.hinge_rates,
    )  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_the_links_say_what_the_equations_say(name: str) -> None:
    """M by sums over bodies is that of (3.1) and section 3.2, and nothing slips."""
    motion = rb.integrate(rb.load_scene(name), rb.sample_times(2.0))
    readings = readings_of(motion.scene, states_of(motion))
    off = np.linalg.norm(readings.momentum - motion.momentum, axis=1).max()
    assert off < 2e-14 * motion.scene.momentum_scale * 10  # measured 2e-14 at most: rounding
    assert np.abs(np.abs(readings.attitude * motion.attitude).sum(axis=1) - 1).max() < 1e-14
    assert readings.slip.max() < 1e-14
    if motion.scene.rolling == "rubber":
        assert np.abs(readings.spin).max() < 1e-13


@pytest.mark.parametrize("name", SCENES)
def test_the_start_is_the_equations_start(name: str) -> None:
    """Attitude, velocity and rates."""
    motion = rb.integrate(rb.load_scene(name), rb.sample_times(0.1))
    first = states_of(motion)
    expected = np.concatenate([part[0] for part in vars(first).values()])
    assert start_state(motion.scene).row == pytest.approx(expected, abs=1e-13)


def test_the_links_weigh_what_the_ball_weighs() -> None:
    """Mass and inertia about the centre, all hinges at zero."""
    ball = rb.load_scene("three_rotors").ball
    links, inertia = links_of(rb.load_scene("three_rotors")), np.zeros((3, 3))
    for link in links:
        r = link.centre + link.origin
        inertia += link.inertia + link.mass * (r @ r * np.eye(3) - np.outer(r, r))
    assert sum(link.mass for link in links) == pytest.approx(ball.mass, rel=1e-15)
    assert inertia == pytest.approx(ball.inertia, abs=1e-15)
