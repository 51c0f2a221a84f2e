"""The ball of Fig. 12 in PhysX: an articulation with velocity drives, steps of 1 ms.

physx_ball.usda beside this script has the ball, its contact and its state at the start. A contact
patch resists spin, and armatures help the drives. Nothing is added to PhysX.
"""

from importlib.metadata import version
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

try:
    import ovphysx
    import ovstage
    from ovphysx.samples.python_samples.schema_support import physx_schema_paths
except ImportError:
    raise SystemExit("skipped: ovphysx is not installed") from None

# A ball of radius 1 m and 0.9 kg with a frame that turns about z at 2 rad/s. M, K and the inertia
# in the frame's axes, SI units.
E, A, K, OMEGA = np.eye(3), np.diag([0.7, 0.6, 0.8]), np.array([2.0, 2, 0]), np.array([0, 0, 2.0])
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

ovphysx.PhysX.set_cpu_mode(True)
ovphysx.set_global_config(ovphysx.types.GlobalConfigKey.NUM_THREADS, 0)  # 50 times as fast
ovstage.population.register_usd_schemas([str(path) for path in physx_schema_paths()])
stage, physx, path = ovstage.Stage("stage"), ovphysx.PhysX(), [[0, 0]]
file, everything = Path(__file__).with_name("physx_ball.usda"), ovstage.PopulationDomain.ALL
ovstage.population.open_usd(stage, str(file), ordinal=1, domains=everything)
stage.advance_write_floor(ordinal=1).wait()
physx.wait_task(physx.attach_ovstage(stage, read_ordinal=1))


def centre():
    with physx.read_sync(ovphysx.types.SimObjectType.ARTICULATION, ["rootPosition"]) as result:
        return result.groups[0].tensors[0].numpy().ravel()[:2].tolist()


for _ in TIMES[1:]:
    for _ in range(20):
        physx.step_sync(1e-3)
    path.append(centre())
physx.wait_task(physx.detach_ovstage())
physx.destroy()
stage.destroy()
length = np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()
print("best, 1 ms:", np.linalg.norm(path - truth, axis=1).max() / length)
print("version: PhysX", version("ovphysx"))
