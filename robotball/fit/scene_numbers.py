"""Numbers of a scene by path, such as "frame.part.battery.mass" or "friction.rolling".

Numbers of a scene file are kept unchanged, with the file's parts. Numbers of another scene are
taken from the text of `toml_of`. `robot_numbers` does the same for a robot's model file.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import getitem
from pathlib import Path
from typing import Any

import msgspec

from robotball.engines.equations import scene_of
from robotball.errors import unknown
from robotball.files import MODEL_FILES, contents, readable
from robotball.files.scene_tables import Number, Numbers, SceneTable
from robotball.files.scene_writer import start_keys, text_of, toml_of
from robotball.robot.scene import Scene
from robotball.scene_files.scene_file import CATALOG, catalog, read_keys
from robotball.scene_files.scene_keys import unit_at

_KeyPath = tuple[str | int, ...]
# The initial state is fitted separately; the other keys are not physical numbers of a robot.
_EXCLUDED = ("start", "duration", "title", "source", "gravity_direction")
_AXES = "xyz"


@dataclass(frozen=True)
class _SceneNumbers(Numbers):
    """The tables of a scene file, with defaults filled in, and its numbers by path."""

    name: str
    folder: Path
    tables: Mapping[str, Any]
    suffix: str = ".toml"

    @cached_property
    def known(self) -> dict[str, Number]:
        """Each number, keyed by path."""
        return dict(_numbers((), (), {k: v for k, v in self.tables.items() if k not in _EXCLUDED}))

    def scene(self, values: Mapping[str, float]) -> Scene:
        """Return the scene with some numbers replaced. Raises InputError if it is invalid."""
        scene = read_keys(self.folder / f"{self.name}.toml", self._changed(values))
        return replace(scene, name=self.name)

    def text(self, values: Mapping[str, float], start: Scene) -> str:
        """Return the scene file's text with some numbers replaced and the start of `start`."""
        tables = self._changed(values)
        tables["start"] = start_keys(start.start)
        for hinge in start.hinges:
            table = _body_table(tables, hinge.name)
            table["initial_angle"] = hinge.angle
            if hinge.motor is not None:
                table["initial_rate"] = hinge.rate
        return text_of(_as_table(tables))

    def with_whole(self, names: Sequence[str]) -> "_SceneNumbers":
        """Return the numbers, with mass, centre and inertia of some bodies in place of their parts.

        Raises InputError for the shell and rotors, whose inertia is symmetric.
        """
        hinges = self.scene({}).hinges if names else ()
        bodies = {h.name: h.body for h in hinges if not h.name.startswith("rotor")}
        tables: Any = deepcopy(self.tables)
        for name in names:
            if name not in bodies:
                raise unknown("body with a general inertia", name, bodies)
            body = bodies[name]
            table = _body_table(tables, name)
            whole = {"centre": body.centre.tolist(), "inertia": body.inertia.tolist()}
            table.update(dict.fromkeys(("part", "mjcf", "urdf")), mass=body.mass, **whole)
        return replace(self, tables=tables)

    def _changed(self, values: Mapping[str, float]) -> dict[str, Any]:
        changed: Any = deepcopy(self.tables)
        for path, value in values.items():
            for *above, last in _same(self.known[path].place):
                reduce(getitem, above, changed)[last] = float(value)
        return dict(changed)


def _same(place: _KeyPath) -> list[_KeyPath]:
    """Return the key path of a number, and of its mirror image in a symmetric tensor."""
    symmetric = len(place) > 1 and isinstance(place[-1], int) and isinstance(place[-2], int)
    return [place, (*place[:-2], place[-1], place[-2])] if symmetric else [place]


def _body_table(tables: Any, name: str) -> Any:
    kind = name.rstrip("0123456789")
    number = name.removeprefix(kind)
    return tables[kind][int(number) - 1] if number else tables[kind]


def _as_table(tables: Mapping[str, Any]) -> SceneTable:
    return msgspec.convert(tables, SceneTable)


def numbers_of(scene: Numbers | Scene | str | Path) -> Numbers:
    """Return the numbers of a scene, of a catalog name, or of a scene or robot file.

    Raises InputError for a scene that cannot be written to a file.
    """
    if isinstance(scene, Numbers):
        return scene
    if isinstance(scene, Scene):
        return _SceneNumbers(scene.name, CATALOG, _tables_of(scene.name, toml_of(scene)))
    path = CATALOG / f"{scene}.toml" if str(scene) in catalog() else Path(scene)
    loaded = scene_of(scene)  # reports errors in the file
    if path.suffix in MODEL_FILES or "robot" in msgspec.toml.decode(contents(path)):
        from robotball.user_model.mended_file import robot_numbers  # loads an engine

        return robot_numbers(path)
    return _SceneNumbers(loaded.name, path.parent, _tables_of(path, contents(path)))


def _tables_of(source: object, text: str | bytes) -> Mapping[str, Any]:
    with readable(f"{source}: not TOML"):
        table = _as_table(msgspec.toml.decode(text))
    # A round trip through JSON gives lists, and fills in defaults.
    return dict(msgspec.json.decode(msgspec.json.encode(table)))


def _numbers(path: tuple[str, ...], place: _KeyPath, value: object) -> Iterator[tuple[str, Number]]:
    if isinstance(value, bool):
        return
    if isinstance(value, int | float):
        unit = unit_at(".".join(key for key in place if isinstance(key, str)))
        yield ".".join(path), Number(float(value), unit, place)
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from _numbers((*path, key), (*place, key), inner)
    elif isinstance(value, list | tuple):
        triple = len(value) == len(_AXES) and not isinstance(value[0], dict)
        for i, inner in enumerate(value):
            if place and isinstance(place[-1], int) and i < place[-1]:
                continue  # a tensor is symmetric
            title = inner.get("name") if isinstance(inner, dict) else None
            word = title or (_AXES[i] if triple else str(i + 1))
            # Rotors and pendulums have the names of their hinges: rotor1, pendulum1.
            inner_path = (f"{path[0]}{word}",) if len(path) == 1 else (*path, word)
            yield from _numbers(inner_path, (*place, i), inner)
