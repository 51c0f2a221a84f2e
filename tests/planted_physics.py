"""Files of programs with other physics than the scene: MuJoCo with one setting changed, own steps.

The own program rolls a balanced ball with constant rates by Euler's equations, so it shares nothing
with robotball but the numbers of the bodies.
"""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball.engines.mujoco.mjcf_export import write_model
from robotball.rotations import Array

INTERVAL = 0.02  # s, between rows

Change = Callable[[Any], None]
Torque = Callable[[Array], Array]


def mujoco_file(
    scene: rb.Scene, change: Change, end: float = 2.0, timestep: float = 2e-3
) -> rb.Trajectory:
    """Return a run of the scene's exported MJCF after a change of its MjSpec."""
    spec = mujoco.MjSpec.from_string(write_model(scene, rb.preset("accurate")).xml)
    spec.option.timestep = timestep
    change(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    frame, shell, velocity = model.body("frame").id, model.body("shell").id, np.zeros(6)
    hinges = [(hinge, model.joint(hinge.name)) for hinge in scene.hinges if hinge.motor]
    rows = []
    for step in range(round(end / timestep) + 1):
        for i, (hinge, _) in enumerate(hinges[: model.nu]):
            data.ctrl[i] = hinge.command.rate(data.time)
        if step % round(INTERVAL / timestep) == 0:
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, frame, velocity, 1)
            angles = [data.qpos[joint.qposadr[0]] for _, joint in hinges]
            rates = [data.qvel[joint.dofadr[0]] for _, joint in hinges]
            row = [data.time, *data.xpos[shell], *data.xquat[frame], *velocity[:3]]
            rows.append([*row, *angles, *rates])
        mujoco.mj_step(model, data)
    names = [f"{hinge.name}_{of}" for of in ("angle", "rate") for hinge, _ in hinges]
    return _trajectory(rows, names)


def own_file(
    scene: rb.Scene,
    gyroscopic: tuple[float, float] = (1.0, 1.0),
    euler: str = "",
    torque: Torque = np.zeros_like,
    end: float = 2.0,
    timestep: float = 5e-3,
) -> rb.Trajectory:
    """Return a run of the own program, with RK4 or explicit or semi-implicit Euler steps.

    gyroscopic: factors of ω×Iω and ω×k; torque: about the contact point, for the shell's ω.
    """
    ball, up, h = scene.ball, np.array([0.0, 0.0, 1.0]), timestep
    rates = [float(drive.rate(0.0)) for drive in scene.drives]
    relative = rates[0] * ball.shell.axis  # of the frame in the shell
    k = -ball.shell.axial_inertia * relative
    for rotor, rate in zip(ball.rotors, rates[1:], strict=True):
        k = k + rotor.axial_inertia * rate * rotor.axis

    def faster(R: Rotation, shell: Array) -> Array:
        """Return the rate of the shell's ω, world axes."""
        inertia, spin = R.as_matrix() @ ball.inertia @ R.as_matrix().T, R.apply(relative)
        w = shell + spin
        right = torque(shell) - gyroscopic[0] * np.cross(w, inertia @ w)
        right = right - gyroscopic[1] * np.cross(w, R.apply(k)) - inertia @ np.cross(w, spin)
        left = inertia + ball.d * np.diag([1.0, 1.0, 0.0])
        if scene.rolling == "rubber":
            left, right = np.block([[left, up[:, None]], [up, 0.0]]), np.append(right, 0.0)
        return np.asarray(np.linalg.solve(left, right)[:3], dtype=float)

    def moved(R: Rotation, shell: Array, h: float) -> Rotation:
        """Return the frame's attitude after the shell has turned with ω for h."""
        return Rotation.from_rotvec(h * shell) * R * Rotation.from_rotvec(h * relative)

    R = Rotation.from_quat(scene.start.attitude, scalar_first=True)
    shell = R.apply(scene.angular_velocity_at(scene.start) - relative)
    point, rows = np.zeros(2), []
    for step in range(round(end / h) + 1):
        if step % round(INTERVAL / h) == 0:
            omega = R.inv().apply(shell) + relative
            attitude = R.as_quat(scalar_first=True)
            rows.append([step * h, *point, ball.radius, *attitude, *omega])
        k1 = faster(R, shell)
        if euler:
            later = shell + h * k1
            turning = shell if euler == "explicit" else later
        else:
            # RK4; the attitude turns with the mean of ω, with an error of h³ in a step.
            k2 = faster(moved(R, shell + h / 4 * k1, h / 2), shell + h / 2 * k1)
            k3 = faster(moved(R, shell + h / 4 * k2, h / 2), shell + h / 2 * k2)
            k4 = faster(moved(R, shell + h / 2 * k3, h), shell + h * k3)
            later = shell + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            turning = shell + h / 6 * (k1 + k2 + k3)
        R, shell = moved(R, turning, h), later
        point = point + h * ball.radius * np.array([turning[1], -turning[0]])
    return _trajectory(rows, [])


def _trajectory(rows: list[list[float]], names: list[str]) -> rb.Trajectory:
    table = np.array(rows)
    columns = table[:, 0], table[:, 1:4], table[:, 4:8], table[:, 8:11]
    return rb.Trajectory("run.csv", *columns, others=dict(zip(names, table[:, 11:].T, strict=True)))
