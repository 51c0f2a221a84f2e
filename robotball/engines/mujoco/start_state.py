"""Where a run begins: the coordinates, velocities and controls of a model at a scene's start."""

import numpy as np

from robotball.engines.mujoco.hinges import Hinge
from robotball.engines.mujoco.settings import Settings
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.scene import Scene
from robotball.start import Start


def start_state(scene: Scene, settings: Settings, hinges: tuple[Hinge, ...]) -> dict[str, Array]:
    """The start's qpos, qvel and ctrl."""
    qpos, qvel = state_at(scene, settings, scene.start, hinges)
    ctrl = np.array([hinge.control(0.0) for hinge in hinges if hinge.actuated])
    return {"qpos": qpos, "qvel": qvel, **({"ctrl": ctrl} if len(ctrl) else {})}


def state_at(
    scene: Scene, settings: Settings, start: Start, hinges: tuple[Hinge, ...]
) -> tuple[Array, Array]:
    """qpos and qvel of a start on the constraints, the hinges at the scene's angles and rates."""
    shell, frame = scene.ball.shell, scene.hinges[0]
    # The free joint's angular velocity is local.
    frame_turning = angular_velocity(scene, start)
    shell_turning = frame_turning - frame.rate * shell.axis
    velocity = np.cross(rotation_matrix(start.attitude) @ shell_turning, [0.0, 0.0, shell.radius])
    attitude, root_turning = start.attitude, frame_turning
    if settings.root == "shell":
        root_turning = shell_turning
        if frame.angle and any(hinge.index == 0 for hinge in hinges):
            back = turned(shell.axis, -frame.angle)
            # Seen from the shell, ω - Ω is turned on by the angle.
            attitude = multiply(attitude, back)
            root_turning = rotation_matrix(back).T @ shell_turning
    qpos = [[0.0, 0.0, shell.radius], attitude, [hinge.of.angle for hinge in hinges]]
    qvel = [velocity, root_turning, [hinge.of.rate for hinge in hinges]]
    return np.concatenate(qpos), np.concatenate(qvel)


def angular_velocity(scene: Scene, start: Start) -> Array:
    if scene.not_reduced is None:
        return scene.angular_velocity_at(start)
    ball, shell, a = scene.ball, scene.ball.shell, scene.ball.radius
    R = rotation_matrix(start.attitude)
    gamma = R[2]
    pivots = [np.zeros(3), np.zeros(3), *(b.centre for b in ball.rotors)]
    pivots += [b.pivot for b in ball.pendulums]

    def momentum(omega_s):
        omega = omega_s + scene.hinges[0].rate * shell.axis
        v = a * np.cross(omega_s, gamma)
        turning = [omega_s, omega, *(omega + h.rate * h.axis for h in scene.hinges[1:])]
        L = np.zeros(3)
        for (_, body), w, p in zip(ball.named_bodies, turning, pivots, strict=True):
            velocity = v + (np.cross(omega, p) if p.any() else 0) + np.cross(w, body.centre - p)
            L += body.inertia @ w + np.cross(body.centre + a * gamma, body.mass * velocity)
        return L

    L0 = momentum(np.zeros(3))
    D = np.stack([momentum(e) - L0 for e in np.eye(3)], axis=1)
    M = R.T @ start.momentum
    if scene.rolling == "rubber":
        A = np.block([[D, -gamma[:, None]], [gamma[None], np.zeros((1, 1))]])
        omega_s = np.linalg.solve(A, [*(np.cross(M, gamma) - L0), 0.0])[:3]
    else:
        omega_s = np.linalg.solve(D, M - L0)
    return omega_s + scene.hinges[0].rate * shell.axis


def turned(axis: Array, angle: float) -> Array:
    """The quaternion (4,) of a turn about a unit axis (3,) [rad]."""
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
