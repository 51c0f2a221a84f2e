"""Load a user's MJCF or URDF file with MuJoCo, first in a separate process with limits.

A short file can make MuJoCo take any amount of time and memory, or crash. So another process loads
the file first. That process executes this module as a script with the arguments PATH and `parsed`
or `compiled`, and prints the reason if it refuses the file.
"""

import contextlib
import math
import os
import re
import resource
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from robotball.errors import InputError
from robotball.files import MODEL_FILES, contents
from robotball.rotations import symmetric

_WAIT = 60.0  # s of real time, on a busy machine
_MEMORY = 500_000_000  # bytes, in addition to what MuJoCo itself needs
_SECONDS = 5  # of processor time; a large robot takes 0.1 s
# Texts with which MuJoCo reports that memory ran out.
_NO_MEMORY = ("Could not allocate memory", "unknown exception")
_MISSING = "{} is missing; left out, because it is only for drawing"
_ROUNDING = 1e-6  # relative, of moments in a file
COMMENT = re.compile("<!--.*?-->", re.DOTALL)
_ATTRIBUTE = re.compile(r"""([\w.:-]+)\s*=\s*(["'])(.*?)\2""", re.DOTALL)
_INCLUDED = re.compile(r"""<include\s+file\s*=\s*["'](.*?)["']""")
# Texts with which MuJoCo reports a file that is not XML, or not MJCF.
_NOT_XML = re.compile(r"(?s)=XML_ERROR_(\w+).*?number=(\d+)(?:: XMLElement name=(\S+))?")
_SCHEMA = re.compile(r"XML Error: (?:Schema violation: )?(.*)\nElement '(.*)', line (\d+)")
_COMPILER = re.compile(r"Error: (.*)\nElement name '(.*)', id \d+(?:, line (\d+))?")
# Faults as MuJoCo's compiler names them, each with a plain text that includes a remedy.
_REMEDIES = {
    "mass and inertia of moving bodies must be larger than mjMINVAL":
        "a body that moves needs a mass and an inertia: give it a geom or an <inertial>",
}  # fmt: skip
_FAULTS = {
    "MISMATCHED_ELEMENT": "{} is not closed, or is closed by another tag",
    "PARSING_ATTRIBUTE": "an attribute of {} is given twice, or its value has no quotes",
    "PARSING": "{} is not closed at the end of the file",
    "PARSING_TEXT": "there is text outside of the elements",
}
_INSTEAD = {
    ".sdf": "; convert an SDF file to URDF or MJCF",
    ".xacro": "; expand it first: xacro {0} > robot.urdf",
    ".toml": "; `robotball compare {0}` runs a scene; `check` takes its robot's own file",
}


def check_format(path: Path) -> None:
    """Raise InputError unless the suffix belongs to an MJCF or URDF file."""
    if path.suffix not in MODEL_FILES:
        instead = _INSTEAD.get(path.suffix, "")
        suffixes = f"{' or '.join(MODEL_FILES)}{instead.format(path)}"
        raise InputError(f"{path}: a scene is a TOML, MJCF or URDF file, named .toml or {suffixes}")


