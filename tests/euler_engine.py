"""A user's engine: forward Euler on the rotation, in a loop of ten lines."""

import numpy as np
from scipy.spatial.transform import Rotation

from robotball import Scene, Trajectory
from robotball.rotations import Array


def euler(scene: Scene, timestep: float, samples: int = 1, end: float | None = None) -> Trajectory:
    """Return a trajectory with equal steps [s], recording every `samples`-th.

    It rolls without slip; path and attitude have first-order errors.
    """
    start = scene.start
    rotation = Rotation.from_quat(start.attitude, scalar_first=True)
    axis, a = scene.ball.shell.axis, scene.ball.radius
    point, rows = np.zeros(2), []
    steps = round((scene.duration if end is None else end) / timestep)
    for i in range(steps + 1):
        t = i * timestep
        omega = angular_velocity(scene, t, rotation.as_matrix())
        if i % samples == 0:
            rows.append(
                np.concatenate(
                    [[t], point, rotation.as_quat(canonical=True, scalar_first=True), omega]
                )
            )
        shell = rotation.apply(omega - float(scene.drives[0].rate(t)) * axis)
        point = point + timestep * a * np.array([shell[1], -shell[0]])
        rotation = rotation * Rotation.from_rotvec(timestep * omega)
    table = np.array(rows)
    height = np.full(len(table), a)
    return Trajectory(
        name="run.csv",
        times=table[:, 0],
        position=np.column_stack([table[:, 1:3], height]),
        attitude=table[:, 3:7],
        angular_velocity=table[:, 7:],
    )


def angular_velocity(scene: Scene, t: float, R: Array) -> Array:
    """Return ω (3,) in frame axes for the frame's attitude (3, 3); M is constant in space."""
    axes = scene.principal_axes
    M, gamma = axes.T @ R.T @ scene.start.momentum, axes.T @ R[2]
    omega = scene.parameters_at(t).angular_velocity(tuple(M), tuple(gamma))
    return np.asarray(axes @ np.array(omega))
