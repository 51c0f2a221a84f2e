"""The numbers of a robot's file, with paths such as "battery.mass" or "drive.gear".

Paths use the names of MJCF, and stand for numbers in the author's text, which is changed in place.
A default that the file does not state has no path. MuJoCo first writes a file with
includes, or a URDF.
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
from robotball.user_model.robot_scene import DURATION, RobotTable, controls_of, scene_of

# The attributes with numbers, and their units; attributes for drawing are left out.
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
    """A scene of a robot's file, with the file's model and the name of the keyframe."""

    robot_file: RobotFile | None = field(default=None, compare=False)
    key: str | None = None


@dataclass(frozen=True)
class RobotNumbers(Numbers):
    """The numbers of a robot's file, and their paths.

    source: the text of the file. table: of the scene file that names the robot. controls: by the
    names of actuators, in place of the controls of the keyframe.
    """

    robot: RobotFile
    source: bytes
    table: RobotTable
    controls: Mapping[str, Rate]
    suffix: str = ".xml"

    @cached_property
    def known(self) -> dict[str, Number]:
        """Each number, for its path. The unit is "" if it depends on the joint."""
        return dict(_numbers(self.source))

    def path_of(self, name: str) -> str:
        """Return the path that a name stands for. Raises InputError as `Numbers.path_of`."""
        try:
            return super().path_of(name)
        except InputError as error:
            hint = "a default has no path until it is written into the file"
            raise InputError(f"{error}; {hint}") from None

    def scene(self, values: Mapping[str, float]) -> RobotScene:
        """Return the scene with other numbers at some paths. Raises InputError if it is invalid."""
        key, duration = self.table.keyframe, self.table.duration or DURATION
        with named(self.robot.path):
            robot = replace(self.robot, model=compiled(self._changed(values)))
            scene = scene_of(robot, robot.start(key), self.controls, self.table.rolling, duration)
        values_of = {field.name: getattr(scene, field.name) for field in fields(scene)}
        return RobotScene(**values_of, robot_file=robot, key=key)

    def text(self, values: Mapping[str, float], start: Scene) -> str:
        """Return the text with other numbers, and a keyframe "fitted" with the start of a scene."""
        text = self._changed(values)
        data = replace(self.robot, model=compiled(text)).start_as(start, self.table.keyframe)
        state = {"qpos": data.qpos, "qvel": data.qvel, "act": data.act, "ctrl": data.ctrl}
        key = "".join(f' {k}="{digits(v)}"' for k, v in state.items() if len(v))
        return before_end(text, [f'<keyframe><key name="fitted"{key}/></keyframe>'])

    def _changed(self, values: Mapping[str, float]) -> str:
        """Return the text with other numbers at some paths."""
        # A place is an element and an attribute, with numbers in the order of the text.
        numbers: defaultdict[tuple[int, str], list[float]] = defaultdict(list)
        for path, (value, _, place) in self.known.items():
            numbers[place].append(values.get(path, value))
        changed = dict.fromkeys(self.known[path].place for path in values)
        return edited(self.source, [(*place, digits(numbers[place])) for place in changed])


def robot_numbers(path: Path) -> RobotNumbers:
    """Return the numbers of an MJCF or URDF file, or of the robot file that a scene file names.

    Raises InputError if it cannot be read, or no text compiles to the same robot.
    """
    table = RobotTable(robot=path.name)
    if path.suffix not in MODEL_FILES:
        table = msgspec.convert(msgspec.toml.decode(contents(path)), RobotTable)
    robot = open_robot(path.parent / table.robot, table.shell)
    source = editable(robot, STILL, {}, ()).source.encode()
    return RobotNumbers(robot, source, table, controls_of(table, path.parent))


def _numbers(data: bytes) -> Iterator[tuple[str, Number]]:
    """Yield the numbers of an MJCF text with their paths.

    A path has the name of the body, and the name or tag of the element.
    """
    seen, paths, taken = set[str](), [""], Counter[str]()
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
                # A joint and a geom may have the same name.
                full = f"{path}.{tag}.{attribute}{part}" if full in seen else full
                seen.add(full)
                yield full, Number(number, _UNITS[attribute], (at, attribute))


def _read(text: str) -> list[float]:
    """Return the numbers of an attribute; an empty list if it has words."""
    try:
        return [*map(float, text.split())]
    except ValueError:
        return []
