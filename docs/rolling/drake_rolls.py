"""The ball of Fig. 12 in Drake: RADAU with equal steps of 1 ms, reflected inertias at the hinges.

Point contact does not resist spin. The script adds the torque -3000 I/step (ω, e_z) for a rubber
ball, with its smallest moment of inertia I = 0.35 kg m². The implicit integrator is stable with it.
"""

from importlib.metadata import version

import numpy as np
from scipy.integrate import solve_ivp

try:
    from pydrake import geometry, math
    from pydrake.multibody import plant as plants
    from pydrake.multibody import tree
    from pydrake.systems import analysis, framework, primitives
except ImportError:
    raise SystemExit("skipped: Drake is not installed") from None

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

STEP, builder, bodies = 1e-3, framework.DiagramBuilder(), []
plant, _ = plants.AddMultibodyPlantSceneGraph(builder, time_step=0)
for mass, I in (0.07, SHELL), (0.8016, FRAME), (0.0284, ROTOR):
    inertia = tree.RotationalInertia(*np.diag(I), I[0, 1], I[0, 2], I[1, 2])
    inertia = tree.SpatialInertia.MakeFromCentralInertia(mass, np.zeros(3), inertia)
    bodies.append(plant.AddRigidBody(f"body{len(bodies)}", inertia))
for (one, other), axis in (bodies[:2], [0, 0, 1]), (bodies[1:], AXIS):
    hinge = tree.RevoluteJoint(other.name(), one.body_frame(), other.body_frame(), axis)
    plant.AddJointActuator(other.name(), plant.AddJoint(hinge)).set_default_rotor_inertia(1e12)
# Equally stiff bodies touch in the middle of their overlap, which must be at height 0.
material, half = geometry.ProximityProperties(), 1e-5
geometry.AddContactMaterial(None, 0.9 * 9.81 / half, plants.CoulombFriction(20, 20), material)
ball, ground = (bodies[0], geometry.Sphere(1 + half)), (plant.world_body(), geometry.HalfSpace())
for (body, shape), height in (ball, 0), (ground, half):
    plant.RegisterCollisionGeometry(body, math.RigidTransform([0, 0, height]), shape, "x", material)
plant.Finalize()
plant.set_stiction_tolerance(1e-4)
resist = np.zeros((8, 17))  # from the state (q, v) to generalised forces
resist[2, 11] = -3e3 * 0.35 / STEP
gain = builder.AddSystem(primitives.MatrixGain(resist))
builder.Connect(plant.get_state_output_port(), gain.get_input_port())
builder.Connect(gain.get_output_port(), plant.get_applied_generalized_force_input_port())
simulator = analysis.Simulator(builder.Build())
radau = analysis.ResetIntegratorFromFlags(simulator, "radau3", STEP)
radau.set_target_accuracy(1e-8)  # of Newton's iteration
radau.set_fixed_step_mode(True)
context = plant.GetMyContextFromRoot(simulator.get_mutable_context())
q = [*math.RotationMatrix(ROTATION).ToQuaternion().wxyz(), 0, 0, 1, 0, 0]
plant.SetPositionsAndVelocities(context, [*q, *omega, *velocity, 2, SPIN])
path = []
for t in TIMES:
    simulator.AdvanceTo(t)
    path.append(plant.GetPositions(context)[4:6])
length = np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()
print("best, 1 ms:", np.linalg.norm(path - truth, axis=1).max() / length)
print("version: Drake", version("drake"))
