"""Change a user's robot file as text: a block at its end, with a comment for each change.

MuJoCo merges sections that appear twice, and uses the last value of an option. So the file stays
unchanged, except for names that the block needs, and for a new start. A URDF, or a file with
includes or replicas, cannot be changed in this way, so MuJoCo first writes it as one MJCF file.

`RobotNumbers` replaces numbers in the text, by paths such as "battery.mass" or "drive.gear". Paths
use the names of MJCF; a default that the file does not state has no path.
"""

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple
from xml.parsers.expat import ExpatError, ParserCreate, XMLParserType
from xml.sax.saxutils import quoteattr

import msgspec
import mujoco
import numpy as np

from robotball.errors import InputError, named
from robotball.files import MODEL_FILES, contents
from robotball.files.scene_tables import Number, Numbers
from robotball.robot.drives import Rate
from robotball.robot.scene import Scene
from robotball.rotations import Array
from robotball.user_model.robot_file import RobotFile, body_name, open_robot, unused_name
from robotball.user_model.robot_scene import DURATION, RobotTable, controls_of, scene_of
from robotball.user_model.sandbox import COMMENT, opened_spec

# Patterns of a start tag with its attributes, and of an attribute with its quoted value.
_START_TAG = re.compile(r"<[^\s/>]+(\s+[^\s=]+\s*=\s*(\"[^\"]*\"|'[^']*'))*")
_ATTRIBUTE = re.compile(r"\s([^\s=]+)\s*=\s*(\"[^\"]*\"|'[^']*')")
# The attributes that have numbers, with their units. Attributes for drawing are left out.
_UNITS = {
    "mass": "kg", "density": "kg/m³", "pos": "m", "size": "m", "fromto": "m",
    "diaginertia": "kg m²", "fullinertia": "kg m²", "armature": "kg m²",
    "damping": "", "stiffness": "", "frictionloss": "N m", "springref": "", "gear": "",
    "kp": "", "kv": "", "gainprm": "", "biasprm": "", "dynprm": "", "timeconst": "s",
    "forcerange": "N m", "ctrlrange": "", "friction": "", "solref": "", "solimp": "",
    "margin": "m", "gravity": "m/s²",
}  # fmt: skip
_PARTS = {"friction": ("sliding", "torsional", "rolling")}
_Names = Mapping[tuple[str, int], str]  # by kind (geom or body) and number


@dataclass(frozen=True)
class Change:
    """A change to a file.

    Attributes
    ----------
    name, words : str
        The name of the change, and a text about the fault that the change removes.
    option, pair, joint : dict
        New attributes of the option, of the contact pair of sphere and plane, and of the joints
        without a default class.
    exclude : tuple of (str, str)
        Pairs of bodies that have no contacts with each other.
    start : bool
        Whether the change sets the robot down on the plane and lets it roll without slipping.
    """

    name: str
    words: str
    option: Mapping[str, str] = field(default_factory=dict)
    pair: Mapping[str, str] = field(default_factory=dict)
    exclude: tuple[tuple[str, str], ...] = ()
    start: bool = False
    joint: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Editable:
    """The text of a robot's file, in which the sphere and the plane have names.

    Attributes
    ----------
    source : str
        The text before any change.
    text, moved : str
        The text with names: `text` with the start of the file, `moved` with a new start.
    sphere, plane : str
        The names of the two geoms.
    pair : dict
        The attributes of the contact of sphere and plane in the file.
    paired : bool
        Whether the file has a <pair> of sphere and plane; `text` does not have it.
    """

    source: str
    text: str
    moved: str
    sphere: str
    plane: str
    pair: Mapping[str, str]
    paired: bool

    def changed(self, changes: Iterable[Change]) -> str:
        """Return the text of the file with some changes."""
        changes = tuple(changes)
        text = self.text
        for change in changes:
            if change.start:  # the comment stands above the first tag that changes
                pairs = enumerate(zip(text, self.moved, strict=False))
                at = self.moved.rfind("<", 0, next((i for i, (a, b) in pairs if a != b), None))
                text = self.moved[:at] + _above(self.moved[:at], change) + self.moved[at:]
        if not changes and not self.paired:
            return text
        return _before_end(text, self._block(changes))

    def _block(self, changes: Iterable[Change]) -> Iterator[str]:
        pair = dict(self.pair)
        contact = []
        for change in changes:
            if change.option or change.joint:
                yield _comment(change)
            if change.option:
                yield f"<option{_attributes(change.option)}/>"
            if change.joint:
                yield f"<default><joint{_attributes(change.joint)}/></default>"
            if change.pair or change.exclude:
                contact.append(f"  {_comment(change)}")
            pair |= change.pair
            for a, b in change.exclude:
                contact.append(f"  <exclude{_attributes({'body1': a, 'body2': b})}/>")
        if contact or self.paired:
            geoms = {"geom1": self.plane, "geom2": self.sphere}
            yield "<contact>"
            yield from contact
            yield f"  <pair{_attributes(geoms | pair)}/>"
            yield "</contact>"


