"""The numbers of a scene by their paths, such as "frame.part.battery.mass" or "friction.rolling".

A scene file's numbers are as the file has them, and its parts stay parts; another scene's are those
of the text that `toml_of` writes. `robot_numbers` has the numbers of a robot's own file.
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
from robotball.files.numbers import Number, Numbers
from robotball.files.scene_tables import SceneTable
from robotball.files.scene_writer import text_of, toml_of
from robotball.robot.scene import Scene
from robotball.scene_files.scene_file import CATALOG, catalog, read_keys
from robotball.scene_files.scene_keys import unit_at

_Place = tuple[str | int, ...]
# A fit finds the start itself; the other keys are no numbers of a robot.
_NOT = ("start", "duration", "title", "source", "gravity_direction")
_AXES = "xyz"


@dataclass(frozen=True)
class SceneNumbers(Numbers):
    """Hold a scene as its file has it, with its numbers by their paths.

    name: of the scene; folder: of files that it names; tables: the file's, with defaults.
    """

    name: str
    folder: Path
    tables: Mapping[str, Any]
    suffix: str = ".toml"

    @cached_property
    def known(self) -> dict[str, Number]:
        """Each number, by its path."""
        return dict(_numbers((), (), {k: v for k, v in self.tables.items() if k not in _NOT}))

    def scene(self, values: Mapping[str, float]) -> Scene:
        """Return the scene with other numbers at some paths. Raises InputError where none is."""
        scene = read_keys(self.folder / f"{self.name}.toml", self._changed(values))
        return replace(scene, name=self.name)

    def text(self, values: Mapping[str, float], start: Scene) -> str:
        """Return the text of a scene file with other numbers, that starts as a scene does."""
        tables = self._changed(values)
        tables["start"] = {
            "attitude": start.start.attitude.tolist(),
            "momentum_world": start.start.momentum.tolist(),
        }
        for hinge in start.hinges:
            table = _body_table(tables, hinge.name)
            table["initial_angle"] = hinge.angle
            if hinge.motor is not None:
                table["initial_rate"] = hinge.rate
        return text_of(_as_table(tables))

    def with_whole(self, names: Sequence[str]) -> "SceneNumbers":
        """Return the numbers with mass, centre and inertia of some bodies in place of their parts.

        Raises InputError for the shell and rotors, whose inertia is symmetric.
        """
        hinges = self.scene({}).hinges if names else ()
        bodies = {h.name: h.body for h in hinges if not h.name.startswith("rotor")}
        tables: Any = deepcopy(self.tables)
        for name in names:
            if name not in bodies:
                raise unknown("body of any inertia", name, bodies)
            body = bodies[name]
            own = {"mass": body.mass, "centre": body.centre.tolist()}
            own["inertia"] = body.inertia.tolist()
            table = _body_table(tables, name)
            table.update(dict.fromkeys(("part", "mjcf", "urdf")), **own)
        return replace(self, tables=tables)

    def _changed(self, values: Mapping[str, float]) -> dict[str, Any]:
        changed: Any = deepcopy(self.tables)
        for path, value in values.items():
            for *above, last in _same(self.known[path].place):
                reduce(getitem, above, changed)[last] = float(value)
        return dict(changed)


def _same(place: _Place) -> list[_Place]:
    """Return the places of one number: two of a tensor's, whose rows are a list of lists."""
    symmetric = len(place) > 1 and isinstance(place[-1], int) and isinstance(place[-2], int)
    return [place, (*place[:-2], place[-1], place[-2])] if symmetric else [place]


def _body_table(tables: Any, name: str) -> Any:
    """Return the table of a body, which has the name of its hinge."""
    kind = name.rstrip("0123456789")
    number = name.removeprefix(kind)
    return tables[kind][int(number) - 1] if number else tables[kind]


def _as_table(tables: Mapping[str, Any]) -> SceneTable:
    return msgspec.convert(tables, SceneTable)


def numbers_of(scene: Numbers | Scene | str | Path) -> Numbers:
    """Return the numbers of a scene, or of the scene of a name or a file, a robot's own too.

    Raises InputError for a scene that no file can hold.
    """
    if isinstance(scene, Numbers):
        return scene
    if isinstance(scene, Scene):
        return SceneNumbers(scene.name, CATALOG, _tables_of(scene.name, toml_of(scene)))
    path = CATALOG / f"{scene}.toml" if str(scene) in catalog() else Path(scene)
    loaded = scene_of(scene)  # which says what is wrong with the file
    if path.suffix in MODEL_FILES or "robot" in msgspec.toml.decode(contents(path)):
        from robotball.user_model.robot_numbers import robot_numbers  # which loads an engine

        return robot_numbers(path)
    return SceneNumbers(loaded.name, path.parent, _tables_of(path, contents(path)))


def _tables_of(what: object, text: str | bytes) -> Mapping[str, Any]:
    with readable(f"{what}: not TOML"):
        table = _as_table(msgspec.toml.decode(text))
    # By way of JSON, which has lists, and the defaults of keys that are not given.
    return dict(msgspec.json.decode(msgspec.json.encode(table)))


def _numbers(words: tuple[str, ...], place: _Place, value: object) -> Iterator[tuple[str, Number]]:
    """Yield the numbers in a value of TOML with their paths."""
    if isinstance(value, bool):
        return
    if isinstance(value, int | float):
        unit = unit_at(".".join(key for key in place if isinstance(key, str)))
        yield ".".join(words), Number(float(value), unit, place)
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from _numbers((*words, key), (*place, key), inner)
    elif isinstance(value, list | tuple):
        triple = len(value) == len(_AXES) and not isinstance(value[0], dict)
        for i, inner in enumerate(value):
            if place and isinstance(place[-1], int) and i < place[-1]:
                continue  # a tensor is symmetric
            named = inner.get("name") if isinstance(inner, dict) else None
            word = named or (_AXES[i] if triple else str(i + 1))
            # Rotors and pendulums as their hinges are named: rotor1, pendulum1.
            own = (f"{words[0]}{word}",) if len(words) == 1 else (*words, word)
            yield from _numbers(own, (*place, i), inner)
