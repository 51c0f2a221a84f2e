"""A dm_control environment in which an agent drives the ball along a path.

Only this file imports dm-control, because pip cannot install all its dependencies on Python 3.13.
"""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robotball.engines.engine import as_own, request_of
from robotball.engines.equations import integrate, scene_of
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.settings import Prescribed, Resolved, Settings, for_slip
from robotball.engines.observe import spans
from robotball.errors import InputError, check_positive
from robotball.motion import DIVERGED
from robotball.robot.scene import SAMPLE_INTERVAL, Scene
from robotball.rotations import Array, as_floats
from robotball.theory.plane import check_still

try:
    from dm_control.rl.control import Environment, Physics, PhysicsError, Task
    from dm_control.utils.rewards import tolerance
    from dm_env.specs import BoundedArray
except ImportError:
    Environment, Physics, Task = None, object, object


def dm_environment(
    scene: Scene | str | Path,
    path: Array | None = None,
    *,
    settings: Settings | str | None = None,
    control_timestep: float = SAMPLE_INTERVAL,
    largest_action: float | Array | None = None,
) -> Any:
    """Return a dm_control environment whose task is to drive the ball along a path.

    An episode begins at the scene's start and ends with the path. The reward is 1 on the path and
    0.1 at a distance of one ball radius. The MuJoCo model is the one that `simulate` uses. An
    action is held for one step of the environment, and MuJoCo limits the torques within this step.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    path : (n, 2), m, optional
        The desired contact points at the start and after each action, in world axes. The default is
        the path of `integrate` over the scene's duration.
    settings : Settings or str, optional
        MuJoCo's settings, or the name of a preset. The default is "balanced".
    control_timestep : float, default 0.02, s
        The duration of an action.
    largest_action : float or (k,), optional
        The largest absolute value of each number of an action. The default is twice the largest
        command in the scene, or 1 for an actuator without a command.

    Returns
    -------
    dm_control.rl.control.Environment
        The environment. An action has one number for each actuator, in the order of the MJCF. For a
        motor it is the command, in the command's unit. For a hinge with a prescribed rate it is the
        rate [rad/s] at the end of the step. An observation has the values of the MJCF's sensors and
        "target", the vector [m] from the contact point to the next point of the path.

    Raises
    ------
    InputError
        If dm-control is not installed, if the path, the timestep or the largest action is invalid,
        if the settings use RK8, if the plane resists rolling, or if `load_scene` or `integrate`
        raises it.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> environment = rb.dm_environment("fig12", control_timestep=0.05)
    >>> environment.reset().observation["frame_rate"]
    array([2.])
    >>> rates = np.array([2.0, 148.0])  # rad/s, of frame and rotor
    >>> round(environment.step(rates).reward, 3)
    1.0
    """
    scene = scene_of(scene)
    scene.check_open("an environment, whose agent drives the ball,")
    check_still(scene, "an environment")
    check_positive("control_timestep", control_timestep, "s")
    if Environment is None:
        raise InputError(
            "dm_environment needs dm-control: pip install dm-env, then pip install --no-deps "
            "'dm-control==1.0.*' (its dependency labmaze has no wheel for Python 3.13)"
        )
    chosen = as_own(request_of("mujoco", settings).settings, Settings, LABEL)
    if not chosen.own or scene.friction.rolling:
        raise InputError(
            f"{scene.name}, {chosen.name}: an environment takes MuJoCo's own steps, without RK8 or "
            "rolling friction: take another preset, or a scene without rolling friction"
        )
    if path is None:
        times = np.arange(round(scene.duration / control_timestep) + 1, dtype=float)
        path = integrate(scene, times * control_timestep).contact_point
    path = as_floats("path", path)
    if path.ndim != 2 or path.shape[1] != 2 or len(path) < 2 or not np.isfinite(path).all():
        raise InputError(f"path must be finite numbers (n, 2), n > 1; its shape is {path.shape}")
    resolved = Resolved(scene, chosen)
    if resolved.settings.slips is False:  # an agent may exceed the friction
        chosen = for_slip(scene, chosen, resolved.timestep)
    model = build(scene, chosen)
    option = model.compiled.opt
    _, (option.timestep,), (count,) = spans(np.array([0, control_timestep]), (), option.timestep)
    task = _FollowPath(model, path, control_timestep, largest_action)
    limit = (len(path) - 1.5) * control_timestep  # between two steps, so rounding adds no step
    return Environment(_Physics(model), task, limit, n_sub_steps=int(count))