def _above(before: str, change: Change) -> str:
    """Return a comment for a tag after some text, on a line of its own if the tag begins one."""
    indent = before.rpartition("\n")[2]
    return _comment(change) + ("" if indent.strip() else f"\n{indent}")


def _before_end(text: str, lines: Iterable[str]) -> str:
    """Return an MJCF text with lines added before the end tag of its root."""
    data, ends = text.encode(), [0]
    parser = _parser()
    parser.EndElementHandler = lambda _: ends.append(parser.CurrentByteIndex)
    parser.Parse(data, True)
    before, rest = data[: ends[-1]].decode().rstrip(" "), data[ends[-1] :].decode()
    broken = "" if before.endswith("\n") else "\n"
    return before + broken + "".join(f"  {line}\n" for line in lines) + rest


def _parser() -> XMLParserType:
    # MuJoCo reads every file as UTF-8, whatever encoding the file declares.
    return ParserCreate("utf-8")


def in_comment(words: str) -> str:
    """Return a text without two hyphens in a row, which are not allowed in an XML comment."""
    return re.sub("-(?=-)", "- ", words)


def _comment(change: Change) -> str:
    return f"<!-- {change.name}: {in_comment(change.words)} -->"


def _attributes(values: Mapping[str, str]) -> str:
    return "".join(f" {name}={quoteattr(value)}" for name, value in values.items())


def compiled(text: str) -> mujoco.MjModel:
    """Return the model of an MJCF text. Raises InputError if MuJoCo refuses it."""
    try:
        return mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise InputError(f"the changed file does not compile: {error}") from None


@dataclass(frozen=True)
class StartShift:
    """Changes to the start of a file.

    Attributes
    ----------
    shift : (3,), m, world
        Added to the robot's position in all keyframes.
    kick : (3,), m/s, world
        Added to the robot's velocity at the keyframe with the number `key`.
    key : int or None
        The number of a keyframe.
    """

    shift: Array
    kick: Array
    key: int | None


_STILL = StartShift(np.zeros(3), np.zeros(3), None)


