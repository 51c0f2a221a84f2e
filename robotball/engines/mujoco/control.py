"""The control of a run: what is set at every evaluation of the forces, and how steps are taken.

Controls are computed at every evaluation, so that RK4 keeps its order; held over a step they would
cost it two.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import mujoco
import numpy as np

from robotball import equations as eq
from robotball.controllers import Sensed, loop_of
from robotball.drives import holds
from robotball.engines.mujoco.model import Model, controls_at
from robotball.equations import as_vector
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


def sensed(model: Model, data: mujoco.MjData) -> Sensed:
    """Return what a robot's sensors read in a state, without its forces, which take longest."""
    compiled, columns, count = model.compiled, model.sensor_columns, len(model.scene.hinges)
    mujoco.mj_kinematics(compiled, data)
    mujoco.mj_comPos(compiled, data)
    mujoco.mj_sensorPos(compiled, data)
    mujoco.mj_comVel(compiled, data)
    mujoco.mj_sensorVel(compiled, data)
    read = data.sensordata.copy()
    attitude, angles, rates = read[columns["attitude"]], np.zeros(count), np.zeros(count)
    for hinge in model.hinges:
        angles[hinge.index] = read[columns[f"{hinge.body}_angle"]][0]
        rates[hinge.index] = read[columns[f"{hinge.body}_rate"]][0]
    # By numbers: an array's rotation matrix takes longer than all of the sensors.
    axes = eq.space_axes(tuple(attitude.tolist()))
    turning = eq.seen_from_frame(as_vector(read[columns["angular_velocity"]]), axes)
    return Sensed(np.array(turning), attitude, angles, rates, read[columns["centre"]][:2])


Steps = Callable[[mujoco.MjData, float], Iterator[float]]
"""Takes one step of a length [s], in parts where it has to. Yields the length of each part."""

# s: a drive's value at the end of a span is taken this long before it, where a breakpoint's other
# side begins.
_INSIDE = 1e-9


class Control:
    """The control of a run: what is set at every evaluation of the forces, and how steps are taken.

    span: the smooth span of time that the run is in [s], as `begin` sets it; loop: of the scene's
    controller, whose commands so far are in the model's scene; forces: functions
    that set controls or forces in MjData; steps: of a run whose steps are not simply MuJoCo's, else
    None; stops: stops a ball that is at rest, and returns whether it did, where a run can stop.
    """

    def __init__(self, model: Model) -> None:
        # Constant controls are in the keyframe; a call of Python at each evaluation costs 8 µs.
        self.forces = [] if replace(model.scene, controller=None).steady else [self.set]
        self.loop = loop_of(model.scene)
        self.model = model.of(self.loop.scene) if self.loop else model
        self.span: Sequence[float] = (0.0, 0.0)
        self.steps: Steps | None = None
        self.stops: Callable[[mujoco.MjData], bool] | None = None

    @property
    def is_plain(self) -> bool:
        """True if a run is nothing but MuJoCo's steps."""
        return not self.forces and self.steps is None and self.loop is None

    def begin(self, data: mujoco.MjData, span: Sequence[float]) -> None:
        """Begin a smooth span of time [s] from the state of `data`, with the controls of its begin.

        A span that is repeated has the commands of the first time.
        """
        self.span = span
        if self.loop is not None:
            self.loop.reach(span[0], lambda: sensed(self.model, data))
            scene = self.model.scene
            data.ctrl[:] = controls_at(scene, self.model.hinges, span[0])
            commands = (*scene.drives, *scene.controls)
            if self.set in self.forces and all(map(holds, commands)):  # from here on for good
                self.forces.remove(self.set)
                if not self.forces:
                    mujoco.set_mjcb_control(None)

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
