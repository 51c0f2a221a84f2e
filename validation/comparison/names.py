"""What the files of a comparison are called: no two of different runs share a name."""

from collections.abc import Sequence
from pathlib import Path

from robotball import Scene, engine_named
from robotball.engines import DEFAULT
from robotball.motion import Label
from validation.comparison.agreement import Agreement

ALL = "all"  # of an engine's presets


def file_stem(agreements: Sequence[Agreement]) -> str:
    """The scene, the engine and the settings of one scene's agreements by one engine.

    The default engine is left out, and so is an engine's default preset; all of its presets are
    `all`.
    """
    first, names = agreements[0], [each.settings.name for each in agreements]
    if first.engine is not None and names == [first.engine.default]:
        names = []
    elif first.engine is not None and names == list(first.engine.presets):
        names = [ALL]
    return _joined(first.scene.name, first.motion.engine, names)


def fault_window_path(folder: Path, scene: Scene, engine: Label, settings: str) -> Path:
    """Where the states around the first fault of a run go, by the name of its settings."""
    return folder / f"{_joined(scene.name, engine, [settings])}-fault.json"


def _joined(scene: str, engine: Label, names: Sequence[str]) -> str:
    by = [] if engine == engine_named(DEFAULT).label else [engine.name.lower()]
    return "-".join([scene, *by, *names]).replace(" ", "-").replace("/", "-")
