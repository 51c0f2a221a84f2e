"""A robot's own model as its file says, in MuJoCo's toolbox for fits, `mujoco.sysid`.

The rollouts and the least squares are the toolbox's. Its sensors come a step late, and its controls
between two are interpolated; so readings are made of the states, whose times are right, and each
step gets its own control. Which numbers are free, and what readings are held against, is
`robotball.fit.fitting`'s, the same as by the equations: what differs is the file's contact alone.
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
from robotball.user_model.robot_numbers import RobotScene

sysid: Any = import_module("mujoco.sysid")  # by its own types the rest of mujoco would have none
_FARTHEST = 100.0  # of an unknown's size: the toolbox takes no limit that is infinite
_ENOUGH = 1e-4  # of an unknown's size, from one trial to the next


def check_toolbox() -> None:
    """Raise InputError where the toolbox is not installed: without its needs it is empty."""
    if not hasattr(sysid, "optimize"):
        raise InputError(
            "a fit of the file as it is needs mujoco.sysid: install robotball's extra `sysid`"
        )


@mujoco_silent()  # a state that diverges ends the motion
def roll(scene: Scene, times: Array) -> Motion:
    """Return the motion of a robot's own file at times (n,) [s], up to where it diverges."""
    assert isinstance(scene, RobotScene)
    assert scene.robot_file is not None
    robot = scene.robot_file
    model, user = robot.model, UserModel(robot, {}, scene.key)
    data = robot.start_as(scene, scene.key)
    start = sysid.create_initial_state(model, data.qpos, data.qvel, data.act)
    # One more than the steps, as the last is no step's, and one beyond the last time.
    steps = model.opt.timestep * np.arange(int(times[-1] / model.opt.timestep) + 3)
    control = np.tile(data.ctrl, (len(steps), 1))
    for each in scene.actuators:
        if each.name in user.actuators:
            drive = as_drive(each.command, max(scene.duration, float(steps[-1])))
            control[:, user.actuators[each.name]] = drive.rate(steps)
    given = sysid.TimeSeries(steps, control)
    (run,) = sysid.sysid_rollout([model], [mujoco.MjData(model)], [given], [start])
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
    seen = readings_of(user, scene, table_of(user, data, rows))
    unknown = Loads.unknown(len(times), 0)
    return Motion(
        scene, LABEL, times, seen.centre[:, :2], seen.attitude, seen.momentum,
        seen.angular_velocity, seen.hinge_angles, seen.hinge_rates,
        Loads(seen.loads.contact_force, unknown.spin_torque, np.array(torques)),
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
    """Minimize as scipy's function of this name does, by the toolbox."""

    def gaps(x: Array, _: Any) -> tuple[list[Array], list[Any], list[Any]]:
        return [residuals(x.ravel())[:, None]], [], []

    limits = [np.clip(each, -_FARTHEST, _FARTHEST) for each in bounds]
    free = sysid.ParameterDict({"": sysid.Parameter("", x, *limits)})
    _, found = sysid.optimize(
        free, gaps, verbose=False, output=io.StringIO(), max_iters=max_nfev, xtol=_ENOUGH,
        jacobian=lambda x, _: jacobian(x.ravel()),
    )  # fmt: skip
    return SimpleNamespace(x=found.x)
