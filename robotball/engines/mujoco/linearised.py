"""Numbers for the laws of `limits` that no formula gives, from trials at the start.

These numbers are the loads and eigenvalues of MuJoCo's model, and the loss of momentum in a run.
"""

from dataclasses import replace

import mujoco
import numpy as np

from robotball.engines.mujoco.control import read_row
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.readings import readings_of
from robotball.engines.mujoco.settings import Settings, recipe
from robotball.engines.mujoco.stepping import by_steps, controlled
from robotball.errors import InputError
from robotball.robot.loads import Loads
from robotball.robot.scene import Scene
from robotball.rotations import Array

# Half step of central differences, a velocity [m/s or rad/s] or an angle [rad]. The square of this
# half step, and rounding divided by it, are far below the digits of a prediction.
_PUSH = 1e-6
_MOST_STEPS = 500  # of the short run; the loss of a longer run is extrapolated in proportion


def linearised_start(scene: Scene, settings: Settings) -> tuple[Loads, Array]:
    """Return the loads of a model at the start, and its eigenvalues (2 nv - 3,) there [1/s].

    A small deviation grows or decays with the real part and oscillates with the imaginary part.
    """
    # With unlimited friction the loads show how much friction the motion needs.
    upright = recipe("look", settings.error_tolerance, timestep=settings.timestep)
    model = build(scene.ideal, replace(upright, drive=settings.drive))
    compiled, data = model.compiled, model.start_data()
    with controlled(model):
        mujoco.mj_forward(compiled, data)
        loads = readings_of(model, read_row(data)[None]).loads
        qpos, qvel, nv = data.qpos.copy(), data.qvel.copy(), compiled.nv
        columns = []
        # The position on the plane has no effect, and the contact determines the height.
        for of_angle, i in [(True, i) for i in range(3, nv)] + [(False, i) for i in range(nv)]:
            sides = []
            for push in (_PUSH, -_PUSH):
                data.qpos[:], data.qvel[:] = qpos, qvel
                if of_angle:
                    mujoco.mj_integratePos(compiled, data.qpos, np.eye(nv)[i], push)
                else:
                    data.qvel[i] += push
                mujoco.mj_forward(compiled, data)
                sides.append(data.qacc.copy())
            columns.append((sides[0] - sides[1]) / (2 * _PUSH))
    if not np.isfinite(columns).all():
        raise InputError(
            f"{scene.name}: MuJoCo's accelerations are not finite at the start: bring the "
            "positions and masses of the bodies nearer to the ball's radius and mass"
        )
    turning = np.zeros((nv - 3, 2 * nv - 3))
    turning[:, nv:] = np.eye(nv - 3)
    # The deviation of the attitude is in axes that turn with the shell.
    turning[:3, :3] = -np.cross(qvel[3:6], np.eye(3)).T  # -ω×
    return loads, np.linalg.eigvals(np.vstack([turning, np.array(columns).T]))


def momentum_loss(scene: Scene, integrator: str, timestep: float, duration: float) -> float:
    """Estimate the relative loss of momentum over a duration [s]; infinite if the run diverges.

    The estimate comes from a short run of the recipe's model, in about 60 ms.
    """
    count = duration / timestep
    steps = float(min(np.ceil(count), _MOST_STEPS))
    model = build(scene.ideal, recipe("look", 1.0, timestep=timestep, integrator=integrator))
    with controlled(model) as control, np.errstate(all="ignore"):
        portions = by_steps(control, model.start_data(), np.array([0.0, steps * timestep]))
        M = np.concatenate([readings_of(model, portion.rows).momentum for portion in portions])
        lost = float(np.linalg.norm(M - M[0], axis=1).max()) / scene.momentum_scale
    return lost * max(1.0, count / steps) if lost < np.inf else np.inf
