"""The ball of Fig. 12 in Newton: RK4 of its MuJoCo solver with steps of 20 ms.

Newton's attributes give the contact. One line in the solver's model adds noslip. Huge armatures
keep the hinge rates constant. The state is rounded to single precision after every step.
"""

from importlib.metadata import version

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

try:
    import newton
    import warp as wp
except ImportError:
    raise SystemExit("skipped: Newton is not installed") from None

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

wp.config.log_level = wp.LOG_WARNING
D = 0.9999  # impedance
DEPTH = 9.81 * (1 - D) * 0.04**2  # at which the contact carries the ball
PAIR = {
    "condim": 4, "friction": [20, 20, 20, 0, 0], "solref": [0.04, 1], "solreffriction": [-1, -0.5],
    "solimp": [D, D, 1e-3, 0.5, 1],
}  # fmt: skip
builder = newton.ModelBuilder(gravity=wp.vec3(0, 0, -9.81))
newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
bodies, joints = [], []
for mass, inertia, axis in ((0.07, SHELL, None), (0.8016, FRAME, E[2]), (0.0284, ROTOR, AXIS)):
    inertia = wp.mat33(*inertia.ravel())
    bodies.append(builder.add_link(mass=mass, inertia=inertia, lock_inertia=True))
    if axis is None:
        joints.append(builder.add_joint_free(child=bodies[-1]))
        continue
    joint = builder.add_joint_revolute(*bodies[-2:], axis=wp.vec3(*axis), armature=1e12)
    joints.append(joint)
cfg = newton.ModelBuilder.ShapeConfig(density=0, mu=20)
sphere = builder.add_shape_sphere(bodies[0], radius=1, cfg=cfg)
builder.add_articulation(joints)
PAIR |= {"geom1": builder.add_ground_plane(cfg=cfg), "geom2": sphere}
builder.add_custom_values(**{f"mujoco:pair_{name}": value for name, value in PAIR.items()})
builder.joint_q = [0, 0, 1 - DEPTH, *Rotation.from_matrix(ROTATION).as_quat(), 0, 0]
builder.joint_qd = [*velocity, *omega, 2, SPIN]
model = builder.finalize(device="cpu")
state, control, path = model.state(), model.control(), [[0, 0]]
solver = newton.solvers.SolverMuJoCo(
    model, use_mujoco_cpu=True, integrator="rk4", cone="elliptic", iterations=10, tolerance=0
)
solver.mj_model.opt.noslip_iterations = 1
for _ in TIMES[1:]:
    solver.step(state, state, control, None, 0.02)
    path.append(state.joint_q.numpy()[:2].astype(float))
length = np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()
print("best, 20 ms:", np.linalg.norm(path - truth, axis=1).max() / length)
print("version: Newton", version("newton"))
