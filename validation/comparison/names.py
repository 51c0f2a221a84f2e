"""What the files of a comparison are called: no two of different runs share a name."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, count
from pathlib import Path

from robotball import Scene, catalog, engine_named, load_scene
from robotball.engines import DEFAULT
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

    The default engine is left out, and so is an engine's default preset; all of its presets are
    `all`.
    """
    first, names = agreements[0], [each.settings.name for each in agreements]
    if first.engine is not None and names == [first.engine.default]:
        names = []
    elif first.engine is not None and names == list(first.engine.presets):
        names = [ALL]
    return file_name(first.scene.name, first.motion.engine, names)


def fault_window_path(folder: Path, scene: Scene, engine: Label, settings: str) -> Path:
    """Where the states around the first fault of a run go, by the name of its settings."""
    return folder / f"{file_name(scene.name, engine, [settings])}-fault.json"


def file_name(scene: str, engine: Label, names: Sequence[str]) -> str:
    """The scene, the engine unless it is the default one, and what else tells a file apart."""
    by = [] if engine == engine_named(DEFAULT).label else [engine.name.lower()]
    return "-".join([scene, *by, *names]).replace(" ", "-").replace("/", "-")
