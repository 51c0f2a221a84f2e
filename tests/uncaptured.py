"""Steps of captured engines taken from Python, for the process of an engine's environment."""

from collections.abc import Sequence
from typing import Any

from robotball.engines import adapter
from robotball.motion import ContactMotion
from robotball.robot.scene import Scene
from robotball.rotations import Array


def _take(self: adapter.CapturedWorld, step: float) -> None:
    with self.warp.ScopedDevice(self.device):
        self.take(step)


def motions_without_capture(
    name: str, scenes: Sequence[Scene], times: Array, settings: Any
) -> list[ContactMotion]:
    adapter.CapturedWorld.step = _take  # type: ignore[method-assign]
    return adapter._rolled_by(name, scenes, times, settings)
