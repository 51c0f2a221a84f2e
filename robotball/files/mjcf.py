"""MJCF files: our own parts, and a user's body."""

import json
import signal
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from robotball.errors import InputError
from robotball.files import mjcf_body
from robotball.files.reading import contents
from robotball.looks import PARTS
from robotball.parts import Solid

with warnings.catch_warnings(action="ignore"):
    # Without a screen, dm_control's search for a window system warns; nothing here needs one.
    from dm_control import mjcf

PRECISION = 17  # digits that bring every double back
WAIT = 20.0  # s, of a process that may be starved of its few seconds


def part(name: str) -> Any:
    """The hand-written part mjcf/`name`.xml as it is, in units of the ball's radius."""
    return mjcf.from_path(str(PARTS / f"{name}.xml"))


def text_of(root: Any) -> str:
    """The MJCF text of a composed tree of parts without classes, under names of one word.

    dm_control scopes names by `/`, as in shell/frame/rotor1/hinge, and itself reads no file that
    has them. Parts have different names, so the last of them and the element's own say enough:
    rotor1, rotor1_hinge.
    """
    tree = ElementTree.fromstring(root.to_xml_string(precision=PRECISION))
    for element in tree.iter():
        element.attrib.pop("class", None)
        for attribute, value in element.items():
            if "/" in value:
                element.set(attribute, "_".join(filter(None, value.split("/")[-2:])))
    for empty in tree.findall("default"):
        tree.remove(empty)
    ElementTree.indent(tree)
    return ElementTree.tostring(tree, encoding="unicode") + "\n"


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
