"""What a step begins from, and what can be read of it."""

import mujoco
import numpy as np

from robotball.engines.links import State
from robotball.engines.mujoco.model import Model
from robotball.rotations import Array, rotation_matrix

STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def read_row(data: mujoco.MjData) -> Array:
    """The row of Readings of a state whose sensors are up to date."""
    return np.concatenate([data.sensordata, data.warning.number])


def state_of(data: mujoco.MjData) -> Array:
    """All that a step depends on (n,), but for the sides of servos at their limits."""
    state = np.empty(mujoco.mj_stateSize(data.model, STATE))
    mujoco.mj_getState(data.model, data, state, STATE)
    return state


def shell_state(model: Model, qpos: Array, qvel: Array) -> State:
    """The state of MuJoCo's coordinates, with the shell as the root."""
    count, places = len(model.scene.drives), [hinge.index for hinge in model.hinges]
    angles, rates = np.zeros(count), np.zeros(count)
    angles[places], rates[places] = qpos[7:], qvel[6:]
    attitude = qpos[3:7] / np.linalg.norm(qpos[3:7])
    return State(qpos[:3], qvel[:3], attitude, rotation_matrix(attitude) @ qvel[3:6], angles, rates)
