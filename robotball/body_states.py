"""Where every body of a ball is and how it moves, whatever turns in it: plain kinematics."""

from dataclasses import dataclass

import numpy as np

from robotball.rotations import Array, multiply, rotation_matrix
from robotball.scene import Scene


@dataclass(frozen=True)
class BodyState:
    """A body at n times, world axes, which have their origin in the plane.

    attitude          (n, 4) of the body; its axes are the frame's where its hinge is at angle 0
    centre_of_mass    (n, 3) m, from the sphere's centre
    velocity          (n, 3) m/s, of the centre of mass
    angular_velocity  (n, 3) rad/s
    inertia           (n, 3, 3) kg m² about the centre of mass
    """

    name: str
    mass: float
    attitude: Array
    centre_of_mass: Array
    velocity: Array
    angular_velocity: Array
    inertia: Array


def body_states(
    scene: Scene, attitude: Array, angular_velocity: Array, angles: Array, rates: Array
) -> tuple[BodyState, ...]:
    """Every body's state, the shell first, of a ball whose shell rolls without slipping.

    attitude (n, 4) and angular_velocity (n, 3), frame axes, are the frame's; angles and rates
    (n, h) the hinges' [rad, rad/s].
    """
    to_world = rotation_matrix(attitude)
    turns = {
        hinge.name: (_turned(hinge.axis, angle), np.outer(rate, hinge.axis), hinge.pivot)
        for hinge, angle, rate in zip(scene.hinges, angles.T, rates.T, strict=True)
    }
    quarter, rate, _ = turns.pop("frame")
    still = np.zeros_like(angular_velocity)
    fixed = np.tile([1.0, 0.0, 0.0, 0.0], (len(attitude), 1))
    shell = angular_velocity - rate
    centre = rolling_velocity(scene, attitude, shell)
    # The shell's own axes are the frame's turned back; about its axis its inertia is the same.
    back = quarter * [1.0, -1.0, -1.0, -1.0]
    states = []
    for name, body in scene.ball.named_bodies:
        own, more, pivot = turns.get(name, (fixed, still, np.zeros(3)))
        if name == "shell":
            own, turning = back, shell
        else:
            turning = angular_velocity + more
        R = rotation_matrix(own)
        arm = R @ (body.centre - pivot)
        velocity = np.cross(angular_velocity, pivot) + np.cross(turning, arm)
        states.append(
            BodyState(
                name=name,
                mass=body.mass,
                attitude=multiply(attitude, own),
                centre_of_mass=_world(to_world, pivot + arm),
                velocity=centre + _world(to_world, velocity),
                angular_velocity=_world(to_world, turning),
                inertia=to_world @ R @ body.inertia @ R.swapaxes(1, 2) @ to_world.swapaxes(1, 2),
            )
        )
    return tuple(states)


def rolling_velocity(scene: Scene, attitude: Array, shell: Array) -> Array:
    """(n, 3): the velocity of the centre of a shell that does not slip, world axes [m/s].

    attitude (n, 4) of the frame; shell (n, 3): the shell's angular velocity, frame axes [rad/s].
    """
    turning = _world(rotation_matrix(attitude), shell)
    return np.cross(turning, [0.0, 0.0, scene.ball.radius])


def momentum_of(scene: Scene, states: tuple[BodyState, ...]) -> Array:
    """M (n, 3), world axes: L about the contact point (classical), or γ×L (rubber) [kg m²/s]."""
    arm = np.array([0.0, 0.0, scene.ball.radius])
    L = sum(
        np.einsum("nij,nj->ni", each.inertia, each.angular_velocity)
        + np.cross(each.centre_of_mass + arm, each.mass * each.velocity)
        for each in states
    )
    return np.cross([0.0, 0.0, 1.0], L) if scene.rolling == "rubber" else np.asarray(L)


def _turned(axis: Array, angles: Array) -> Array:
    """The quaternions (n, 4) of turns about an axis (3,) by angles (n,) [rad]."""
    half = angles[:, None] / 2
    return np.concatenate([np.cos(half), np.sin(half) * axis], axis=1)


def _world(to_world: Array, v: Array) -> Array:
    return np.einsum("nij,nj->ni", to_world, np.broadcast_to(v, to_world.shape[:-1]))
