"""Files of programs with other physics than the scene: MuJoCo with one setting changed, own steps.

The own program rolls a balanced ball with constant rates and takes its formulas from Euler's
equations, so that it shares nothing with robotball but the numbers of the bodies.
"""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball.engines.mujoco.mjcf_export import write_model
from robotball.rotations import Array

INTERVAL = 0.02  # s

Change = Callable[[Any], None]


def mujoco_file(
    scene: rb.Scene,
    change: Change,
    end: float = 3.0,
    timestep: float = 1e-3,
    interval: float = INTERVAL,
) -> rb.Trajectory:
    """Return a run of the scene's exported MJCF after a change of the model."""
    spec = mujoco.MjSpec.from_string(write_model(scene, rb.preset("accurate")).xml)
    spec.option.timestep = timestep
    change(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    frame, shell = model.body("frame").id, model.body("shell").id
    hinges = [(hinge, model.joint(hinge.name)) for hinge in scene.hinges if hinge.motor]
    rows, every = [], round(interval / timestep)
    for step in range(round(end / timestep) + 1):
        for i, drive in enumerate(h.command for h, _ in hinges if model.nu):
            data.ctrl[i] = drive.rate(data.time)
        if step % every == 0:
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            velocity = np.zeros(6)
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, frame, velocity, 1)
            at = (
                [data.qpos[j.qposadr[0]] for _, j in hinges],
                [data.qvel[j.dofadr[0]] for _, j in hinges],
            )
            rows.append(
                [data.time, *data.xpos[shell], *data.xquat[frame], *velocity[:3], *at[0], *at[1]]
            )
        mujoco.mj_step(model, data)
    table, names = np.array(rows), [hinge.name for hinge, _ in hinges]
    columns = [f"{name}_angle" for name in names] + [f"{name}_rate" for name in names]
    return rb.Trajectory(
        "run.csv",
        step * 0 + table[:, 0],
        table[:, 1:4],
        table[:, 4:8],
        table[:, 8:11],
        others=dict(zip(columns, table[:, 11:].T, strict=True)),
    )


def own_file(
    scene: rb.Scene,
    end: float = 3.0,
    timestep: float = 1e-3,
    interval: float = INTERVAL,
    *,
    gyroscopic: tuple[float, float] = (1.0, 1.0),
    euler: str = "",
    torque: Callable[[Array, Array], Array] = lambda omega, velocity: np.zeros(3),
) -> rb.Trajectory:
    """Return a run of an own program for a balanced ball with constant rates, RK4 or Euler.

    gyroscopic: factors of ω×Iω and ω×k; torque: about the contact point, for the shell's ω and v.
    """
    ball, a, up = scene.ball, scene.ball.radius, np.array([0.0, 0.0, 1.0])
    rates = [float(drive.rate(0.0)) for drive in scene.drives]
    relative = rates[0] * ball.shell.axis  # of the frame in the shell
    k = sum((r.axial_inertia * w * r.axis for r, w in zip(ball.rotors, rates[1:], strict=True)), 0)
    k = k - ball.shell.axial_inertia * relative
    level = np.diag([1.0, 1.0, 0.0])

    def faster(R: Rotation, shell: Array) -> Array:
        """Return the rate of the shell's ω, world axes."""
        I, spin = R.as_matrix() @ ball.inertia @ R.as_matrix().T, R.apply(relative)
        w = shell + spin
        right = torque(shell, a * np.cross(shell, up))
        right = right - gyroscopic[0] * np.cross(w, I @ w) - gyroscopic[1] * np.cross(w, R.apply(k))
        # The rate of the frame's ω is that of the shell's and w×spin.
        right = right - I @ np.cross(w, spin)
        left = I + ball.d * level
        if scene.rolling == "rubber":
            left, right = np.block([[left, up[:, None]], [up, 0.0]]), np.append(right, 0.0)
        return np.linalg.solve(left, right)[:3]

    def moved(R: Rotation, shell: Array, h: float) -> Rotation:
        """Return the frame's attitude after the shell has turned with ω for h."""
        return Rotation.from_rotvec(h * shell) * R * Rotation.from_rotvec(h * relative)

    R = Rotation.from_quat(scene.start.attitude, scalar_first=True)
    shell = R.apply(scene.angular_velocity_at(scene.start) - relative)
    point, rows, h = np.zeros(2), [], timestep
    for step in range(round(end / h) + 1):
        if step % round(interval / h) == 0:
            seen = R.inv().apply(shell) + relative
            rows.append([step * h, *point, a, *R.as_quat(scalar_first=True), *seen])
        turning = [shell]
        if euler:
            shell = shell + h * faster(R, shell)
            turning = [turning[0] if euler == "explicit" else shell]
            R = moved(R, turning[0], h)
        else:
            # RK4 with the mean of ω for the attitude, whose error is of third order per step.
            k1 = faster(R, shell)
            k2 = faster(moved(R, shell + h / 4 * k1, h / 2), shell + h / 2 * k1)
            k3 = faster(moved(R, shell + h / 4 * k2, h / 2), shell + h / 2 * k2)
            k4 = faster(moved(R, shell + h / 2 * k3, h), shell + h * k3)
            shell, mean = (
                shell + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4),
                shell + h / 6 * (k1 + k2 + k3),
            )
            turning = [mean]
            R = moved(R, mean, h)
        point = point + h * a * np.array([turning[0][1], -turning[0][0]])
    table = np.array(rows)
    return rb.Trajectory("run.csv", table[:, 0], table[:, 1:4], table[:, 4:8], table[:, 8:11])
