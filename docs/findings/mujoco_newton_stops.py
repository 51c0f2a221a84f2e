"""With a huge armature the solver Newton does not iterate: its tolerance is relative to inertia.

A sphere rolls down a slope with friction 20; a rotor inside has a hinge armature of 1e14 kg m².
With the default tolerance Newton makes no iteration and the sphere slides, without a warning.
According to the manual the criterion is scaled by the trace of the inertia, here 1e14; a tolerance
of 0 is the remedy. Up to MuJoCo 3.17 it was scaled by the statistic `meaninertia`, which a model
could set. Printed: iterations of the last step, and the slip after 1 s [m/s].
"""

from importlib.metadata import version

import mujoco

SLIDE = """<mujoco><option timestep="1e-3" solver="Newton" cone="elliptic" gravity="3 0 -9" {}/>
<worldbody><geom type="plane" size="0 0 1"/><body pos="0 0 1"><freejoint/>
<geom size="1" mass="1" friction="20"/><body><joint axis="0 0 1" armature="1e14"/>
<inertial pos="0 0 0" mass=".1" diaginertia=".1 .1 .1"/></body></body></worldbody></mujoco>"""

for option in ("", 'tolerance="0"'):
    model = mujoco.MjModel.from_xml_string(SLIDE.format(option))
    data = mujoco.MjData(model)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    name = option or "default tolerance"
    print(f"{name}, iterations:", int(data.solver_niter[0]))
    print(f"{name}, slip:", data.qvel[0] - data.qvel[4])
    print(f"{name}, warnings:", int(data.warning.number.sum()))
print("expected: slip near 0, as with a tolerance of 0")
print("version: MuJoCo", version("mujoco"))
print("verdict: documented; MuJoCo's manual, XML reference, tolerance")
