"""What a model says of its own start: the loads, and how fast it answers to a push."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from robotball.contact import Friction
from robotball.engines.mujoco.control import controlled
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.readings import Readings
from robotball.engines.mujoco.settings import Settings, recipe
from robotball.engines.mujoco.states import read_row
from robotball.motion import Loads
from robotball.rotations import Array
from robotball.scene import Scene

PUSH = 1e-6  # of a velocity [m/s or rad/s] and of an angle [rad], to either side


@dataclass(frozen=True)
class StartLook:
    """loads of the start, at one time; rates (2 nv - 3,): the eigenvalues of the model's motion
    about its start, complex [1/s]. Of the real part a push grows or dies out, and with the
    imaginary one it turns.
    """

    loads: Loads
    rates: np.ndarray


def look_at_start(scene: Scene, settings: Settings) -> StartLook:
    """What the scene's model under these settings says of its start."""
    # As much friction as there needs to be: what a run has too little of is to be seen.
    upright = recipe("look", settings.error_tolerance, timestep=settings.timestep)
    model = build(replace(scene, friction=Friction()), replace(upright, drive=settings.drive))
    compiled, data = model.compiled, model.start_data()
    with controlled(model):
        mujoco.mj_forward(compiled, data)
        loads = Readings(model, read_row(data)[None]).loads
        qpos, qvel, nv = data.qpos.copy(), data.qvel.copy(), compiled.nv
        columns = []
        # The place on the plane does not count, and the height is the contact's.
        for of_angle, i in [(True, i) for i in range(3, nv)] + [(False, i) for i in range(nv)]:
            sides = []
            for push in (PUSH, -PUSH):
                data.qpos[:], data.qvel[:] = qpos, qvel
                if of_angle:
                    mujoco.mj_integratePos(compiled, data.qpos, np.eye(nv)[i], push)
                else:
                    data.qvel[i] += push
                mujoco.mj_forward(compiled, data)
                sides.append(data.qacc.copy())
            columns.append((sides[0] - sides[1]) / (2 * PUSH))
    turning = np.zeros((nv - 3, 2 * nv - 3))
    turning[:, nv:] = np.eye(nv - 3)
    # A turn that is left behind is seen from axes that turn on.
    turning[:3, :3] = -_cross_matrix(qvel[3:6])
    return StartLook(loads, np.linalg.eigvals(np.vstack([turning, np.array(columns).T])))


def _cross_matrix(v: Array) -> Array:
    """v× as a matrix (3, 3)."""
    return np.cross(v, np.eye(3)).T