def check_loads(path: Path, how: str = "compiled") -> None:
    """Raise InputError unless a file loads within a few seconds and a few hundred MB.

    how: `compiled`, or `parsed` to parse the file without compiling it.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        line = "this locale cannot represent the name: set LC_ALL=C.UTF-8, or rename the file"
        raise InputError(f"{path}: {line}") from None
    contents(path)  # raises InputError if the file cannot be read
    try:
        done = subprocess.run(
            # -P, so that no file in the user's folder can replace a module of Python.
            [sys.executable, "-P", "-m", __name__, str(path), how],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_WAIT,
            env={**os.environ, "MUJOCO_GL": "disable"},  # nothing is drawn
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"{path}: it takes more than {_WAIT:g} s to load") from None
    # The system kills a process at its limit of processor time.
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        raise InputError(f"{path}: it takes more than {_SECONDS} s to load")
    if done.returncode:
        # The cause of any other error is a lack of memory, in MuJoCo or in Python.
        why = (done.stderr.decode(errors="replace").splitlines() or ["no message"])[-1]
        limit = f"{_MEMORY / 1e6:.0f} MB"
        raise InputError(f"{path}: it cannot be loaded with {limit} of memory: {why}")
    if refused := done.stdout.decode(errors="replace"):
        raise InputError(f"{path}: {refused}")


def opened_spec(path: Path) -> tuple[Any, list[str]]:
    """Return the MjSpec of a file without its missing meshes and textures, and notes on changes.

    Raises InputError if a body has an impossible inertia, or mass or contacts from a missing mesh.
    """
    import mujoco

    spec = mujoco.MjSpec.from_file(str(path))
    # Otherwise the mass of a URDF's root, which has no joint, would be merged into the world.
    spec.compiler.fusestatic = False
    by_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    notes = list[str]()
    for body in [] if by_geoms else spec.bodies[1:]:
        full = symmetric(*body.fullinertia)
        moments = np.sort(body.inertia if np.isnan(full[0, 0]) else np.linalg.eigvalsh(full))
        if body.explicitinertial and moments[:2].sum() < moments[2] * (1 - _ROUNDING):
            words = "impossible inertia: {2:g} exceeds {1:g} + {0:g}".format(*moments)
            if not spec.compiler.balanceinertia:
                message = ": ".join(filter(None, (body.info, body.name, words)))
                raise InputError(f"{message}; a solid ball has 2/5 m r²")
            line = f"balanceinertia replaces the impossible inertia with {moments.mean():g} kg m²"
            notes.append(f"{body.name}: {line} about each axis")
    for mesh in list(spec.meshes):
        file = Path(mesh.file)
        place = path.parent / spec.meshdir / (file.name if spec.strippath else file)
        if not mesh.file or place.is_file():
            continue
        for geom in [it for it in spec.geoms if it.meshname == (mesh.name or file.stem)]:
            body = geom.parent
            weighs = geom.mass != 0 and (by_geoms or not body.explicitinertial)
            if weighs or geom.contype or geom.conaffinity:
                raise InputError(f"{place} is missing, but gives {body.name} its mass or contacts")
            spec.delete(geom)
        spec.delete(mesh)
        notes.append(_MISSING.format(mesh.file))
    for texture in spec.textures:
        folder = path.parent / spec.texturedir
        files = filter(None, (texture.file, *texture.cubefiles))
        if lost := [file for file in files if not (folder / file).is_file()]:
            texture.file, texture.cubefiles = "", [""] * len(texture.cubefiles)
            texture.builtin, texture.width, texture.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 1, 1
            notes.append(_MISSING.format(lost[0]))
    return spec, notes


def _main() -> None:
    """Print the reason if a file cannot be loaded."""
    import mujoco  # before the limit is set, because the limit is for the file alone

    path, how = Path(sys.argv[1]), sys.argv[2]
    _limit()
    try:
        # Check this first, because MuJoCo writes a file MUJOCO_LOG.TXT when it parses a NaN.
        _check_numbers(path, path.parent, set())
        if how == "parsed":
            mujoco.MjSpec.from_file(str(path))
        else:
            opened_spec(path)[0].compile()
    except (ValueError, mujoco.FatalError, RuntimeError, MemoryError) as error:
        no_memory = any(phrase in str(error) for phrase in _NO_MEMORY)
        large = f"it takes more than {_MEMORY / 1e6:.0f} MB to load"
        print(large if no_memory or isinstance(error, MemoryError) else in_words(str(error)))


def in_words(error: str) -> str:
    """Return an error of MuJoCo as a plain text that begins with the line and the element."""
    if found := _NOT_XML.search(error):
        fault, line, tag = found.groups()
        words = _FAULTS.get(fault, "it is not XML near {}")
        return f"line {line}: " + words.format(f"<{tag}>" if tag else "an element")
    if found := _COMPILER.search(error):
        fault, name, line = found.groups()
        place = [f"line {line}"] * bool(line) + [name] * bool(name)
        return ": ".join([*place, _REMEDIES.get(fault, fault)])
    return _SCHEMA.sub(r"line \3: <\2>: \1", error)


def _limit() -> None:
    """Limit this process to `_MEMORY` and `_SECONDS`, if the system can."""
    with contextlib.suppress(OSError, ValueError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        taken = pages * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + _MEMORY, taken + _MEMORY))
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_CPU, (_SECONDS, _SECONDS))
        # No core file in the user's folder when the process ends at a limit.
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _check_numbers(path: Path, folder: Path, read: set[Path]) -> None:
    """Raise InputError for NaN or infinity in a file or its includes; a range may be infinite.

    MuJoCo would ignore an attribute that is NaN. The text is searched and not parsed, because
    MuJoCo also reads XML that is not well-formed. folder: of the first file. read: the files that
    are already checked.
    """
    read.add(path.resolve())
    text = COMMENT.sub("", path.read_text(errors="replace"))
    attributes = [(key, value) for key, _, value in _ATTRIBUTE.findall(text)]
    names = {value for key, value in attributes if key in ("name", "class")}
    # A body may be named `inf`, and other elements may refer to this name.
    for key, value in attributes:
        if value not in names and not key.endswith("range") and not _finite(value):
            raise InputError(f"{path.name}: {key} takes finite numbers, not {value!r}")
    for file in _INCLUDED.findall(text):
        # MuJoCo looks for an included file in the folders of the including file and the first file.
        for place in {path.parent / file, folder / file}:
            if place.is_file() and place.resolve() not in read:
                _check_numbers(place, folder, read)


def _finite(text: str) -> bool:
    """Return whether all numbers of a text are finite. True for a text that contains words."""
    try:
        return all(map(math.isfinite, map(float, text.split())))
    except ValueError:
        return True


if __name__ == "__main__":
    _main()
