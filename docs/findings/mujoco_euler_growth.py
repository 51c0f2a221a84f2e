"""Euler adds energy to a gyrostat, and the momentum doubles without a warning.

A free body with a rotor at 300 rad/s for 10 s at 2 ms. Printed: the final over the initial angular
momentum, which is constant, and the number of MuJoCo's warnings.
"""

from importlib.metadata import version

import mujoco
import numpy as np

BODY = """<mujoco><option timestep="2e-3" gravity="0 0 0" integrator="{}"/><worldbody><body>
<freejoint/><inertial pos="0 0 0" mass="1" diaginertia=".5 .7 .3"/><body><joint axis="1 0 0"/>
<inertial pos="0 0 0" mass=".1" diaginertia=".02 .01 .01"/></body></body></worldbody></mujoco>"""


def grown(integrator: str) -> tuple[float, int]:
    model = mujoco.MjModel.from_xml_string(BODY.format(integrator))
    data = mujoco.MjData(model)
    data.qvel[3:] = 3.0, 1.0, 5.0, 300.0
    sizes = []
    for _ in range(5001):
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        sizes.append(np.linalg.norm(data.subtree_angmom[1]))
        mujoco.mj_step(model, data)
    return sizes[-1] / sizes[0], int(data.warning.number.sum())


for integrator in ("Euler", "RK4"):
    ratio, warned = grown(integrator)
    print(f"{integrator}, momentum:", ratio)
    print(f"{integrator}, warnings:", warned)
print("expected: momentum 1, or a warning")
print("version: MuJoCo", version("mujoco"))
print("verdict: documented; MuJoCo's manual, Computation, Gyroscopic derivatives for free bodies")
