"""Fit a robot's model file, with the file's contact, in MuJoCo's toolbox `mujoco.sysid`.

The toolbox does the rollouts and the least squares. Its sensors are a step late, and it
interpolates controls; readings are therefore computed from the states, whose times are right, and
each step has its own control. `robotball.fit.fitting` chooses the free numbers and the residuals,
as for a fit with the equations.
"""

import io
from collections.abc import Callable
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.user_model import UserModel, readings_of, row_of, table_of
from robotball.errors import InputError, mujoco_silent
from robotball.motion import Motion
from robotball.robot.drives import as_drive
from robotball.robot.loads import Loads
from robotball.robot.scene import Scene
from robotball.rotations import Array
from robotball.user_model.mended_file import RobotScene

sysid: Any = import_module("mujoco.sysid")  # an import would hide mujoco's types from mypy
_FARTHEST = 100.0  # bound, in sizes of an unknown: the toolbox needs finite bounds
_ENOUGH = 1e-4  # change from one trial to the next, in sizes of an unknown


def check_toolbox() -> None:
    """Raise InputError if the toolbox is not installed; without its dependencies it is empty."""
    if not hasattr(sysid, "optimize"):
        raise InputError(
            "a fit with the file's contact needs mujoco.sysid: install robotball's extra `sysid`"
        )


@mujoco_silent()  # a state that diverges ends the motion
def roll(scene: Scene, times: Array) -> Motion:
    """Return the motion of a robot's model file at times (n,) [s], until it diverges."""
    assert isinstance(scene, RobotScene)
    assert scene.robot_file is not None
    robot = scene.robot_file
    model, user = robot.model, UserModel(robot, {}, scene.key)
    data = robot.start_as(scene, scene.key)
    start = sysid.create_initial_state(model, data.qpos, data.qvel, data.act)
    # One more than the steps, and one step beyond the last time.
    steps = model.opt.timestep * np.arange(int(times[-1] / model.opt.timestep) + 3)
    control = np.tile(data.ctrl, (len(steps), 1))
    for actuator in scene.actuators:
        if actuator.name in user.actuators:
            drive = as_drive(actuator.command, max(scene.duration, float(steps[-1])))
            control[:, user.actuators[actuator.name]] = drive.rate(steps)
    controls = sysid.TimeSeries(steps, control)
    (run,) = sysid.sysid_rollout([model], [mujoco.MjData(model)], [controls], [start])
    states = np.vstack([start, run.state.data])
    sound = np.isfinite(states).all(axis=1)
    known = states[: len(states) if sound.all() else int(sound.argmin())]
    times = times[times <= known[-1, 0]]
    at = np.array([np.interp(times, known[:, 0], column) for column in known.T[1:]])
    positions, rates, states_of_actuators = np.split(at, np.cumsum([model.nq, model.nv]))
    held = np.clip(np.searchsorted(steps, times, "right") - 1, 0, len(control) - 1)
    rows, torques = [], []
    for i in range(len(times)):
        data.qpos[:], data.qvel[:] = positions[:, i], rates[:, i]
        data.act[:], data.ctrl[:] = states_of_actuators[:, i], control[held[i]]
        data.time = times[i]
        mujoco.mj_forward(model, data)
        rows.append(row_of(robot, data))
        torques.append((data.qfrc_actuator + data.qfrc_passive)[robot.hinges[1]])
    readings = readings_of(user, scene, table_of(user, data, rows))
    unknown = Loads.unknown(len(times), 0)
    return Motion(
        scene, LABEL, times, readings.centre[:, :2], readings.attitude, readings.momentum,
        readings.angular_velocity, readings.hinge_angles, readings.hinge_rates,
        Loads(readings.loads.contact_force, unknown.spin_torque, np.array(torques)),
    )  # fmt: skip


def least_squares(
    residuals: Callable[..., Array],
    x: Array,
    jacobian: Callable[..., Array],
    bounds: tuple[Array, Array],
    *,
    max_nfev: int,
    **_: Any,
) -> SimpleNamespace:
    """Minimize like `scipy.optimize.least_squares`, with the toolbox."""

    def gaps(x: Array, _: Any) -> tuple[list[Array], list[Any], list[Any]]:
        return [residuals(x.ravel())[:, None]], [], []

    limits = [np.clip(bound, -_FARTHEST, _FARTHEST) for bound in bounds]
    free = sysid.ParameterDict({"": sysid.Parameter("", x, *limits)})
    _, solution = sysid.optimize(
        free, gaps, verbose=False, output=io.StringIO(), max_iters=max_nfev, xtol=_ENOUGH,
        jacobian=lambda x, _: jacobian(x.ravel()),
    )  # fmt: skip
    return SimpleNamespace(x=solution.x)
