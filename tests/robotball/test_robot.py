"""Momenta, energy and poses of any robot, against the reduced equations and body by body."""

from dataclasses import replace

import numpy as np
import pytest

from robotball import Motion, integrate, load_scene
from robotball.files.export import poses
from robotball.mechanics import States, robot_of
from robotball.rotations import multiply, rotation_matrix
from robotball.scene import Scene
from tests.random_robots import random_scene
from tests.scenes import FOUR


def states_of(scene: Scene) -> States:
    """The scene's robot at its start."""
    hinges = scene.hinges
    rates, angles = (np.array([[getattr(h, key) for h in hinges]]) for key in ("rate", "angle"))
    omega = scene.angular_velocity_at(scene.start)[None]
    gamma = rotation_matrix(scene.start.attitude)[None, 2]
    return scene.robot.states(gamma, angles, omega, rates)


@pytest.mark.parametrize("name", FOUR)
def test_momentum_of_a_balanced_ball_is_the_papers(name: str) -> None:
    """Both ways between M and ω. Measured 9e-15 kg m²/s and 5e-15 rad/s: rounding of numbers
    of some 10.
    """
    scene = load_scene(name)
    motion = integrate(scene)
    robot, to_world = robot_of(scene.ball), rotation_matrix(motion.attitude)
    angles, rates = motion.hinge_angles, motion.hinge_rates
    states = robot.states(motion.gamma, angles, motion.angular_velocity, rates)
    M = np.einsum("nij,nj->ni", to_world, states.momentum(scene.rolling))
    assert np.abs(M - motion.momentum).max() < 2e-14
    in_frame = np.einsum("nji,nj->ni", to_world, motion.momentum)
    omega = robot.angular_velocity(motion.gamma, angles, in_frame, rates, scene.rolling)
    assert np.abs(omega - motion.angular_velocity).max() < 2e-14


def test_kinetic_energy_is_that_of_the_bodies() -> None:
    """u·𝓜u/2 = Σ (m v² + ω·Jω)/2 + Σ B φ̇²/2, and 𝓜 is symmetric and positive; 30 robots.

    Measured 5e-16, relative.
    """
    rng = np.random.default_rng(1)
    for _ in range(30):
        scene = random_scene(rng)
        states, bodies = states_of(scene), scene.robot.bodies
        matrix = states.matrix[:, :, 0]
        assert np.abs(matrix - matrix.T).max() <= 1e-16 * matrix.max()
        assert np.linalg.eigvalsh(matrix)[0] > 0
        tensors = states.placed[:, 6:, 0].reshape(-1, 3, 3)
        turning, velocity = states.turning[:, 0], states.velocities[:, 0]
        energy = np.einsum("bi,bij,bj->", turning, tensors, turning) / 2
        energy += bodies[:, 0] @ (velocity**2).sum(axis=1) / 2
        energy += bodies[1:, 19] @ states.u[3:, 0] ** 2 / 2
        assert states.kinetic_energy[0] == pytest.approx(energy, rel=3e-15)


def test_start_gives_back_its_angular_velocity() -> None:
    """M is made of ω and gives it back, in both models, with hinges off zero. Measured 2e-14."""
    rng = np.random.default_rng(2)
    for _ in range(30):
        scene = random_scene(rng)
        M = states_of(scene).momentum(scene.rolling)[0]
        to_world = rotation_matrix(scene.start.attitude)
        assert np.abs(to_world @ M - scene.start.momentum).max() < 1e-14


def still_motion(scene: Scene, step: float) -> Motion:
    """Two states of the scene's robot, a short time apart, as a motion that knows no forces."""
    hinges, states = scene.hinges, states_of(scene)
    omega, start = scene.angular_velocity_at(scene.start), scene.start
    shell = states.turning[0, 0]
    to_world = rotation_matrix(start.attitude)
    velocity = to_world @ (scene.ball.radius * np.cross(shell, to_world[2]))
    rates = np.array([hinge.rate for hinge in hinges])
    angles = np.array([hinge.angle for hinge in hinges])
    moved = []
    for t in (-step, step):
        half = omega * t / 2
        turn = np.array([1.0, *half]) / np.linalg.norm([1.0, *half])
        moved.append((multiply(start.attitude, turn), velocity[:2] * t, angles + rates * t))
    attitude, point, at = (np.array(part) for part in zip(*moved, strict=True))
    pair = np.array([0.0, 0.0])
    known = integrate(load_scene("fig12"), np.array([0.0, 1.0]))
    return replace(
        known,
        scene=scene,
        times=pair,
        contact_point=point,
        attitude=attitude,
        momentum=np.zeros((2, 3)),
        angular_velocity=np.array([omega, omega]),
        hinge_angles=at,
        hinge_rates=np.array([rates, rates]),
    )


def test_poses_move_at_their_velocities() -> None:
    """Central differences of positions and attitudes are the velocities; 10 robots.

    Measured 2e-8 m/s and 5e-8 rad/s: the difference's own error, h² = 1e-8 of the motion.
    """
    rng = np.random.default_rng(3)
    step = 1e-4
    for _ in range(10):
        motion = still_motion(random_scene(rng), step)
        for pose in poses(motion).values():
            mean = pose.velocity.mean(axis=0)
            difference = (pose.position[1] - pose.position[0]) / (2 * step)
            assert np.abs(difference - mean).max() < 2e-7
            R = rotation_matrix(pose.attitude)
            turn = (R[1] - R[0]) @ R.mean(axis=0).T / (2 * step)
            spin = np.array([turn[2, 1], turn[0, 2], turn[1, 0]])
            assert np.abs(spin - pose.angular_velocity.mean(axis=0)).max() < 2e-6
