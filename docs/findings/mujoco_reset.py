"""A run that diverges restarts from the initial state and continues without an error.

A velocity servo too stiff for the step runs for 95 steps of 10 ms, with and without MuJoCo's
automatic reset. Printed: the final time [s], and whether the state is finite.
"""

from importlib.metadata import version

import mujoco
import numpy as np

SERVO = """<mujoco><option timestep="1e-2" integrator="RK4"><flag autoreset="{}"/></option>
<worldbody><body><joint name="hinge" axis="0 0 1"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
</worldbody><actuator><velocity joint="hinge" kv="1e4"/></actuator></mujoco>"""

for flag in ("enable", "disable"):
    model = mujoco.MjModel.from_xml_string(SERVO.format(flag))
    data = mujoco.MjData(model)
    data.ctrl[0] = 1.0
    for _ in range(95):
        mujoco.mj_step(model, data)
    print(f"{flag}, time:", data.time)
    print(f"{flag}, finite:", int(np.isfinite(data.qvel).all()))
print("expected: time 0.95, or a run that ends")
print("version: MuJoCo", version("mujoco"))
print("verdict: documented; MuJoCo's manual, XML reference, autoreset")
