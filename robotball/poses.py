"""Where the bodies of a motion are and how they move, for films, exports and checks.

The energy of a motion of any robot.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from robotball.motion import Motion
from robotball.rotations import Array, multiply, rotation_matrix


@dataclass(frozen=True)
class Poses:
    """One body at the n times of a motion, in world axes, SI units.

    position, velocity  (n, 3)  of the centre of mass
    attitude            (n, 4)  quaternion (w, x, y, z): how it is turned from where it is along
                                with the frame's axes, at its hinge's angle 0
    angular_velocity    (n, 3)
    """

    position: Array
    attitude: Array
    velocity: Array
    angular_velocity: Array


def poses(motion: Motion) -> dict[str, Poses]:
    """Of every body of the motion's ball, by its name."""
    scene, angles = motion.scene, motion.hinge_angles
    states = scene.robot.states(motion.gamma, angles, motion.angular_velocity, motion.hinge_rates)
    to_world, radius = rotation_matrix(motion.attitude), scene.ball.radius
    centre = np.column_stack([motion.contact_point, np.full(len(angles), radius)])

    def in_world(vectors: Array) -> Array:
        return np.asarray(np.einsum("nij,nj->ni", to_world, vectors))

    hinges = {hinge.name: (hinge.axis, angles[:, i]) for i, hinge in enumerate(scene.hinges)}
    # The frame is where it is; what turns in it by its hinge's angle is the shell, the other way.
    axis, angle = hinges.pop("frame")
    hinges["shell"] = (axis, -angle)
    found = {}
    for i, (name, _) in enumerate(scene.ball.named_bodies):
        attitude = motion.attitude
        if name in hinges:
            axis, angle = hinges[name]
            turn = Rotation.from_rotvec(np.outer(angle, axis)).as_quat(scalar_first=True)
            attitude = multiply(attitude, turn)
        found[name] = Poses(
            position=centre + in_world(states.placed[i, :3].T),
            attitude=attitude,
            velocity=in_world(states.velocities[i]),
            angular_velocity=in_world(states.turning[i]),
        )
    return found


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
