"""Poses and velocities of a ball's bodies in world axes, for every sample of a motion."""

from dataclasses import dataclass

import numpy as np

from robotball.motion import Motion
from robotball.rotations import Array, continuous, from_matrix, multiply, rotation_matrix


@dataclass(frozen=True)
class _Poses:
    """Pose and velocity of a body at the n times of a motion, in world axes.

    position, velocity (n, 3): of the centre of mass [m, m/s]; attitude (n, 4): quaternion
    (w, x, y, z) relative to its orientation along the frame axes, at hinge angle 0;
    angular_velocity (n, 3) [rad/s].
    """

    position: Array
    attitude: Array
    velocity: Array
    angular_velocity: Array


def poses(motion: Motion) -> dict[str, _Poses]:
    """Return the poses of all bodies of the ball, keyed by name."""
    scene, angles = motion.scene, motion.hinge_angles
    states = scene.robot.states(motion.gamma, angles, motion.angular_velocity, motion.hinge_rates)
    to_world, radius = rotation_matrix(motion.attitude), scene.ball.radius
    centre = np.column_stack([motion.contact_point, np.full(len(angles), radius)])

    def in_world(vectors: Array) -> Array:
        return np.asarray(np.einsum("nij,nj->ni", to_world, vectors))

    turned, _ = scene.robot.moved(angles)
    return {
        link.name: _Poses(
            position=centre + in_world(states.pose.placed[i, :3].T),
            attitude=continuous(multiply(motion.attitude, from_matrix(turned[i]))),
            velocity=in_world(states.velocities[i]),
            angular_velocity=in_world(states.turning[i]),
        )
        for i, link in enumerate(scene.ball.tree)
    }
