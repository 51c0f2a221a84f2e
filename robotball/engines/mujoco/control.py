"""What acts on a model besides itself, at every evaluation of the forces: so RK4 keeps its order.

The controls of the actuators, and the plane's resistance to rolling where the scene has one.
MuJoCo's own rolling friction (condim 6) is another law: it shares one cone with the friction that
holds the ball, and acts against an acceleration rather than against the rolling.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import mujoco

from robotball.engines.mujoco.model import Model

INSIDE = 1e-9  # s: how far before the end of a span its own side of a breakpoint is taken


@dataclass
class Control:
    """The controls of a model's hinges within one smooth span of time [s].

    MuJoCo calls it, held by `controlled`, whenever it needs the forces.
    """

    model: Model
    span: Sequence[float] = (0.0, 0.0)
    resistance: float = field(init=False)  # N m, to rolling
    shell: int = field(init=False)

    def __post_init__(self) -> None:
        scene = self.model.scene
        normal_force = -scene.ball.mass * scene.gravity_world[2]
        self.resistance = float(scene.friction.rolling * normal_force)
        self.shell = self.model.compiled.body("shell").id

    def inside(self, t: float) -> float:
        """A time [s] of the span, or the nearest one that is inside it."""
        begin, end = self.span
        return max(begin, min(t, end - INSIDE))

    def __call__(self, _: mujoco.MjModel, data: mujoco.MjData) -> None:
        t = self.inside(data.time)
        data.ctrl[:] = [hinge.control(t) for hinge in self.model.hinges if hinge.actuated]
        if self.resistance:
            x, y, _ = data.cvel[self.shell, :3].tolist()
            turning = math.hypot(x, y)
            held = self.resistance / turning if turning else 0.0
            data.xfrc_applied[self.shell, 3:5] = -held * x, -held * y


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
