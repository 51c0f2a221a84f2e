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
    """qpos and qvel of a start on the constraints, with its hinges' angles and rates."""
    as_started = scene.hinges_at(start)
    shell, frame = scene.ball.shell, as_started[0]
    turning = [as_started[hinge.index] for hinge in hinges]
    # The free joint's angular velocity is local.
    frame_turning = scene.angular_velocity_at(start)
    shell_turning = frame_turning - frame.rate * shell.axis
    velocity = np.cross(rotation_matrix(start.attitude) @ shell_turning, [0.0, 0.0, shell.radius])
    attitude, root_turning = start.attitude, frame_turning
    if settings.root == "shell":
        root_turning = shell_turning
        if frame.angle:
            back = _turn(shell.axis, -frame.angle)
            # Seen from the shell, ω - Ω is turned on by the angle.
            attitude = multiply(attitude, back)
            root_turning = rotation_matrix(back).T @ shell_turning
    qpos = [0.0, 0.0, shell.radius, *attitude, *(hinge.angle for hinge in turning)]
    qvel = [*velocity, *root_turning, *(hinge.rate for hinge in turning)]
    return np.array(qpos), np.array(qvel)


def _turn(axis: Array, angle: float) -> Array:
    """The quaternion (4,) of a turn about a unit axis (3,) [rad]."""
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