def editable(
    robot: RobotFile, moves: StartShift, pair: Mapping[str, str], bodies: Iterable[int]
) -> Editable:
    """Return the text of a robot's file, ready for changes.

    moves: the changes that set the robot down on the plane and remove its slip. pair: the
    attributes of the contact of sphere and plane in the file. bodies: the bodies that need a name.
    Raises InputError if no text compiles to the same robot.
    """
    model = robot.model
    defaults = {
        ("geom", robot.sphere): unused_name(model, "geom", "rolling_sphere"),
        ("geom", robot.plane): unused_name(model, "geom", "plane"),
        **{("body", i): body_name(model, i) for i in bodies},
    }
    names = {(kind, i): getattr(model, kind)(i).name for kind, i in defaults}
    new = {part: name for part, name in defaults.items() if not names[part]}
    names |= new
    pairs = zip(model.pair_geom1, model.pair_geom2, strict=True)
    replaced = next((i for i, geoms in enumerate(pairs) if robot.rolls(map(int, geoms))), None)
    sphere, plane = (names["geom", i] for i in (robot.sphere, robot.plane))
    # Try the author's text first, then the file as MuJoCo writes it.
    for read in (_repaired, _rewritten):
        try:
            source = read(robot)
            text, moved = (_prepared(source, robot, it, new, replaced) for it in (_STILL, moves))
            if _is_same(robot, names, text, _STILL) and _is_same(robot, names, moved, moves):
                whole = _prepared(source, robot, _STILL, {}, None)
                return Editable(whole, text, moved, sphere, plane, pair, replaced is not None)
        except (InputError, ExpatError, IndexError, UnicodeDecodeError):
            continue
    raise InputError(f"{robot.path} cannot be mended: rewriting the file changes the robot")


def _rewritten(robot: RobotFile) -> bytes:
    """Return a robot's file as MuJoCo writes it, without comments, which may be invalid XML."""
    return COMMENT.sub("", robot.spec.to_xml()).encode()


def _repaired(robot: RobotFile) -> bytes:
    """Return the text of a robot's file with its repairs."""
    text = robot.path.read_bytes()
    if "inertia" in robot.repairs:
        old, elements = opened_spec(robot.path)[0].bodies, _elements_of(text)
        bodies = [i for i, it in enumerate(elements) if it.tag in ("worldbody", "body")]
        for element in elements[::-1]:  # an edit shifts the text after it
            if element.tag == "inertial" and element.owner >= 0:
                number = bodies.index(element.owner)
                moments = robot.spec.bodies[number].inertia
                if np.any(moments != old[number].inertia):
                    kind = min({"diaginertia", "fullinertia"} & {*element.attributes})
                    numbers = _digits([*moments, 0, 0, 0][: 3 if kind == "diaginertia" else 6])
                    text = _edited(text, [(element.at, kind, numbers)]).encode()
                    text = _commented(text, element.at, Change("inertia", robot.repairs["inertia"]))
    if words := robot.repairs.get("freejoint"):
        elements = _elements_of(text)
        root = [body for body in elements if body.tag == "body" and body.owner >= 0][robot.root - 1]
        name, tag = dict[str, str](), _START_TAG.match(text[root.at :].decode())
        assert tag is not None
        above, at = root.at, text.index(b">", root.at + len(tag.group().encode())) + 1
        for joint in elements:
            if joint.tag == "joint" and elements[joint.owner] == root:
                name = {key: joint.attributes[key] for key in ("name",) if key in joint.attributes}
                text = _edited(text, [(joint.at, "", "")]).encode()
                above = at = joint.at
                break  # the following joints belong to other bodies
        text = text[:at] + f"<freejoint{_attributes(name)}/>".encode() + text[at:]
        text = _commented(text, above, Change("freejoint", words))
    if words := robot.repairs.get("floor"):
        height = f"0 0 {robot.model.geom_pos[robot.plane, 2]:.9g}"
        floor = f'<geom type="plane" size="0 0 1" pos="{height}"/>'
        lines = [_comment(Change("floor", words)), f"<worldbody>{floor}</worldbody>"]
        text = _before_end(text.decode(), lines).encode()
    return text


def _commented(text: bytes, at: int, change: Change) -> bytes:
    """Return a text with a comment above the tag at a byte."""
    return text[:at] + _above(text[:at].decode(), change).encode() + text[at:]


