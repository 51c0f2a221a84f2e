"""The ball of Fig. 12 in PyBullet: velocity motors, friction and spinning friction, 1 ms.

Bullet's spinning friction serves the rubber ball, so the script adds nothing.
"""

from importlib.metadata import version

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

try:
    import pybullet as p
except ImportError:
    raise SystemExit("skipped: PyBullet is not installed") from None

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

STEP = 1e-3
p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
p.setTimeStep(STEP)
plane = p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
moments, axes = np.linalg.eigh([SHELL, FRAME, ROTOR])
axes = axes * np.linalg.det(axes)[:, None, None]  # right-handed
ball = p.createMultiBody(
    0.07, p.createCollisionShape(p.GEOM_SPHERE, radius=1), basePosition=[0, 0, 1],
    baseOrientation=Rotation.from_matrix(ROTATION).as_quat(), linkMasses=[0.8016, 0.0284],
    linkCollisionShapeIndices=[-1, -1], linkVisualShapeIndices=[-1, -1],
    linkPositions=[[0, 0, 0]] * 2, linkOrientations=[[0, 0, 0, 1]] * 2,
    linkInertialFramePositions=[[0, 0, 0]] * 2, linkParentIndices=[0, 1],
    linkInertialFrameOrientations=Rotation.from_matrix(axes[1:]).as_quat(),
    linkJointTypes=[p.JOINT_REVOLUTE] * 2, linkJointAxis=[[0, 0, 1], AXIS],
)  # fmt: skip
for i, diagonal in enumerate(moments, start=-1):
    # One option per call: with several, Bullet applies some to the base instead of the link.
    p.changeDynamics(ball, i, localInertiaDiagonal=diagonal)
    for kind in "linearDamping", "angularDamping", "jointDamping":
        p.changeDynamics(ball, i, **{kind: 0})
    p.changeDynamics(ball, i, maxJointVelocity=1e6)  # 100 rad/s by default
for body, friction in (plane, 1), (ball, 20):  # Bullet multiplies them
    p.changeDynamics(body, -1, lateralFriction=friction)
    p.changeDynamics(body, -1, spinningFriction=friction)
p.resetBaseVelocity(ball, velocity, omega)
for i, rate in enumerate((2, SPIN)):
    p.resetJointState(ball, i, 0, rate)
    p.setJointMotorControl2(ball, i, p.VELOCITY_CONTROL, targetVelocity=rate, force=1e9)
path = [[0, 0]]
for _ in range(round(10 / STEP)):
    p.stepSimulation()
    path.append(p.getBasePositionAndOrientation(ball)[0][:2])
length = np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()
print("best, 1 ms:", np.linalg.norm(path[::20] - truth, axis=1).max() / length)
print("version: PyBullet", version("pybullet"))
