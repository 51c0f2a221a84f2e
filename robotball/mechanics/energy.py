"""The energy of a motion of any robot."""

import numpy as np

from robotball.motion import Motion
from robotball.rotations import Array, rotation_matrix


def energy(motion: Motion) -> Array:
    """T + V (n,) of a motion, with the kinetic energy of the armatures [J].

    V = -Σ m_b (r_b, G) from the plane's origin; springs are motors, and not in it.
    """
    scene, robot = motion.scene, motion.scene.robot
    angles, rates = motion.hinge_angles, motion.hinge_rates
    states = robot.states(motion.gamma, angles, motion.angular_velocity, rates)
    to_world = rotation_matrix(motion.attitude)
    height = np.full(len(angles), scene.ball.radius)
    centre = np.column_stack([motion.contact_point, height])
    centre = centre + np.einsum("nij,nj->ni", to_world, states.centre_of_mass)
    return np.asarray(states.kinetic_energy - scene.ball.mass * centre @ scene.gravity_world)