class _Physics(Physics):  # type: ignore[misc]
    """A MuJoCo model whose sensors show the current state."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.reset()
        self.after_reset()

    def reset(self) -> None:
        self.data = self.model.start_data()

    def after_reset(self) -> None:
        # After a step the sensors show the state before the step. The solver's initial guess is
        # restored, so that the next step equals the step that `simulate` takes.
        guess = self.data.qacc_warmstart.copy()
        mujoco.mj_forward(self.model.compiled, self.data)
        self.data.qacc_warmstart[:] = guess

    def step(self, n_sub_steps: int = 1) -> None:
        mujoco.mj_step(self.model.compiled, self.data, n_sub_steps)
        # MuJoCo replaces a larger control by 0, with a warning.
        state = np.concatenate([self.data.qpos, self.data.qvel, self.data.ctrl])
        if not np.abs(state).max() < DIVERGED:
            raise PhysicsError(
                f"at {self.time():g} s a coordinate, rate or control is NaN or exceeds "
                f"{DIVERGED:g}: take smaller actions"
            )
        self.after_reset()

    def time(self) -> float:
        return float(self.data.time)

    def timestep(self) -> float:
        return float(self.model.compiled.opt.timestep)


class _FollowPath(Task):  # type: ignore[misc]
    """Follow a path (n, 2), one point per action."""

    def __init__(
        self, model: Model, path: Array, interval: float, largest: float | Array | None
    ) -> None:
        hinges = [hinge for hinge in model.hinges if hinge.actuated]
        self.commands = [hinge.command for hinge in hinges] + list(model.scene.controls)
        if largest is None:
            sizes = [np.abs(command.rate(model.scene.times)).max() for command in self.commands]
            largest = np.array([2.0 * size or 1.0 for size in sizes])
        if np.ndim(largest) and np.shape(largest) != (len(self.commands),):
            raise InputError(f"largest_action must be 1 or {len(self.commands)} numbers")
        self.largest = np.broadcast_to(largest, len(self.commands))
        self.prescribed = np.zeros(len(self.commands), dtype=bool)
        self.prescribed[: len(hinges)] = [isinstance(h.actuation, Prescribed) for h in hinges]
        self.model, self.path, self.interval = model, path, interval

    def action_spec(self, physics: _Physics) -> Any:
        return BoundedArray((len(self.largest),), float, -self.largest, self.largest, "command")

    def initialize_episode(self, physics: _Physics) -> None:
        self.before = np.array([command.rate(0.0) for command in self.commands])

    def before_step(self, action: Array, physics: _Physics) -> None:
        # The control of a hinge with a prescribed rate is an acceleration. It is computed from two
        # actions, so it is exactly zero for a repeated action, like in `simulate`.
        action = np.array(action, dtype=float)
        slope = (action - self.before) / self.interval
        physics.data.ctrl[:] = np.where(self.prescribed, slope, action)
        self.before = action

    def get_observation(self, physics: _Physics) -> dict[str, Array]:
        columns, sensors = self.model.sensor_columns, physics.data.sensordata
        observation = {name: sensors[column].copy() for name, column in columns.items()}
        following = min(round(physics.time() / self.interval) + 1, len(self.path) - 1)
        return observation | {"target": self.path[following] - observation["centre"][:2]}

    def get_reward(self, physics: _Physics) -> float:
        reached = self.path[round(physics.time() / self.interval)]
        off = physics.data.body("shell").xpos[:2] - reached
        return float(tolerance(np.linalg.norm(off), margin=self.model.scene.ball.radius))
