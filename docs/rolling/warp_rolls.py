"""The ball of Fig. 12 in MuJoCo Warp: RK4 at 20 ms, single precision, on the processor.

The step is captured once as a graph. Single precision limits the impedance to 0.99 and the armature
to 3e4 kg m²; servos correct the hinge rates.
"""

from importlib.metadata import version

import mujoco
import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

try:
    import mujoco_warp
    import warp
except ImportError:
    raise SystemExit("skipped: MuJoCo Warp is not installed") from None

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
XML = f"""<mujoco><option timestep="0.02" integrator="RK4" iterations="3" ls_tolerance="0.01"
    tolerance="0" noslip_iterations="1" noslip_tolerance="0" cone="elliptic"/>
<worldbody><geom name="floor" type="plane" size="0 0 1"/>
  <body pos="0 0 1"><freejoint/>{inertial(0.07, SHELL)}<geom name="ball" size="1" mass="0"/>
    <body>{inertial(0.8016, FRAME)}<joint name="frame" axis="0 0 1" armature="3e4"/>
      <body>{inertial(0.0284, ROTOR)}
        <joint name="rotor" axis="{" ".join(map(str, AXIS))}" armature="3e4"/></body></body></body>
</worldbody><contact><pair geom1="floor" geom2="ball" condim="4" friction="20 20 20" solref="0.04 1"
    solimp="0.99 0.99" solreffriction="-1 -0.5" margin="{9.81e-2 * 0.04**2}"/></contact>
<actuator><velocity joint="frame" kv="1e6"/><velocity joint="rotor" kv="1e6"/></actuator>
</mujoco>"""
model = mujoco.MjModel.from_xml_string(XML)
data, path = mujoco.MjData(model), [[0, 0]]
data.qpos[3:7] = np.roll(Rotation.from_matrix(ROTATION).as_quat(), 1)
data.qvel[:] = [*velocity, *ROTATION.T @ omega, 2, SPIN]
data.ctrl[:] = 2, SPIN
warp.config.log_level = warp.LOG_WARNING
with warp.ScopedDevice("cpu"):
    compiled, state = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data)
    mujoco_warp.step(compiled, state)  # compiles
    state = mujoco_warp.put_data(model, data)
    with warp.ScopedCapture() as captured:
        mujoco_warp.step(compiled, state)
for _ in TIMES[1:]:
    warp.capture_launch(captured.graph)
    path.append(state.qpos.numpy()[0, :2].copy())
length = np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()
print("best, 20 ms:", np.linalg.norm(path - truth, axis=1).max() / length)
print("version: MuJoCo Warp", version("mujoco-warp"))
