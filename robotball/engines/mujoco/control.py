"""What acts on a model besides itself, at every evaluation of the forces: so RK4 keeps its order.

The controls of the actuators, and the plane's resistance to rolling where the scene has one.
MuJoCo's own rolling friction (condim 6) is another law: it shares one cone with the friction that
holds the ball, and acts against an acceleration rather than against the rolling.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import mujoco
import numpy as np

from robotball.engines.mujoco.model import Model
from robotball.rotations import Array, rotation_matrix

INSIDE = 1e-9  # s: how far before the end of a span its own side of a breakpoint is taken
# rad/s: a shell that rolls no faster stands, if it can be held; what is left of one that stands.
STANDING, RESTING = 1e-8, 1e-13
# The longest step near a standstill: of the time to it, and over the rate of what turns there.
APPROACH, TURNED = 0.5, 2.0


@dataclass
class Control:
    """The controls of a model's hinges within one smooth span of time [s].

    MuJoCo calls it, held by `controlled`, whenever it needs the forces.
    """

    model: Model
    span: Sequence[float] = (0.0, 0.0)
    resistance: float = field(init=False)  # N m, to rolling
    shell: int = field(init=False)
    trial: mujoco.MjData = field(init=False)  # in which torques on the shell are tried
    tried: Array | None = None  # (2,) N m, the torque while one is

    def __post_init__(self) -> None:
        scene = self.model.scene
        normal_force = -scene.ball.mass * scene.gravity_world[2]
        self.resistance = float(scene.friction.rolling * normal_force)
        self.shell = self.model.compiled.body("shell").id
        self.trial = mujoco.MjData(self.model.compiled)

    def inside(self, t: float) -> float:
        """A time [s] of the span, or the nearest one that is inside it."""
        begin, end = self.span
        return max(begin, min(t, end - INSIDE))

    def __call__(self, _: mujoco.MjModel, data: mujoco.MjData) -> None:
        t = self.inside(data.time)
        data.ctrl[:] = [hinge.control(t) for hinge in self.model.hinges if hinge.actuated]
        if self.resistance:
            torque = self._torque(data) if self.tried is None else self.tried
            data.xfrc_applied[self.shell, 3:5] = torque

    def _torque(self, data: mujoco.MjData) -> Array:
        """(2,) N m, of the plane against rolling; what holds the shell where it stands."""
        rolling: Array = data.cvel[self.shell, :2]
        speed = float(np.linalg.norm(rolling))
        along = rolling
        if speed <= STANDING:
            holding = self._holding(data)
            size = float(np.linalg.norm(holding))
            if size <= self.resistance:
                return holding
            along = rolling - (STANDING - speed) / size * holding
        return -self.resistance / float(np.linalg.norm(along)) * along

    def _holding(self, data: mujoco.MjData) -> Array:
        """(2,) N m: the torque under which the shell's rolling does not change."""
        free, *turned = (
            self._acceleration(data, torque)
            for torque in self.resistance * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        )
        solved = np.linalg.solve((np.array(turned) - free).T, free)
        return np.asarray(-self.resistance * solved, dtype=np.float64)

    def _acceleration(self, data: mujoco.MjData, torque: Array | None = None) -> Array:
        """(2,) rad/s²: of the shell's rolling, under a torque on it in place of the plane's."""
        compiled, trial = self.model.compiled, self.trial
        trial.time, trial.qpos, trial.qvel = data.time, data.qpos, data.qvel
        self.tried = torque
        mujoco.mj_forward(compiled, trial)
        self.tried = None
        mujoco.mj_rnePostConstraint(compiled, trial)
        return trial.cacc[self.shell, :2].copy()

    def stop(self, data: mujoco.MjData) -> bool:
        """Whether the plane has just come to hold the shell, whose rolling is taken from `data`."""
        rolling = self._rolling(data)
        if not RESTING < np.linalg.norm(rolling) <= STANDING:
            return False
        if np.linalg.norm(self._holding(data)) > self.resistance:
            return False
        to_world = rotation_matrix(data.qpos[3:7])
        data.qvel[:2] = 0.0
        data.qvel[3:6] -= rolling @ to_world[:2]
        return True

    def longest(self, data: mujoco.MjData, length: float) -> float:
        """A step's length [s], shorter where the shell comes to a standstill or leaves one.

        Near it the way of the rolling turns over at a rate of the resistance over the speed.
        """
        speed = float(np.linalg.norm(self._rolling(data)))
        if speed <= STANDING and np.linalg.norm(self._holding(data)) <= self.resistance:
            return length
        now, free = (self._acceleration(data, torque) for torque in (None, np.zeros(2)))
        turning = float(np.linalg.norm(now - free)) / max(speed, STANDING)
        slowing = float(np.linalg.norm(now)) / speed if speed > STANDING else 0.0
        return float(min(length, TURNED / turning, APPROACH / max(slowing, APPROACH / length)))

    def _rolling(self, data: mujoco.MjData) -> Array:
        """(2,) rad/s: the horizontal part of the shell's angular velocity."""
        compiled = self.model.compiled
        mujoco.mj_kinematics(compiled, data)
        mujoco.mj_comPos(compiled, data)
        mujoco.mj_comVel(compiled, data)
        return data.cvel[self.shell, :2].copy()


@contextmanager
def controlled(model: Model) -> Iterator[Control]:
    """The model's Control, in force inside the block; constant controls are in its keyframe."""
    control = Control(model)
    if model.scene.steady and not control.resistance:
        yield control
        return
    mujoco.set_mjcb_control(control)
    try:
        yield control
    finally:
        mujoco.set_mjcb_control(None)
