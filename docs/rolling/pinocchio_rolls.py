"""The ball of Fig. 12 on Pinocchio's point contact, moved to its lowest point before every step.

The loop follows Pinocchio's example. The script adds the torque -1.5 I/step (ω, e_z) against spin,
with the ball's smallest moment of inertia I = 0.35 kg m².
"""

from importlib.metadata import version

import numpy as np
from scipy.integrate import solve_ivp

try:
    import pinocchio as pin
except ImportError:
    raise SystemExit("skipped: Pinocchio is not installed") from None

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

STEP, identity, model = 1e-3, pin.SE3.Identity(), pin.Model()
root = pin.JointModelComposite(pin.JointModelTranslation())
root.addJoint(pin.JointModelSpherical())
joints = root, pin.JointModelRZ(), pin.JointModelRevoluteUnaligned(AXIS)
for i, mass, inertia in (0, 0.07, SHELL), (1, 0.8016, FRAME), (2, 0.0284, ROTOR):
    model.addJoint(i, joints[i], identity, str(i))
    model.appendBodyToJoint(i + 1, pin.Inertia(mass, np.zeros(3), inertia), identity)
model.armature = np.array([0, 0, 0, 0, 0, 0, 1e12, 1e12])
contact = pin.PointContactConstraintModel(model, 0, identity, 1, identity)
contact.setFriction(20)
solver, settings = pin.ADMMConstraintSolver(), pin.ADMMSolverSettings()
settings.absolute_feasibility_tol = settings.absolute_complementarity_tol = 1e-10
data, tau, result = model.createData(), np.zeros(8), pin.ADMMSolverResult()
q = np.array([0, 0, 1, *pin.Quaternion(ROTATION).coeffs(), 0, 0])
v = np.array([*velocity, *ROTATION.T @ omega, 2, SPIN])
path = [[0, 0]]
for _ in range(round(10 / STEP)):
    R = pin.Quaternion(q[3:7]).toRotationMatrix()
    tau[3:6] = -1.5 * 0.35 / STEP * (R[2] @ v[3:6]) * R[2]
    contact.joint1_placement = pin.SE3(E, np.array([q[0], q[1], 0]))
    contact.joint2_placement = pin.SE3(R.T, -R[2])
    models = [pin.ConstraintModel(contact)]
    datas = [models[0].createData()]
    pin.crba(model, data, q, pin.Convention.WORLD)
    free = v + STEP * pin.aba(model, data, q, v, tau)
    data.q_in = q
    models[0].calc(model, data, datas[0])
    cholesky = pin.ConstraintCholeskyDecomposition(model, data, models, datas)
    cholesky.compute(model, data, models, datas, 1e-10)
    J = pin.getConstraintsJacobian(model, data, models, datas)
    delassus = cholesky.getDelassusOperatorCholeskyExpression()
    solver.solve(delassus, J @ free + [0, 0, (q[2] - 1) / STEP], models, datas, settings, result)
    force = result.retrieveConstraintImpulses() / STEP
    v = v + STEP * pin.aba(model, data, q, v, tau + J.T @ force)
    q = pin.integrate(model, q, v * STEP)
    path.append(q[:2])
length = np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()
print("contact, 1 ms:", np.linalg.norm(path[::20] - truth, axis=1).max() / length)
print("version: Pinocchio", version("pin"))
