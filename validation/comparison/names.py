"""What files are called: no two of different runs share a name.

A name has the scene, the engine, the preset, and every option that is not at its default.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import chain, count
from pathlib import Path
from typing import Any

from robotball import Scene, catalog, load_scene
from robotball.motion import Label
from validation.comparison.agreement import Agreement

ALL = "all"  # of an engine's presets


def scenes_of(names: Sequence[str]) -> dict[str, Scene]:
    """The scenes of catalog names and paths, by these; each once, and no two with one name.

    Those of files with the same name in two folders are named after the folder as well. Raises
    InputError where one cannot be loaded.
    """
    distinct = {name if name in catalog() else Path(name).absolute(): name for name in names}
    scenes = [load_scene(name) for name in distinct.values()]
    often = Counter(scene.name for scene in scenes)
    named: list[Scene] = []
    for path, scene in zip(distinct, scenes, strict=True):
        name = scene.name
        if often[name] > 1 and isinstance(path, Path):
            name = f"{path.parent.name}-{name}"
        taken = {each.name for each in named}
        others = (f"{name}-{number}" for number in count(2))
        free = next(each for each in chain((name,), others) if each not in taken)
        named.append(replace(scene, name=free))
    return dict(zip(distinct.values(), named, strict=True))


def file_stem(agreements: Sequence[Agreement]) -> str:
    """The scene, the engine and the settings of one scene's agreements by one engine.

    All of the engine's presets are `all`. Simulated time is named where it is not the scene's own.
    """
    first, names = agreements[0], [each.settings.name for each in agreements]
    if first.engine is not None and len(names) > 1 and names == list(first.engine.presets):
        names = [ALL]
    end = float(first.theory.times[-1])
    time = [] if end == first.scene.duration else [f"{end:g}s"]
    return file_name(first.scene.name, first.motion.engine, [*names, *time])


def fault_window_path(folder: Path, scene: Scene, engine: Label, settings: str) -> Path:
    """Where the states around the first fault of a run go, by the name of its settings."""
    return folder / f"{file_name(scene.name, engine, [settings])}-fault.json"


def file_name(scene: str, engine: Label | None, words: Sequence[str]) -> str:
    """The scene, the engine if there is one, and what else tells a file apart."""
    by = [] if engine is None else [engine.name.lower()]
    plain = [re.sub(r" - |[^\w.+-]+", "-", word).strip("-") for word in (*by, *words)]
    return "-".join([scene.replace(" ", "-").replace("/", "-"), *plain])


def changed(options: Any, *names: str) -> list[str]:
    """A word for each of these fields of a dataclass that is not at its default."""
    words = []
    for each in fields(options):
        value = getattr(options, each.name)
        if each.name in names and value != each.default:
            words += _words(each.name.replace("_", "-"), value)
    return words


def _words(name: str, value: Any) -> list[str]:
    if value is True:
        return [name]
    if isinstance(value, int | float):
        return [f"{value:g}s" if name == "duration" else f"{name}-{value:g}"]
    return [*value] if isinstance(value, tuple) else [str(value)]
