"""Before a load reverses a joint, dry friction pushes the joint along its velocity at any timestep.

A body of 1 kg on a slide joint with frictionloss 1 N starts at 1 m/s against a load of 10 N.
Coulomb's friction is against the velocity at every instant. Printed under RK4, with the default
`solreffriction` and with a damping of 1.8 over the timestep: how long friction acts along the
velocity before the reversal, and the error of the position after 0.5 s, over the distance moved.
"""

from importlib.metadata import version

import mujoco
import numpy as np

SLIDE = """<mujoco><option timestep="{}" integrator="RK4" gravity="-10 0 0"/><worldbody><body>
<joint type="slide" axis="1 0 0" frictionloss="1" solreffriction="{}"/><geom size="1" mass="1"/>
</body></worldbody></mujoco>"""
END, UP, DOWN = 0.5, 10 + 1, 10 - 1  # s; m/s², before and after the reversal
TOP, TURN = 1 / (2 * UP), 1 / UP
DROP = DOWN * (END - TURN) ** 2 / 2


def pushed_and_error(step: float, reference: str) -> tuple[float, float]:
    model = mujoco.MjModel.from_xml_string(SLIDE.format(step, reference))
    data = mujoco.MjData(model)
    data.qvel[0], along = 1.0, 0
    for _ in range(round(END / step)):
        before = data.qvel[0]
        mujoco.mj_step(model, data)
        along += bool(before > 0 and data.qfrc_constraint[0] > 0)
    return 1e3 * along * step, float(np.abs(data.qpos[0] - (TOP - DROP))) / (TOP + DROP)


for step in (5e-3, 1e-3, 2e-4):
    for label, reference in (("default", ".02 1"), ("hard", f"0 {-1.8 / step}")):
        pushed, error = pushed_and_error(step, reference)
        print(f"{label}, {1e3 * step:g} ms, along [ms]:", pushed)
        print(f"{label}, {1e3 * step:g} ms, error:", error)
print("expected: 0 ms, and errors that vanish with the timestep")
print("version: MuJoCo", version("mujoco"))
print("verdict: open; no report found, see reports/mujoco_dry_friction.md")
