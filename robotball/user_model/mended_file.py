"""Changes to a user's robot file, as text: what is added at its end, with a comment beside each.

MuJoCo merges sections that stand twice, and of an option that is given twice takes the last. So
nothing of the file has to go, and all stands in one block at its end; only names that the block
needs, and a start that is moved, are written where they belong. A file that cannot be changed in
this way (a URDF, one with includes or copies) is first written by MuJoCo itself.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple
from xml.parsers.expat import ExpatError, ParserCreate, XMLParserType
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from robotball.errors import InputError
from robotball.rotations import Array
from robotball.user_model.robot_file import RobotFile, body_name, unused_name

# A start tag with its attributes, and one of these with its quoted value.
_START_TAG = re.compile(r"<[^\s/>]+(\s+[^\s=]+\s*=\s*(\"[^\"]*\"|'[^']*'))*")
_ATTRIBUTE = re.compile(r"\s([^\s=]+)\s*=\s*(\"[^\"]*\"|'[^']*')")
_Names = Mapping[tuple[str, int], str]  # of geoms and bodies, by their numbers


@dataclass(frozen=True)
class Change:
    """A change to a file, by the MJCF attributes that it sets.

    words: what is wrong without it; option, pair: attributes of these elements, where the pair is
    that of sphere and plane; exclude: bodies (a, b) that pass through one another; start:
    whether the robot is set down on the plane.
    """

    name: str
    words: str
    option: Mapping[str, str] = field(default_factory=dict)
    pair: Mapping[str, str] = field(default_factory=dict)
    exclude: tuple[tuple[str, str], ...] = ()
    start: bool = False


@dataclass(frozen=True)
class Editable:
    """The text of a robot's file, in which sphere and plane have names.

    source: the text as it was; moved: text, with the robot set down on the plane; pair: the
    attributes of their contact as the file has it; paired: whether the file has a pair of the two,
    which is taken out of text.
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
        text = self.moved if any(each.start for each in changes) else self.text
        if not changes and not self.paired:
            return text
        return before_end(text, self._block(changes))

    def _block(self, changes: Iterable[Change]) -> Iterator[str]:
        pair = dict(self.pair)
        contact = []
        for change in changes:
            if change.option or change.start:
                yield _comment(change)
            if change.option:
                yield f"<option{_attributes(change.option)}/>"
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


def before_end(text: str, lines: Iterable[str]) -> str:
    """Return a text of a file with lines before the end tag of its root."""
    data, ends = text.encode(), [0]
    parser = _parser()
    parser.EndElementHandler = lambda _: ends.append(parser.CurrentByteIndex)
    parser.Parse(data, True)
    own, rest = data[: ends[-1]].decode().rstrip(" "), data[ends[-1] :].decode()
    broken = "" if own.endswith("\n") else "\n"
    return own + broken + "".join(f"  {line}\n" for line in lines) + rest


def _parser() -> XMLParserType:
    # MuJoCo reads every file as UTF-8, whatever encoding the file declares.
    return ParserCreate("utf-8")


def in_comment(words: str) -> str:
    """Return words for an XML comment, which must not contain two hyphens in a row."""
    return re.sub("-(?=-)", "- ", words)


def _comment(change: Change) -> str:
    return f"<!-- {change.name}: {in_comment(change.words)} -->"


def _attributes(values: Mapping[str, str]) -> str:
    return "".join(f" {name}={quoteattr(value)}" for name, value in values.items())


def compiled(text: str) -> mujoco.MjModel:
    """Return the model of a file's text. Raises InputError where MuJoCo refuses it."""
    try:
        return mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise InputError(f"the changed file does not compile: {error}") from None


@dataclass(frozen=True)
class Moves:
    """How the start of a file is changed.

    shift (3,): m, world, of the robot in all starts; kick (3,): m/s, world, of the robot at the
    keyframe with the number `key`.
    """

    shift: Array
    kick: Array
    key: int | None


STILL = Moves(np.zeros(3), np.zeros(3), None)


def editable(
    robot: RobotFile, moves: Moves, pair: Mapping[str, str], bodies: Iterable[int]
) -> Editable:
    """Return the text of a robot's file, ready for changes.

    moves: by which the robot is set down on the plane, and rolls; pair: the attributes of the
    contact of sphere and plane as the file has it; bodies: those that changes name. Raises
    InputError where no text has the same robot.
    """
    model = robot.model
    usual = {
        ("geom", robot.sphere): unused_name(model, "geom", "rolling_sphere"),
        ("geom", robot.plane): unused_name(model, "geom", "plane"),
        **{("body", i): body_name(model, i) for i in bodies},
    }
    own = {(kind, i): getattr(model, kind)(i).name for kind, i in usual}
    new = {each: name for each, name in usual.items() if not own[each]}
    named, ours = own | new, {robot.sphere, robot.plane}
    pairs = zip(model.pair_geom1, model.pair_geom2, strict=True)
    own_pair = next((i for i, each in enumerate(pairs) if {*map(int, each)} == ours), None)
    sphere, plane = (named["geom", i] for i in (robot.sphere, robot.plane))
    # The author's own text, or else the file as MuJoCo writes it.
    for read in (robot.path.read_bytes, lambda: robot.spec.to_xml().encode()):
        try:
            source = read()
            text, moved = (_prepared(source, robot, by, new, own_pair) for by in (STILL, moves))
            if _is_same(robot, named, text, STILL) and _is_same(robot, named, moved, moves):
                whole = _prepared(source, robot, STILL, {}, None)
                return Editable(whole, text, moved, sphere, plane, pair, own_pair is not None)
        except (InputError, ExpatError, IndexError, UnicodeDecodeError):
            continue
    raise InputError(f"{robot.path} cannot be mended: written again, it is another robot")


