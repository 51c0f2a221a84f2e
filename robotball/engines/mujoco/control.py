"""The control of a run: what is set at every evaluation of the forces, and how steps are taken.

Controls are computed at every evaluation, so that RK4 keeps its order; held over a step they would
cost it two.
"""

from collections.abc import Callable, Iterator, Sequence

import mujoco
import numpy as np

from robotball.engines.mujoco.model import Model, controls_at
from robotball.rotations import Array

FREE_QPOS, FREE_QVEL = 7, 6  # coordinates and velocities of the free joint; hinges follow
STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def read_row(data: mujoco.MjData) -> Array:
    """Return the sensors of a state, which are up to date, followed by the warning counters."""
    return np.concatenate([data.sensordata, data.warning.number])


def state_of(data: mujoco.MjData) -> Array:
    """Return all that a step depends on (n,)."""
    state = np.empty(mujoco.mj_stateSize(data.model, STATE))
    mujoco.mj_getState(data.model, data, state, STATE)
    return state


Steps = Callable[[mujoco.MjData, float], Iterator[float]]
"""Takes one step of a length [s], in parts where it has to. Yields the length of each part."""

# s: a drive's value at the end of a span is taken this long before it, where a breakpoint's other
# side begins.
_INSIDE = 1e-9


class Control:
    """The control of a run: what is set at every evaluation of the forces, and how steps are taken.

    span: the smooth span of time that the run is in [s], as its steps set it; forces: functions
    that set controls or forces in MjData; steps: of a run whose steps are not simply MuJoCo's, else
    None; stops: stops a ball that is at rest, and returns whether it did, where a run can stop.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.span: Sequence[float] = (0.0, 0.0)
        # Constant controls are in the keyframe; a call of Python at each evaluation costs 8 µs.
        self.forces = [] if model.scene.steady else [self.set]
        self.steps: Steps | None = None
        self.stops: Callable[[mujoco.MjData], bool] | None = None

    @property
    def is_plain(self) -> bool:
        """True if a run is nothing but MuJoCo's steps."""
        return not self.forces and self.steps is None

    def inside(self, t: float) -> float:
        """Return the time [s] of the span that is nearest to t."""
        begin, end = self.span
        return max(begin, min(t, end - _INSIDE))

    def set(self, data: mujoco.MjData) -> None:
        """Set the controls of the hinges at the time of `data`."""
        data.ctrl[:] = controls_at(self.model.scene, self.model.hinges, self.inside(data.time))

    def __call__(self, _: mujoco.MjModel, data: mujoco.MjData) -> None:
        for each in self.forces:
            each(data)