def _is_same(robot: RobotFile, names: _Names, text: str, moves: StartShift) -> bool:
    """Return whether a text compiles to the same robot, with these names and this new start."""
    model, other, at = robot.model, compiled(text), robot.free
    kicks = np.zeros_like(model.key_qvel)
    if moves.key is not None:
        kicks[moves.key, robot.drift] = moves.kick
    starts = [(model.qpos0, other.qpos0), *zip(model.key_qpos, other.key_qpos, strict=False)]
    return (
        (model.nbody, model.ngeom, model.nq, model.nkey)
        == (other.nbody, other.ngeom, other.nq, other.nkey)
        and all(getattr(other, kind)(i).name == name for (kind, i), name in names.items())
        and np.allclose(model.body_mass, other.body_mass, rtol=1e-6)
        and np.allclose(model.body_inertia, other.body_inertia, rtol=1e-6)
        and all(np.allclose(old[at] + moves.shift, new[at], atol=1e-6) for old, new in starts)
        and np.allclose(model.key_qvel + kicks, other.key_qvel, atol=1e-6)
    )


def _folders(robot: RobotFile) -> dict[str, str]:
    """Return absolute folders of meshes and textures, if any, because the text may be moved."""
    model, spec, here = robot.model, robot.spec, robot.path.parent.absolute()
    if not (model.nmesh or model.ntex or model.nhfield or model.nskin):
        return {}
    return {"meshdir": str(here / spec.meshdir), "texturedir": str(here / spec.texturedir)}


class _Element(NamedTuple):
    """A start tag, the position of its first byte in the text, and the number of its owner.

    The owner is the nearest body, worldbody or default that contains the tag; -1 if there is none.
    """

    tag: str
    at: int
    owner: int
    attributes: Mapping[str, str]


def _elements_of(data: bytes) -> list[_Element]:
    """Return the elements of an MJCF text in order."""
    elements, owners, parser = list[_Element](), [-1], _parser()

    def begin(tag: str, attributes: Mapping[str, str]) -> None:
        elements.append(_Element(tag, parser.CurrentByteIndex, owners[-1], attributes))
        owns = tag in ("body", "worldbody", "default")
        owners.append(len(elements) - 1 if owns else owners[-1])

    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda _: owners.pop()
    parser.Parse(data, True)
    return elements


def _prepared(
    source: bytes, robot: RobotFile, moves: StartShift, names: _Names, pair: int | None
) -> str:
    """Return a robot's file with new names and a new start, without one of its pairs."""
    model, elements = robot.model, _elements_of(source)

    def tagged(tag: str) -> list[_Element]:
        return [element for element in elements if element.tag == tag]

    bodies = [body for body in tagged("body") if body.owner >= 0]

    def part(kind: str, number: int) -> _Element:
        if kind == "body":
            return bodies[number - 1]
        body = int(model.geom_bodyid[number])
        owners = [bodies[body - 1]] if body else tagged("worldbody")
        geoms = [geom for geom in tagged("geom") if elements[geom.owner] in owners]
        return geoms[number - int(model.body_geomadr[body])]

    edits = [(part(kind, i).at, "name", name) for (kind, i), name in names.items()]
    if np.any(moves.shift):
        root, shift = part("body", robot.root), moves.shift
        edits.append((root.at, "pos", _added(root.attributes.get("pos", "0 0 0"), shift)))
        # A key without qpos has the positions of the bodies.
        for key in tagged("key"):
            if old := key.attributes.get("qpos"):
                edits.append((key.at, "qpos", _added(old, shift, robot.free)))
    if np.any(moves.kick) and moves.key is not None:
        key = tagged("key")[moves.key]
        if old := key.attributes.get("qvel"):
            edits.append((key.at, "qvel", _added(old, moves.kick, robot.drift)))
    if pair is not None:
        edits.append((tagged("pair")[pair].at, "", ""))
    text, folders = _edited(source, edits), _folders(robot)
    return _before_end(text, [f"<compiler{_attributes(folders)}/>"]) if folders else text


def _edited(data: bytes, edits: Iterable[tuple[int, str, str]]) -> str:
    """Return a text with edits: the byte of an element, its attribute, and the new value.

    If the attribute is "", the whole element is deleted; such an element must have no content.
    """
    # Edit from the last element to the first, because an edit shifts the text after it.
    for at, attribute, new in sorted(edits, key=lambda edit: -edit[0]):
        data = data[:at] + _with_attribute(data[at:].decode(), attribute, new).encode()
    return data.decode()


