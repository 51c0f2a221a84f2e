"""MJX returns NaN for a very hard contact with which MuJoCo still rolls the ball.

A ball of radius 1 m rolls down a slope with RK4 and an impedance of 0.9999; scaling down its
inverse weight makes the contact harder still. Printed: the velocity after 0.5 s at 5 ms [m/s] with
MuJoCo and with MJX in double precision. Theory: 5/7 · 3 · 0.5 = 1.0714.
"""

from importlib.metadata import version

import mujoco
import numpy as np

try:
    import jax
    from mujoco import mjx
except ImportError:
    raise SystemExit("skipped: MJX is not installed") from None

ROLL = """<mujoco><option timestep="5e-3" cone="elliptic" iterations="50" tolerance="0"
 gravity="3 0 -9" integrator="RK4"/><worldbody><geom type="plane" size="0 0 1"/>
<body pos="0 0 1"><freejoint/><geom size="1" mass="1" friction="20 20 0" condim="4"
 solimp=".9999 .9999 .001 .5 1"/></body></worldbody></mujoco>"""
jax.config.update("jax_enable_x64", True)
step = jax.jit(mjx.step)
for scale in (1e-2, 1e-6):
    model = mujoco.MjModel.from_xml_string(ROLL)
    model.body_invweight0[:] *= scale
    data = mujoco.MjData(model)
    compiled, state = mjx.put_model(model), mjx.put_data(model, data)
    for _ in range(100):
        mujoco.mj_step(model, data)
        state = step(compiled, state)
    print(f"MuJoCo, {scale:g}:", data.qvel[0])
    print(f"MJX, {scale:g}:", float(state.qvel[0]))
    print(f"MJX, {scale:g}, finite:", int(np.isfinite(state.qvel).all()))
print("expected: 1.0714 in each line, as with MuJoCo")
print("version: MJX", version("mujoco-mjx"))
print("verdict: open; no report found")
