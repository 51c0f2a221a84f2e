"""The ball of Fig. 12 in Rapier: velocity motors, friction 20, steps of 1 ms with 20 substeps.

Rapier's contact at one point does not resist spin. The script adds the torque -1.5 I/step (ω, e_z)
for a rubber ball, with its smallest moment of inertia I = 0.35 kg m². Above 2 I/step it diverges.
"""

from importlib.metadata import version

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

try:
    import rapier3d as rapier
except ImportError:
    raise SystemExit("skipped: Rapier is not installed") from None

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

STEP, world, bodies = 1e-3, rapier.PhysicsWorld(gravity=(0, 0, -9.81)), []
world.integration_parameters.dt = STEP
world.integration_parameters.num_solver_iterations = 20
plane, sphere = rapier.Collider.halfspace((0, 0, 1)), rapier.Collider.ball(1).density(0)
world.add_collider(plane.friction(20))


def quaternion(matrix):
    return rapier.Rotation3(*np.roll(Rotation.from_matrix(matrix).as_quat(), 1))


pose = rapier.Isometry3((0, 0, 1), quaternion(ROTATION))
for mass, inertia, turning in (
    (0.07, SHELL, omega),
    (0.8016, FRAME, omega + ROTATION @ OMEGA),
    (0.0284, ROTOR, omega + ROTATION @ (OMEGA + SPIN * AXIS)),
):
    moments, axes = np.linalg.eigh(inertia)
    axes *= np.linalg.det(axes)  # right-handed
    inertia = rapier.MassProperties((0, 0, 0), mass, moments, quaternion(axes))
    body = rapier.RigidBody.dynamic().additional_mass_properties(inertia).position(pose)
    body = body.linvel(velocity).angvel(turning).can_sleep(False).allow_fast_rotation(True)
    bodies.append(world.add_body(body, [] if bodies else [sphere.friction(20)]))
for axis, rate, ends in ((E[2], 2, bodies[:2]), (AXIS, SPIN, bodies[1:])):
    hinge = rapier.RevoluteJointBuilder(axis).contacts_enabled(False).motor_velocity(rate, 1e9)
    world.impulse_joints.insert(*ends, hinge.motor_model(rapier.MotorModel.FORCE_BASED).build())
shell, path = world.rigid_bodies[bodies[0]], [[0, 0]]
for _ in range(round(10 / STEP)):
    shell.reset_torques()
    shell.add_torque((0, 0, -1.5 * 0.35 / STEP * shell.angvel.z))
    world.step()
    path.append([shell.translation.x, shell.translation.y])
length = np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()
print("best, 1 ms:", np.linalg.norm(path[::20] - truth, axis=1).max() / length)
print("version: Rapier", version("rapier3d"))
