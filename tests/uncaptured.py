"""Steps of captured engines taken from Python, for the process of an engine's environment."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

from robotball.engines import adapter
from robotball.robot.scene import Scene
from robotball.rotations import Array


def _take(self: adapter.CapturedWorld, step: float) -> None:
    with self.warp.ScopedDevice(self.device):
        self.take(step)


def rows_without_capture(name: str, scenes: Sequence[Scene], times: Array, settings: Any) -> Array:
    """Return the State rows (n, k, 13 + 2h) of balls side by side."""
    adapter.CapturedWorld.step = _take  # type: ignore[method-assign]
    with NamedTemporaryFile() as file:
        adapter.stepped_by(name, scenes, times, settings, Path(file.name))
        return adapter.rows_in(Path(file.name), len(scenes), len(times)).copy()
