"""Momenta and energy of any robot, against the reduced equations and body by body."""

import numpy as np

from robotball import load_scene
from robotball.robot.mechanics import States
from robotball.robot.scene import Scene
from robotball.rotations import rotation_matrix
from tests.random_robots import random_scene, random_tree
from tests.scenes import FOUR

RNG = np.random.default_rng(1)
TREES = [random_tree(RNG, framed) for framed in (False, True)]
RANDOM = [*TREES, *(random_scene(RNG) for _ in range(20))]


def states_of(scene: Scene) -> States:
    """The scene's robot at its start."""
    hinges = scene.hinges
    rates, angles = (np.array([[getattr(h, key) for h in hinges]]) for key in ("rate", "angle"))
    omega = scene.angular_velocity_at(scene.start)[None]
    gamma = rotation_matrix(scene.start.attitude)[None, 2]
    return scene.robot.states(gamma, angles, omega, rates)


def test_momentum_of_the_bodies_is_that_of_the_start() -> None:
    """ω of M by (3.2), (3.3) or 𝓜, and M by sums over bodies: with hinges off zero, in both models.

    Measured 2e-14, the rounding of numbers of some 10.
    """
    for scene in [*map(load_scene, FOUR), *RANDOM]:
        M = states_of(scene).momentum(scene.rolling)[0]
        to_world = rotation_matrix(scene.start.attitude)
        assert np.abs(to_world @ M - scene.start.momentum).max() < 2e-14
