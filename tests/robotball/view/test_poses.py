"""The poses of a ball's bodies agree with their velocities."""

import numpy as np

from robotball import integrate
from robotball.rotations import rotation_matrix
from tests.poses import poses
from tests.random_robots import random_scene, random_tree

RNG = np.random.default_rng(1)
TREES = [random_tree(RNG, framed) for framed in (False, True)]


def test_velocities_are_derivatives_of_poses() -> None:
    """Compared with central differences of positions and attitudes.

    Measured 4e-10 m/s and 2e-9 rad/s: rounding over 2e-5 s, and the error of the difference.
    """
    step = 1e-5
    for scene in (*TREES, *(random_scene(RNG) for _ in range(6))):
        for pose in poses(integrate(scene, np.array([0.0, step, 2 * step]))).values():
            difference = (pose.position[2] - pose.position[0]) / (2 * step)
            assert np.abs(difference - pose.velocity[1]).max() < 1.2e-9
            R = rotation_matrix(pose.attitude)
            turn = (R[2] - R[0]) @ R[1].T / (2 * step)
            spin = np.array([turn[2, 1], turn[0, 2], turn[1, 0]])
            assert np.abs(spin - pose.angular_velocity[1]).max() < 7e-9
