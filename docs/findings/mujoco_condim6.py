"""With condim 6 a rolling friction of μ [m] brakes a rolling ball with the torque μ m g.

A solid sphere of radius 1 m starts to roll at 2 m/s, with the same friction coefficients for each
condim. Printed: the fraction of its speed lost in 1 s. Theory: μ g / (7/5 a²) t = 0.35 m/s of 2.
"""

from importlib.metadata import version

import mujoco

ROLL = """<mujoco><option timestep="1e-3" cone="elliptic" impratio="100"/><worldbody>
<geom type="plane" size="0 0 1" condim="1"/><body pos="0 0 1"><freejoint/>
<geom size="1" mass="1" condim="{}" friction="1 .005 .05"/></body></worldbody></mujoco>"""


def lost(condim: int) -> float:
    model = mujoco.MjModel.from_xml_string(ROLL.format(condim))
    data = mujoco.MjData(model)
    data.qvel[0], data.qvel[4] = 2.0, 2.0
    for _ in range(1000):
        mujoco.mj_step(model, data)
    return 1 - data.qvel[0] / 2


for condim in (3, 4, 6):
    print(f"condim {condim}:", lost(condim))
print("expected: 0.175 with condim 6, 0 with the others")
print("version: MuJoCo", version("mujoco"))
print("verdict: documented; MuJoCo's manual, Modeling, Preventing slip")