def _is_same(robot: RobotFile, names: _Names, text: str, moves: Moves) -> bool:
    """Return whether a text is the robot's model, moved, with such names."""
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
        and all(np.allclose(old[at] + moves.shift, new[at], atol=1e-6) for old, new in starts)
        and np.allclose(model.key_qvel + kicks, other.key_qvel, atol=1e-6)
    )


def _folders(robot: RobotFile) -> dict[str, str]:
    """Return the compiler's folders of a file with meshes or pictures, for a text anywhere."""
    model, spec, here = robot.model, robot.spec, robot.path.parent.absolute()
    if not (model.nmesh or model.ntex or model.nhfield or model.nskin):
        return {}
    return {"meshdir": str(here / spec.meshdir), "texturedir": str(here / spec.texturedir)}


class Element(NamedTuple):
    """A start tag: at which byte it stands, and the number of the element that owns it.

    The owner is the nearest body, worldbody or default around it; -1 where there is none.
    """

    tag: str
    at: int
    owner: int
    attributes: Mapping[str, str]


def elements_of(data: bytes) -> list[Element]:
    """Return the elements of an MJCF text, in its order."""
    found: list[Element] = []
    owners = [-1]
    parser = _parser()

    def begin(tag: str, attributes: Mapping[str, str]) -> None:
        found.append(Element(tag, parser.CurrentByteIndex, owners[-1], attributes))
        owns = tag in ("body", "worldbody", "default")
        owners.append(len(found) - 1 if owns else owners[-1])

    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda _: owners.pop()
    parser.Parse(data, True)
    return found


def _prepared(
    source: bytes, robot: RobotFile, moves: Moves, names: _Names, pair: int | None
) -> str:
    """Return a text of a robot's file, with names and without a pair, moved."""
    model, elements = robot.model, elements_of(source)

    def tagged(tag: str) -> list[Element]:
        return [each for each in elements if each.tag == tag]

    bodies = [each for each in tagged("body") if each.owner >= 0]

    def element(kind: str, number: int) -> Element:
        if kind == "body":
            return bodies[number - 1]
        body = int(model.geom_bodyid[number])
        owners = [bodies[body - 1]] if body else tagged("worldbody")
        own = [each for each in tagged("geom") if elements[each.owner] in owners]
        return own[number - int(model.body_geomadr[body])]

    edits = [(element(kind, i).at, "name", name) for (kind, i), name in names.items()]
    if np.any(moves.shift):
        root, shift = element("body", robot.root), moves.shift
        edits.append((root.at, "pos", _added(root.attributes.get("pos", "0 0 0"), shift)))
        # A key without qpos has that of the bodies.
        for key in tagged("key"):
            if old := key.attributes.get("qpos"):
                edits.append((key.at, "qpos", _added(old, shift, robot.free)))
    if np.any(moves.kick) and moves.key is not None:
        key = tagged("key")[moves.key]
        if old := key.attributes.get("qvel"):
            edits.append((key.at, "qvel", _added(old, moves.kick, robot.drift)))
    if pair is not None:
        edits.append((tagged("pair")[pair].at, "", ""))
    text, folders = edited(source, edits), _folders(robot)
    return before_end(text, [f"<compiler{_attributes(folders)}/>"]) if folders else text


def edited(data: bytes, edits: Iterable[tuple[int, str, str]]) -> str:
    """Return a text with edits: the byte of an element, an attribute of it, and its new value.

    Without a name of an attribute the whole element goes, which has no content.
    """
    # From the last to the first, as an edit moves what follows it.
    for at, attribute, new in sorted(edits, key=lambda each: -each[0]):
        data = data[:at] + _with_attribute(data[at:].decode(), attribute, new).encode()
    return data.decode()


def _with_attribute(text: str, name: str, new: str) -> str:
    """Return a text that begins with a start tag, whose attribute gets a new value."""
    tag = _START_TAG.match(text)
    assert tag is not None
    if not name:
        return text[tag.end() :].partition(">")[2]
    for old in _ATTRIBUTE.finditer(tag.group()):
        if old[1] == name:
            return text[: old.start(2)] + quoteattr(new) + text[old.end(2) :]
    return f"{tag.group()} {name}={quoteattr(new)}{text[tag.end() :]}"


def digits(numbers: Iterable[float]) -> str:
    """Return numbers as the value of an attribute."""
    return " ".join(f"{each:.12g}" for each in numbers)


def _added(numbers: str, shift: Array, places: slice = slice(3)) -> str:
    return digits(_shifted(numbers.split(), shift, places))


def _shifted(numbers: Iterable[str | float], shift: Array, places: slice) -> Array:
    """Return numbers with a shift (3,) added at three places."""
    values = np.array([*numbers], float)
    values[places] += shift
    return values
