"""MJX's copy into MuJoCo's data leaves the contact's adhesion as it was in memory.

A ball of 1 kg rests on a plane under 9 m/s². In data whose contact had an adhesion of 2 N before,
MJX 3.17 copies every field of a contact that it knows, and `mj_contactForce` of MuJoCo, 3.17 and
4.0, takes the adhesion, which it does not know, off the normal force. Forces [N] of the same state:
of the constraint's row, on the free joint, and by mj_contactForce from the copy; in new data the
adhesion is whatever its memory held.
"""

from importlib.metadata import version

import mujoco
import numpy as np

try:
    import jax
    from mujoco import mjx
except ImportError:
    raise SystemExit("skipped: MJX is not installed") from None

REST = """<mujoco><option gravity="0 0 -9" iterations="50" tolerance="0"/><worldbody>
<geom type="plane" size="0 0 1"/><body pos="0 0 .999"><freejoint/><geom size="1" mass="1"/></body>
</worldbody></mujoco>"""
jax.config.update("jax_enable_x64", True)
model = mujoco.MjModel.from_xml_string(REST)
data = mujoco.MjData(model)
for _ in range(2000):
    mujoco.mj_step(model, data)
state = jax.jit(mjx.forward)(mjx.put_model(model), mjx.put_data(model, data))
data.contact.adhesion[:] = 2.0
mjx.get_data_into(data, model, state)
wrench = np.zeros(6)
mujoco.mj_contactForce(model, data, 0, wrench)
print("constraint:", float(data.efc_force.sum()))
print("free joint:", float(state.qfrc_constraint[2]))
print("contact force of the copy:", float(wrench[0]))
print("expected: 9 in each line")
print("version: MJX", version("mujoco-mjx"), "on MuJoCo", version("mujoco"))
print("verdict: open; none found, see reports/mjx_contact_force.md")
