"""What a step begins from, and what can be read of it."""

import mujoco
import numpy as np

from robotball.rotations import Array

STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def read_row(data: mujoco.MjData) -> Array:
    """The row of Readings of a state whose sensors are up to date."""
    return np.concatenate([data.sensordata, data.warning.number])


def state_of(data: mujoco.MjData) -> Array:
    """All that a step depends on (n,), but for the sides of servos at their limits."""
    state = np.empty(mujoco.mj_stateSize(data.model, STATE))
    mujoco.mj_getState(data.model, data, state, STATE)
    return state
