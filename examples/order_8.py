"""Roll a ball in steps of order 8 in a loop of your own: python examples/order_8.py."""

import mujoco
import numpy as np
from scipy.integrate import DOP853

import robotball as rb
from robotball.engines.mujoco.model import build


def step(model: mujoco.MjModel, data: mujoco.MjData, length: float) -> None:
    """Take one step [s] of a free body with hinges, in place of mj_step."""
    began, state = data.time, np.append(data.qpos, data.qvel)
    slopes, turning = np.empty((12, len(state))), np.empty(4)

    def move(weights: np.ndarray, part: float) -> None:
        data.time = began + part * length
        moved = state + length * (weights @ slopes[: len(weights)])
        data.qpos[:], data.qvel[:] = moved[: model.nq], moved[model.nq :]

    for stage in range(12):
        move(DOP853.A[stage, :stage], DOP853.C[stage])
        mujoco.mj_forward(model, data)
        mujoco.mju_mulQuatAxis(turning, data.qpos[3:7], data.qvel[3:6] / 2)
        slopes[stage] = np.concatenate([data.qvel[:3], turning, data.qvel[6:], data.qacc])
    move(DOP853.B, 1.0)
    mujoco.mj_normalizeQuat(model, data.qpos)


built = build(rb.load_scene("fig12"), rb.preset("efficient"))
model, data = built.compiled, built.start_data()
for _ in range(40):
    step(model, data, 0.05)
off = np.linalg.norm(data.qpos[:2] - rb.integrate("fig12", 2.0).contact_point[-1, :2])
print(f"{data.time:.1f} s in 40 steps, within 1e-9 m: {off < 1e-9}")
