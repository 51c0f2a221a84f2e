"""implicitfast treats the gyroscopic term explicitly: with a rotor, momentum grows as with Euler.

A free body with moments 0.5, 0.7 and 0.3 kg m² turns for 10 s at 1 ms, alone and with a rotor at
100 rad/s on a hinge. Its angular momentum is constant. Printed: the relative change of its norm.
With the rotor it equals Euler's in MuJoCo 3.5, 3.10, 3.11, 3.17 and 4.0. Alone it is +1.6e-2 up to
3.6, as with Euler, 2e-14 from 3.7 to 3.10, and -1.6e-2 since 3.11, as with implicit; `python -m
bench.history mujoco` measures every version.
"""

from importlib.metadata import version

import mujoco
import numpy as np

BODY = """<mujoco><option timestep="1e-3" gravity="0 0 0" integrator="{}"/><worldbody><body>
<freejoint/><inertial pos="0 0 0" mass="1" diaginertia=".5 .7 .3"/>{}</body></worldbody></mujoco>"""
ROTOR = """<body><joint axis="1 0 0"/>
<inertial pos="0 0 0" mass=".1" diaginertia=".02 .01 .01"/></body>"""


def momentum(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    return float(np.linalg.norm(data.subtree_angmom[1]))


def change(integrator: str, rotor: str) -> float:
    model = mujoco.MjModel.from_xml_string(BODY.format(integrator, rotor))
    data = mujoco.MjData(model)
    data.qvel[3:6] = 3.0, 1.0, 5.0
    data.qvel[6:] = 100.0
    before = momentum(model, data)
    for _ in range(10_000):
        mujoco.mj_step(model, data)
    return momentum(model, data) / before - 1


for integrator in ("Euler", "implicitfast", "implicit", "RK4"):
    print(f"{integrator}, alone:", change(integrator, ""))
    print(f"{integrator}, with a rotor:", change(integrator, ROTOR))
print("expected: 0, because no torque acts on a free body")
print("version: MuJoCo", version("mujoco"))
print("verdict: documented; mujoco #3553 and #3554")
