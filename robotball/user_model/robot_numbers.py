"""The numbers of a robot's own file by their paths, such as "battery.mass" or "drive.gear".

The numbers are those in its text, under MJCF's names, so that the text with other numbers is still
the author's. What the file leaves to a default has no path until it is written there. A file that
is not whole, or a URDF, is first written by MuJoCo.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path

import msgspec

from robotball.errors import InputError, named
from robotball.files import MODEL_FILES, contents
from robotball.files.numbers import Number, Numbers
from robotball.robot.drives import Rate
from robotball.robot.scene import Scene
from robotball.user_model.mended_file import (
    STILL,
    before_end,
    compiled,
    digits,
    editable,
    edited,
    elements_of,
)
from robotball.user_model.robot_file import RobotFile, open_robot
from robotball.user_model.robot_scene import RobotTable, controls_of, scene_of

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
_DURATION = 10.0  # s: a fit's logs have their own


@dataclass(frozen=True)
class RobotScene(Scene):
    """A scene of a robot's own file, with the file's model and the keyframe's name."""

    robot_file: RobotFile | None = field(default=None, compare=False)
    key: str | None = None


@dataclass(frozen=True)
class RobotNumbers(Numbers):
    """A robot's file with its numbers by their paths.

    source: its text; given: what a scene file says of it besides; controls: of actuators by name,
    instead of the keyframe's.
    """

    robot: RobotFile
    source: bytes
    given: RobotTable
    controls: Mapping[str, Rate]
    suffix: str = ".xml"

    @cached_property
    def known(self) -> dict[str, Number]:
        """Each number, by its path; the unit of some depends on the joint."""
        return dict(_numbers(self.source))

    def path_of(self, name: str) -> str:
        """Return the one path that a name stands for. Raises InputError as `Numbers.path_of`."""
        try:
            return super().path_of(name)
        except InputError as error:
            hint = "what the file does not state must be written there first"
            raise InputError(f"{error}; {hint}") from None

    def scene(self, values: Mapping[str, float]) -> RobotScene:
        """Return the scene with other numbers at some paths. Raises InputError where none is."""
        key, duration = self.given.keyframe, self.given.duration or _DURATION
        with named(self.robot.path):
            robot = replace(self.robot, model=compiled(self._changed(values)))
            found = scene_of(robot, robot.start(key), self.controls, self.given.rolling, duration)
        own = {each.name: getattr(found, each.name) for each in fields(found)}
        return RobotScene(**own, robot_file=robot, key=key)

    def text(self, values: Mapping[str, float], start: Scene) -> str:
        """Return the text with other numbers, and a keyframe "fitted" that starts as a scene."""
        text = self._changed(values)
        data = replace(self.robot, model=compiled(text)).start_as(start, self.given.keyframe)
        given = {"qpos": data.qpos, "qvel": data.qvel, "act": data.act, "ctrl": data.ctrl}
        key = "".join(f' {k}="{digits(v)}"' for k, v in given.items() if len(v))
        return before_end(text, [f'<keyframe><key name="fitted"{key}/></keyframe>'])

    def _changed(self, values: Mapping[str, float]) -> str:
        """Return the text with other numbers at some paths."""
        # A place is an element and an attribute of it, whose numbers are in their order.
        numbers: defaultdict[tuple[int, str], list[float]] = defaultdict(list)
        for path, (value, _, place) in self.known.items():
            numbers[place].append(values.get(path, value))
        changed = dict.fromkeys(self.known[path].place for path in values)
        return edited(self.source, [(*place, digits(numbers[place])) for place in changed])


def robot_numbers(path: Path) -> RobotNumbers:
    """Return the numbers of an MJCF or URDF file, or of the one that a scene file names.

    Raises InputError where it cannot be read or no text has the same robot.
    """
    given = RobotTable(robot=path.name)
    if path.suffix not in MODEL_FILES:
        given = msgspec.convert(msgspec.toml.decode(contents(path)), RobotTable)
    robot = open_robot(path.parent / given.robot, given.shell)
    source = editable(robot, STILL, {}, ()).source.encode()
    return RobotNumbers(robot, source, given, controls_of(given, path.parent))


def _numbers(data: bytes) -> Iterator[tuple[str, Number]]:
    """Yield the numbers of an MJCF text with their paths.

    An element is called by its name, or its tag, after that of its body.
    """
    found: set[str] = set()
    paths, taken = [""], Counter[str]()
    for tag, at, owner, attributes in elements_of(data):
        above = paths[owner + 1]
        name = attributes.get("name") or attributes.get("class", tag) * (tag == "default") or tag
        path = name if tag == "body" or not above else f"{above}.{name}"
        if "name" not in attributes:
            taken[path] += 1
            path += str(taken[path]) * (taken[path] > 1)
        paths.append(path if tag != "worldbody" else "")
        for attribute, text in attributes.items():
            if attribute not in _UNITS or not (numbers := _read(text)):
                continue
            for i, number in enumerate(numbers):
                parts = _PARTS.get(attribute, "xyz")
                part = f".{parts[i] if len(numbers) == 3 else i + 1}" * (len(numbers) > 1)
                full = f"{path}.{attribute}{part}"
                # A joint and a geom may be called alike.
                full = f"{path}.{tag}.{attribute}{part}" if full in found else full
                found.add(full)
                yield full, Number(number, _UNITS[attribute], (at, attribute))


def _read(text: str) -> list[float]:
    """Return the numbers of an attribute; none where it has words."""
    try:
        return [float(each) for each in text.split()]
    except ValueError:
        return []
