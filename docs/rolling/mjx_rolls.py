"""The ball of Fig. 12 in MJX: RK4 with steps of 5 ms in double precision.

MJX has no noslip. A contact with a regulariser of a hundredth rolls without it. The model and its
copies are MuJoCo's. Huge armatures keep the hinge rates constant.
"""

from importlib.metadata import version

import mujoco
import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

try:
    import jax
    from mujoco import mjx
except ImportError:
    raise SystemExit("skipped: MJX is not installed") from None

jax.config.update("jax_enable_x64", True)

# A shell of radius 1 m holds a frame that turns about z at 2 rad/s, and the frame a rotor. Masses:
# 0.07, 0.8016 and 0.0284 kg, all centred. Inertias, M and K in the frame's axes, SI units.
E, A, K, OMEGA = np.eye(3), np.diag([0.7, 0.6, 0.8]), np.array([2.0, 2, 0]), np.array([0, 0, 2.0])
SHELL, inner = 0.07 * 2 / 3 * E, K + (0.07 * 2 / 3 + 0.9) * OMEGA
AXIS, SPIN = inner / np.linalg.norm(inner), np.linalg.norm(inner) / 0.023  # rotor: 148 rad/s
ROTOR = 0.0115 * (E + np.outer(AXIS, AXIS))
FRAME = np.linalg.inv(A) - 0.9 * E - SHELL - ROTOR
TIMES, level, h = np.linspace(0, 10, 501), np.r_[np.sin(0.6), np.cos(0.6), 0], np.sqrt(1 - 0.72**2)
M, GAMMA = 5 * (h * level + 0.72 * E[2]), 0.72 * level - h * E[2]
ROTATION = np.array([-M, np.cross(M, GAMMA), 5 * GAMMA]) / 5  # from frame to world axes


def rates(t, y):
    """Return the rates of M, the world's axes and the contact point, from the paper's (3.2)."""
    M, alpha, beta, gamma = axes = y[:12].reshape(4, 3)
    f = gamma @ A @ gamma
    w = A @ (np.cross(M, A @ gamma) + (OMEGA + A @ K) @ gamma * gamma - f * K) / f
    return [*np.cross(axes, w).ravel(), beta @ (w - OMEGA), -alpha @ (w - OMEGA)]


start = np.array([*M, *ROTATION.ravel(), 0, 0])
truth = solve_ivp(rates, (0, 10), start, "DOP853", TIMES, rtol=1e-11, atol=1e-11).y[12:].T
velocity = np.array([*rates(0, start)[12:], 0])
omega = np.cross([0, 0, 1], velocity)  # of the shell, which does not spin


def inertial(mass, inertia):
    moments = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return f'<inertial pos="0 0 0" mass="{mass}" fullinertia="{" ".join(map(str, moments))}"/>'


# The margin is the depth at which the contact carries the ball, so the ball touches at height 1.
XML = f"""<mujoco><option timestep="0.005" integrator="RK4" iterations="3" ls_iterations="5"
    tolerance="0" cone="elliptic"><flag warmstart="disable"/></option>
<worldbody><geom name="floor" type="plane" size="0 0 1"/>
  <body pos="0 0 1"><freejoint/>{inertial(0.07, SHELL)}<geom name="ball" size="1" mass="0"/>
    <body><joint axis="0 0 1" armature="1e14"/>{inertial(0.8016, FRAME)}
      <body><joint axis="{" ".join(map(str, AXIS))}" armature="1e14"/>{inertial(0.0284, ROTOR)}
      </body></body></body></worldbody>
<contact><pair geom1="floor" geom2="ball" condim="4" friction="20 20 20" solref="0.04 1"
    solimp="0.9999 0.9999" solreffriction="-1 -0.5" margin="{9.81e-6 * 0.04**2}"/></contact>
</mujoco>"""
model = mujoco.MjModel.from_xml_string(XML)
model.body_invweight0[1] *= 0.01
data, path = mujoco.MjData(model), [[0, 0]]
data.qpos[3:7] = np.roll(Rotation.from_matrix(ROTATION).as_quat(), 1)
data.qvel[:] = [*velocity, *ROTATION.T @ omega, 2, SPIN]
mujoco.mj_forward(model, data)
state, compiled, step = mjx.put_data(model, data), mjx.put_model(model), jax.jit(mjx.step)
for _ in TIMES[1:]:
    for _ in range(4):
        state = step(compiled, state)
    path.append(np.array(state.qpos[:2]))
length = np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()
print("best, 5 ms:", np.linalg.norm(path - truth, axis=1).max() / length)
print("version: MJX", version("mujoco-mjx"))
