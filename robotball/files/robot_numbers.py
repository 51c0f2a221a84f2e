"""The numbers of a robot's own file by their paths, such as "battery.mass" or "drive.gear".

They are those that stand in its text, under the names that MJCF has, so that the text with other
numbers is still the author's. What the file leaves to a default has no path until it is written
there. A file that is not whole, or a URDF, is first written by MuJoCo.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple
from xml.parsers.expat import ParserCreate

import msgspec
import numpy as np

from robotball.drives import Rate
from robotball.equations import Rolling
from robotball.errors import InputError
from robotball.files import MODEL_FILES, contents, named
from robotball.files.mended_file import STILL, before_end, compiled, editable, with_attribute
from robotball.files.numbers import Numbers
from robotball.files.robot_file import RobotFile, RobotTable, controls_of, open_robot, scene_of
from robotball.scene import Scene

# The attributes that are numbers of a robot, and their units; how a robot is drawn is none.
_UNITS = {
    "mass": "kg", "density": "kg/m³", "pos": "m", "size": "m", "fromto": "m",
    "diaginertia": "kg m²", "fullinertia": "kg m²", "armature": "kg m²",
    "damping": "", "stiffness": "", "frictionloss": "N m", "springref": "", "gear": "",
    "kp": "", "kv": "", "gainprm": "", "biasprm": "", "dynprm": "", "timeconst": "s",
    "forcerange": "N m", "ctrlrange": "", "friction": "", "solref": "", "solimp": "",
    "margin": "m", "gravity": "m/s²",
}  # fmt: skip
_PARTS = {"friction": ("sliding", "torsional", "rolling")}


@dataclass(frozen=True)
class RobotScene(Scene):
    """A scene of a robot's own file, with the model that it is of, and the keyframe's name."""

    robot_file: RobotFile | None = field(default=None, compare=False)
    key: str | None = None


class _Place(NamedTuple):
    """Where a number stands: the byte of its element, its attribute, and which number of that."""

    at: int
    attribute: str
    i: int


@dataclass(frozen=True)
class RobotNumbers(Numbers):
    """A robot's file with its numbers by their paths, and what a scene takes besides.

    source: its text; controls: of actuators by name, instead of the keyframe's.
    """

    robot: RobotFile
    source: bytes
    controls: Mapping[str, Rate]
    rolling: Rolling | None
    key: str | None
    duration: float
    suffix: str = ".xml"

    @cached_property
    def _found(self) -> dict[str, tuple[_Place, float]]:
        return dict(_numbers(self.source))

    @property
    def places(self) -> Mapping[str, _Place]:
        """Where each number stands, by its path."""
        return {path: place for path, (place, _) in self._found.items()}

    def value(self, path: str) -> float:
        """Return the number at a path."""
        return self._found[path][1]

    def path_of(self, name: str) -> str:
        """Return the one path that a name stands for. Raises InputError as `Numbers.path_of`."""
        try:
            return super().path_of(name)
        except InputError as error:
            hint = "what the file does not state must be written there first"
            raise InputError(f"{error}; {hint}") from None

    def unit(self, path: str) -> str:
        """Return the unit of the number at a path; "" where it depends on the joint."""
        return _UNITS[self._found[path][0].attribute]

    def scene(self, values: Mapping[str, float]) -> RobotScene:
        """Return the scene with other numbers at some paths. Raises InputError for impossible."""
        with named(self.robot.path):
            robot = replace(self.robot, model=compiled(self._changed(values)))
            start = robot.start(self.key)
            found = scene_of(robot, start, self.controls, self.rolling, self.duration)
        own = {each.name: getattr(found, each.name) for each in fields(found)}
        return RobotScene(**own, robot_file=robot, key=self.key)

    def text(self, values: Mapping[str, float], start: Scene) -> str:
        """Return the text with other numbers, and a keyframe "fitted" that starts as a scene."""
        text = self._changed(values)
        data = replace(self.robot, model=compiled(text)).start_as(start, self.key)
        given = {"qpos": data.qpos, "qvel": data.qvel, "act": data.act, "ctrl": data.ctrl}
        key = "".join(f' {k}="{_digits(v)}"' for k, v in given.items() if len(v))
        return before_end(text, [f'<keyframe><key name="fitted"{key}/></keyframe>'])

    def _changed(self, values: Mapping[str, float]) -> str:
        """Return the text with other numbers at some paths."""
        data, found = self.source, self._found
        edits: defaultdict[tuple[int, str], dict[int, float]] = defaultdict(dict)
        for path, value in values.items():
            at, attribute, i = found[path][0]
            edits[at, attribute][i] = value
        for (at, attribute), new in sorted(edits.items(), reverse=True):
            beside = [v for place, v in found.values() if place[:2] == (at, attribute)]
            numbers = np.array([new.get(i, v) for i, v in enumerate(beside)])
            changed = with_attribute(data[at:].decode(), attribute, _digits(numbers))
            data = data[:at] + changed.encode()
        return data.decode()


def _digits(numbers: Any) -> str:
    return " ".join(f"{each:.12g}" for each in np.ravel(numbers))


def robot_numbers(path: Path) -> RobotNumbers:
    """Return the numbers of an MJCF or URDF file, or of the one that a scene file names.

    Raises InputError where it cannot be read or no text has the same robot.
    """
    given, file = RobotTable(robot=path.name), path
    if path.suffix not in MODEL_FILES:
        given = msgspec.convert(msgspec.toml.decode(contents(path)), RobotTable)
        file = path.parent / given.robot
    robot = open_robot(file, given.shell)
    source = editable(robot, STILL, {}, ()).source.encode()
    controls = controls_of(given, path.parent)
    duration = given.duration or _DURATION
    return RobotNumbers(robot, source, controls, given.rolling, given.keyframe, duration)


_DURATION = 10.0  # s: a fit's logs have their own


def _numbers(data: bytes) -> Iterator[tuple[str, tuple[_Place, float]]]:
    """Yield the paths of the numbers of an MJCF text, where they stand, and the numbers.

    An element is called by its name, or its tag, after that of its body.
    """
    found: list[tuple[str, tuple[_Place, float]]] = []
    owners, taken = [""], Counter[str]()
    parser = ParserCreate()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        at, owner = parser.CurrentByteIndex, owners[-1]
        name = attributes.get("name") or attributes.get("class", tag) * (tag == "default") or tag
        path = name if tag == "body" or not owner else f"{owner}.{name}"
        if "name" not in attributes:
            taken[path] += 1
            path += str(taken[path]) * (taken[path] > 1)
        owners.append(path if tag in ("body", "default") else owner)
        known = {each for each, _ in found}
        for attribute, text in attributes.items():
            if attribute not in _UNITS or not (numbers := _read(text)):
                continue
            for i, number in enumerate(numbers):
                parts = _PARTS.get(attribute, "xyz")
                part = f".{parts[i] if len(numbers) == 3 else i + 1}" * (len(numbers) > 1)
                full = f"{path}.{attribute}{part}"
                # A joint and a geom may be called alike.
                full = f"{path}.{tag}.{attribute}{part}" if full in known else full
                found.append((full, (_Place(at, attribute, i), number)))

    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda _: owners.pop()
    parser.Parse(data, True)
    yield from found


def _read(text: str) -> list[float]:
    """Return the numbers of an attribute; none where it has words."""
    try:
        return [float(each) for each in text.split()]
    except ValueError:
        return []
