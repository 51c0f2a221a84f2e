"""Read a body of a user's MJCF file or a link of a URDF file: mass, centre of mass and inertia.

MuJoCo compiles the MJCF file in a process of its own (mjcf_body.py), because a file of a few lines
may take any amount of time and memory. URDF is read here, as only the links' inertials count.
"""

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from robotball.errors import InputError, unknown
from robotball.files import contents, mjcf_body
from robotball.robot import Solid, composed
from robotball.rotations import Array

WAIT = 20.0  # s, of a process that may be starved of its few seconds


def solid_of_mjcf(path: Path, name: str) -> Solid:
    """The mass, centre and inertia of the body `name` of an MJCF file, in the body's own axes.

    Raises InputError where the file does not compile within a few seconds and a few hundred MB,
    has no such body, or the body carries others that move on it.
    """
    contents(path)  # to be refused, and read once more by MuJoCo, with the files beside it
    answer = _body_of(path, name)
    if "error" in answer:
        raise InputError(f"{path}: {answer['error']}")
    return Solid(answer["mass"], np.array(answer["centre"]), np.array(answer["inertia"]))


def _body_of(path: Path, name: str) -> dict[str, Any]:
    """What `mjcf_body` says of it, in a process of its own, or why that process has ended."""
    try:
        done = subprocess.run(
            [sys.executable, "-P", mjcf_body.__file__, str(path), name],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=WAIT,
        )
    except subprocess.TimeoutExpired:
        return {"error": f"it takes more than {WAIT:g} s to load"}
    if done.returncode == 0:
        answer: dict[str, Any] = json.loads(done.stdout)
        return answer
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return {"error": f"it takes more than {mjcf_body.SECONDS} s to load"}
    why = (done.stderr.decode(errors="replace").splitlines() or ["no word"])[-1]
    return {"error": f"it cannot be loaded with {mjcf_body.MEMORY / 1e6:.0f} MB of memory: {why}"}


def solid_of_urdf(path: Path, name: str) -> Solid:
    """The link `name` with all that fixed joints hold on it, in the link's own axes.

    Raises InputError where there is no such link, or others move on it, or it has no inertia.
    """
    data = contents(path)
    try:
        return _link(_robot(data), name)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _robot(data: bytes) -> Element:
    try:
        robot = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # LookupError: an encoding
        raise InputError(f"no XML: {error}") from None
    if robot.tag != "robot":
        raise InputError(f"no URDF: its root is <{robot.tag}>, not <robot>")
    return robot


def _link(robot: Element, name: str) -> Solid:
    links = {str(link.get("name")): link for link in robot.findall("link")}
    if name not in links:
        raise unknown("link", name, links)
    children: dict[str, list[Element]] = {}
    for joint in robot.findall("joint"):
        children.setdefault(_named(joint, "parent"), []).append(joint)
    solids: list[Solid] = []
    left: list[tuple[str, Array, Array]] = [(name, np.zeros(3), np.eye(3))]
    seen: set[str] = set()
    while left:
        each, origin, axes = left.pop()
        if each in seen:
            raise InputError(f"link {each!r} hangs on itself")
        if each not in links:
            raise unknown("link", each, links)
        seen.add(each)
        solids += [
            Solid(one.mass, origin + axes @ one.centre, axes @ one.inertia @ axes.T)
            for one in _own(links[each])
        ]
        for joint in children.get(each, []):
            if joint.get("type") != "fixed":
                raise InputError(
                    f"link {name!r} carries {_named(joint, 'child')!r}, which moves on it; take "
                    "each as a body of its own"
                )
            at, turn = _origin(joint)
            left.append((_named(joint, "child"), origin + axes @ at, axes @ turn))
    if not solids:
        raise InputError(f"link {name!r} has no inertial")
    return composed(solids)


def _own(link: Element) -> list[Solid]:
    """The link's own body, or none."""
    inertial = link.find("inertial")
    if inertial is None:
        return []
    what = f"link {link.get('name')!r}'s inertial"
    (mass,) = _numbers(inertial.find("mass"), "value", 1, what)
    tensor = inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (
        _numbers(tensor, key, 1, what)[0] for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    centre, axes = _origin(inertial)
    inertia = axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axes.T
    if not mass > 0:
        raise InputError(f"{what} has no mass: {mass:g} kg")
    return [Solid(mass, centre, inertia)]


def _named(joint: Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else str(element.get("link"))


def _origin(element: Element) -> tuple[Array, Array]:
    """The place (3,) and the axes (3, 3) of an element's origin."""
    origin = element.find("origin")
    if origin is None:
        return np.zeros(3), np.eye(3)
    what = f"the origin of <{element.tag}>"
    at = _numbers(origin, "xyz", 3, what) if origin.get("xyz") else [0.0] * 3
    turn = _numbers(origin, "rpy", 3, what) if origin.get("rpy") else [0.0] * 3
    return np.array(at), Rotation.from_euler("xyz", turn).as_matrix()


def _numbers(element: Element | None, key: str, count: int, what: str) -> list[float]:
    """The numbers of an attribute; InputError unless there are so many, all finite."""
    text = "" if element is None else element.get(key, "")
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not np.all(np.isfinite(numbers)):
        raise InputError(f"{what}: {key} takes {count} finite numbers, not {text!r}")
    return numbers