def _with_attribute(text: str, name: str, new: str) -> str:
    """Return a text that begins with a start tag, with a new value of an attribute of that tag."""
    tag = _START_TAG.match(text)
    assert tag is not None
    if not name:
        return text[tag.end() :].partition(">")[2]
    for old in _ATTRIBUTE.finditer(tag.group()):
        if old[1] == name:
            return text[: old.start(2)] + quoteattr(new) + text[old.end(2) :]
    return f"{tag.group()} {name}={quoteattr(new)}{text[tag.end() :]}"


def _digits(numbers: Iterable[float]) -> str:
    """Return numbers as the value of an attribute."""
    return " ".join(f"{number:.12g}" for number in numbers)


def _added(numbers: str, shift: Array, places: slice = slice(3)) -> str:
    """Return the numbers of an attribute with a shift (3,) added at three places."""
    values = np.array(numbers.split(), float)
    values[places] += shift
    return _digits(values)


@dataclass(frozen=True)
class RobotScene(Scene):
    """The scene of a robot's file, with the file's model and the name of the keyframe."""

    robot_file: RobotFile | None = field(default=None, compare=False)
    key: str | None = None


@dataclass(frozen=True)
class RobotNumbers(Numbers):
    """The numbers of a robot's file, and their paths.

    source: the text of the file. table: the table of the scene file that names the robot. controls:
    values by the names of actuators, which replace the controls of the keyframe.
    """

    robot: RobotFile
    source: bytes
    table: RobotTable
    controls: Mapping[str, Rate]
    suffix: str = ".xml"

    @cached_property
    def known(self) -> dict[str, Number]:
        """The numbers by their paths. A unit is "" if it depends on the joint."""
        return dict(_numbers(self.source))

    def path_of(self, name: str) -> str:
        """Return the path for which a name stands. Raises InputError as `Numbers.path_of` does."""
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
        """Return the text with other numbers, and a keyframe "fitted" for the start of a scene."""
        text = self._changed(values)
        data = replace(self.robot, model=compiled(text)).start_as(start, self.table.keyframe)
        state = {"qpos": data.qpos, "qvel": data.qvel, "act": data.act, "ctrl": data.ctrl}
        key = "".join(f' {k}="{_digits(v)}"' for k, v in state.items() if len(v))
        return _before_end(text, [f'<keyframe><key name="fitted"{key}/></keyframe>'])

    def _changed(self, values: Mapping[str, float]) -> str:
        """Return the text with other numbers at some paths."""
        # A place is an element and an attribute; its numbers are in the order of the text.
        numbers: defaultdict[tuple[int, str], list[float]] = defaultdict(list)
        for path, (value, _, place) in self.known.items():
            numbers[place].append(values.get(path, value))
        changed = dict.fromkeys(self.known[path].place for path in values)
        return _edited(self.source, [(*place, _digits(numbers[place])) for place in changed])


def robot_numbers(path: Path) -> RobotNumbers:
    """Return the numbers of an MJCF or URDF file, or of the robot file that a scene file names.

    Raises InputError if it cannot be read, or no text compiles to the same robot.
    """
    table = RobotTable(robot=path.name)
    if path.suffix not in MODEL_FILES:
        table = msgspec.convert(msgspec.toml.decode(contents(path)), RobotTable)
    robot = open_robot(path.parent / table.robot, table.shell)
    source = editable(robot, _STILL, {}, ()).source.encode()
    return RobotNumbers(robot, source, table, controls_of(table, path.parent))


def _numbers(data: bytes) -> Iterator[tuple[str, Number]]:
    """Yield the numbers of an MJCF text with their paths.

    A path consists of the name of the body and the name or tag of the element.
    """
    seen, paths, taken = set[str](), [""], Counter[str]()
    for tag, at, owner, attributes in _elements_of(data):
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
    """Return the numbers of an attribute; an empty list if the attribute contains words."""
    try:
        return [*map(float, text.split())]
    except ValueError:
        return []
