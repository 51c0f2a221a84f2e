"""Warp keeps MuJoCo's state in single precision: with RK4, shorter steps do not help.

A free body with moments 0.5, 0.7 and 0.3 kg m² and a rotor at 100 rad/s turns for 2 s. Printed: the
relative change of its angular momentum with MuJoCo, in double precision, and with Warp.
"""

from importlib.metadata import version

import mujoco
import numpy as np

try:
    import mujoco_warp
    import warp
except ImportError:
    raise SystemExit("skipped: MuJoCo Warp is not installed") from None

BODY = """<mujoco><option timestep="{}" gravity="0 0 0" integrator="RK4"/><worldbody><body>
<freejoint/><inertial pos="0 0 0" mass="1" diaginertia=".5 .7 .3"/><body><joint axis="1 0 0"/>
<inertial pos="0 0 0" mass=".1" diaginertia=".02 .01 .01"/></body></body></worldbody></mujoco>"""
warp.config.quiet = True


def momentum(model: mujoco.MjModel, qpos: np.ndarray, qvel: np.ndarray) -> float:
    data = mujoco.MjData(model)
    data.qpos, data.qvel = qpos, qvel
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    return float(np.linalg.norm(data.subtree_angmom[1]))


for step in (20e-3, 5e-3):
    model = mujoco.MjModel.from_xml_string(BODY.format(step))
    data = mujoco.MjData(model)
    data.qvel[3:] = 3.0, 1.0, 5.0, 100.0
    before = momentum(model, data.qpos, data.qvel)
    with warp.ScopedDevice("cpu"):
        single, state = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data)
        for _ in range(round(2 / step)):
            mujoco.mj_step(model, data)
            mujoco_warp.step(single, state)
    double = momentum(model, data.qpos, data.qvel) / before - 1
    warped = momentum(model, state.qpos.numpy()[0], state.qvel.numpy()[0]) / before - 1
    print(f"MuJoCo, {step * 1e3:g} ms:", double)
    print(f"Warp, {step * 1e3:g} ms:", warped)
print("expected: the same change as MuJoCo")
print("version: MuJoCo Warp", version("mujoco-warp"))
print("verdict: documented; MuJoCo Warp computes in 32 bits")
