"""The controls of the actuators: at every evaluation of the forces, so that RK4 keeps its order."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

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

    def inside(self, t: float) -> float:
        """A time [s] of the span, or the nearest one that is inside it."""
        begin, end = self.span
        return max(begin, min(t, end - INSIDE))

    def __call__(self, _: mujoco.MjModel, data: mujoco.MjData) -> None:
        t = self.inside(data.time)
        data.ctrl[:] = [hinge.control(t) for hinge in self.model.hinges if hinge.actuated]


@contextmanager
def controlled(model: Model) -> Iterator[Control]:
    """The model's Control, in force inside the block; constant controls are in its keyframe."""
    control = Control(model)
    if model.scene.steady:
        yield control
        return
    mujoco.set_mjcb_control(control)
    try:
        yield control
    finally:
        mujoco.set_mjcb_control(None)
