"""Regularised friction creeps under load, at a speed that follows from load, impedance and solref.

A ball of 1 kg that cannot turn lies on a slope with a load F along it, a third of the friction
limit. Printed: its velocity after 1 s over (1 - d)/d · F/m / (b · impratio), with the impedance
d = 0.95 and b = 2/(d · 0.02 s) of the default solref and an elliptic cone; finally, with one noslip
iteration, the velocity itself [m/s].
"""

from importlib.metadata import version

import mujoco

D, LOAD = 0.95, 3.0
SLIDE = """<mujoco><option timestep="1e-3" cone="elliptic" impratio="{}" noslip_iterations="{}"
 gravity="3 0 -9"/><default><geom solimp=".95 .95 .001 .5 1"/></default><worldbody>
<geom type="plane" size="0 0 1"/><body pos="0 0 1"><geom size="1" mass="1"/>
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
<joint type="slide" axis="0 0 1"/></body></worldbody></mujoco>"""


def velocity(impratio: int, noslip: int = 0) -> float:
    model = mujoco.MjModel.from_xml_string(SLIDE.format(impratio, noslip))
    data = mujoco.MjData(model)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    return float(data.qvel[0])


law = (1 - D) / D * LOAD / (2 / (D * 0.02))
for impratio in (1, 10, 100):
    print(f"impratio {impratio}:", velocity(impratio) / law * impratio)
print("noslip:", velocity(1, 1))
print("expected: 1 from the formula, 0 with noslip")
print("version: MuJoCo", version("mujoco"))
print("verdict: documented; mujoco #3328, documented by #3526; #3349 proposes stiction")
