"""The ball of Fig. 12 in DART: velocity actuators, friction 20, steps of 1 ms.

DART's contact does not resist spin. The script adds the torque -1.5 I/step (ω, e_z) for a rubber
ball, with its smallest moment of inertia I = 0.35 kg m². Above 2 I/step this torque diverges.
"""

from importlib.metadata import version

import numpy as np
from scipy.integrate import solve_ivp

try:
    from dartpy import dynamics, math, simulation
except ImportError:
    raise SystemExit("skipped: DART is not installed") from None

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

STEP, MASSES, world = 1e-3, (0.07, 0.8016, 0.0284), simulation.World()
world.setTimeStep(STEP)
world.setGravity([0, 0, -9.81])
ball, ground = dynamics.Skeleton("ball"), dynamics.Skeleton("ground")
_, plane = ground.createWeldJointAndBodyNodePair()
_, shell = ball.createFreeJointAndBodyNodePair()
bodies = [shell]
for axis in ([0, 0, 1.0], AXIS):
    hinge = dynamics.RevoluteJointProperties()
    hinge.mAxis = axis
    joint, body = ball.createRevoluteJointAndBodyNodePair(bodies[-1], hinge)
    joint.setActuatorType(dynamics.ActuatorType.VELOCITY)
    bodies.append(body)
for body, mass, inertia in zip(bodies, MASSES, (SHELL, FRAME, ROTOR), strict=True):
    body.setInertia(dynamics.Inertia(mass, np.zeros(3), inertia))
for body, shape in (plane, dynamics.PlaneShape([0, 0, 1.0], 0)), (shell, dynamics.SphereShape(1)):
    node = body.createShapeNode(shape)
    node.createCollisionAspect()
    node.createDynamicsAspect()
    node.getDynamicsAspect().setFrictionCoeff(20)
world.addSkeleton(ground)
world.addSkeleton(ball)
pose = math.Isometry3()
pose.set_rotation(ROTATION)
pose.set_translation([0, 0, 1])
ball.setPositions([*dynamics.FreeJoint.convertToPositions(pose), 0, 0])
ball.setVelocities([*omega, *velocity, 2, SPIN])
ball.setCommands([0] * 6 + [2, SPIN])
path = [[0, 0]]
for _ in range(round(10 / STEP)):
    spin = shell.getAngularVelocity()[2]
    shell.setExtTorque([0, 0, -1.5 * 0.35 / STEP * spin], False)
    world.step(False)  # True would reset commands and torque
    path.append(shell.getTransform().translation()[:2])
length = np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()
print("best, 1 ms:", np.linalg.norm(path[::20] - truth, axis=1).max() / length)
print("version: DART", version("dartpy"))
