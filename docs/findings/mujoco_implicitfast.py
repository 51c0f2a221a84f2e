"""implicitfast leaves the gyroscopic term explicit: with a rotor a body gains momentum as by Euler.

A body of moments .5, .7 and .3 kg m² turns freely for 10 s at steps of 1 ms, alone and with a rotor
at 100 rad/s on a hinge. Its angular momentum is constant; printed is the relative change of its
size. With the rotor it is Euler's in MuJoCo 3.5, 3.10, 3.11, 3.17 and 4.0. Alone it is +1.6e-2 up
to 3.6, as by Euler, 2e-14 from 3.7 to 3.10, and -1.6e-2 since 3.11, as by implicit:
`python -m bench.history mujoco` runs it in every version.
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


for each in ("Euler", "implicitfast", "implicit", "RK4"):
    print(f"{each}, alone:", change(each, ""))
    print(f"{each}, with a rotor:", change(each, ROTOR))
print("expected: 0 with a rotor as alone: nothing turns a free body")
print("version: MuJoCo", version("mujoco"))
print("verdict: documented; mujoco #3553 and #3554")
