"""Load a user's MJCF or URDF file by MuJoCo, first in a process of its own that is limited.

A file of a few lines may ask MuJoCo for any amount of time and memory, or end its process. So
another process loads it first, which runs this module as a script: PATH, and `parsed` or `compiled`
in, a text out where it is refused. That process needs little but MuJoCo, and starts soon.
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

from robotball.errors import InputError
from robotball.files import MODEL_FILES, contents

_WAIT = 60.0  # s, of a process that may be starved of its few seconds
_MEMORY = 500_000_000  # bytes, beyond what MuJoCo itself takes
_SECONDS = 5  # of processor time: a large robot takes a tenth of one
# MuJoCo reports memory that it does not get in two ways, of which the second has no better word.
_NO_MEMORY = ("Could not allocate memory", "unknown exception")
COMMENT = re.compile("<!--.*?-->", re.DOTALL)
_ATTRIBUTE = re.compile(r"""([\w.:-]+)\s*=\s*(["'])(.*?)\2""", re.DOTALL)
_INCLUDED = re.compile(r"""<include\s+file\s*=\s*["'](.*?)["']""")


_INSTEAD = {
    ".sdf": "; convert an SDF file to URDF or MJCF",
    ".xacro": "; expand it first: xacro {0} > robot.urdf",
    ".toml": "; `robotball compare {0}` runs a scene; `check` takes its robot's own file",
}


def check_format(path: Path) -> None:
    """Raise InputError unless the name of a robot's file ends as MJCF and URDF files do."""
    if path.suffix not in MODEL_FILES:
        instead = _INSTEAD.get(path.suffix, "")
        raise InputError(
            f"{path}: a scene is a TOML file, and a robot as it is an MJCF or URDF file, with a "
            f"name that ends in {' or '.join(MODEL_FILES)}{instead.format(path)}"
        )


def check_loads(path: Path, how: str = "compiled") -> None:
    """Raise InputError unless a file loads within a few seconds and a few hundred MB.

    how: `compiled`, or `parsed` alone.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise InputError(
            f"{path}: its name is no text in this locale: set LC_ALL=C.UTF-8, or rename it"
        ) from None
    contents(path)  # to be refused; it is read once more by MuJoCo, with the files beside it
    try:
        done = subprocess.run(
            # -P: a file of the user's folder cannot stand in for one of Python's own modules.
            [sys.executable, "-P", "-m", __name__, str(path), how],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_WAIT,
            env={**os.environ, "MUJOCO_GL": "disable"},  # nothing is drawn
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"{path}: it takes more than {_WAIT:g} s to load") from None
    # The system ends a process that used up its processor time.
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        raise InputError(f"{path}: it takes more than {_SECONDS} s to load")
    if done.returncode:
        # Any other end is by memory: MuJoCo's, or Python's own while it had none for a message.
        why = (done.stderr.decode(errors="replace").splitlines() or ["no word"])[-1]
        limit = f"{_MEMORY / 1e6:.0f} MB"
        raise InputError(f"{path}: it cannot be loaded with {limit} of memory: {why}")
    if refused := done.stdout.decode(errors="replace"):
        raise InputError(f"{path}: {refused}")


def opened_spec(path: Path) -> tuple[Any, list[str]]:
    """Return the MjSpec of a file without geoms and textures that have no file, and these files.

    Raises InputError where a body has its mass or contacts by such a geom.
    """
    import mujoco

    spec = mujoco.MjSpec.from_file(str(path))
    # A URDF's root has no joint: it would become a part of the world, without its mass.
    spec.compiler.fusestatic = False
    by_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    missing = []
    for mesh in list(spec.meshes):
        file = Path(mesh.file)
        place = path.parent / spec.meshdir / (file.name if spec.strippath else file)
        if not mesh.file or place.is_file():
            continue
        for geom in [each for each in spec.geoms if each.meshname == (mesh.name or file.stem)]:
            body = geom.parent
            weighs = geom.mass != 0 and (by_geoms or not body.explicitinertial)
            if weighs or geom.contype or geom.conaffinity:
                raise InputError(f"there is no {place}, by which {body.name} has mass or contacts")
            spec.delete(geom)
        spec.delete(mesh)
        missing.append(mesh.file)
    for texture in spec.textures:
        folder = path.parent / spec.texturedir
        files = [each for each in (texture.file, *texture.cubefiles) if each]
        if lost := [each for each in files if not (folder / each).is_file()]:
            texture.file, texture.cubefiles = "", [""] * len(texture.cubefiles)
            texture.builtin, texture.width, texture.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 1, 1
            missing.append(lost[0])
    return spec, missing


def _main() -> None:
    """Print why a file cannot be loaded, if it cannot."""
    import mujoco  # before the limit, which is on what a file takes beyond it

    path, how = Path(sys.argv[1]), sys.argv[2]
    _limit()
    try:
        # Before MuJoCo parses, which leaves a file MUJOCO_LOG.TXT behind where it meets a NaN.
        _check_numbers(path, path.parent, set())
        if how == "parsed":
            mujoco.MjSpec.from_file(str(path))
        else:
            opened_spec(path)[0].compile()
    except (ValueError, mujoco.FatalError, RuntimeError, MemoryError) as error:
        of_memory = isinstance(error, MemoryError) or any(w in str(error) for w in _NO_MEMORY)
        large = f"it takes more than {_MEMORY / 1e6:.0f} MB to load"
        print(large if of_memory else error)


def _limit() -> None:
    """Hold this process to _MEMORY and _SECONDS, where the system can."""
    with contextlib.suppress(OSError, ValueError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        taken = pages * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + _MEMORY, taken + _MEMORY))
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_CPU, (_SECONDS, _SECONDS))
        # A process that ends at a limit would else leave its memory in the user's folder.
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _check_numbers(path: Path, folder: Path, read: set[Path]) -> None:
    """Raise InputError for NaN or infinity in a file, or in one that it includes.

    folder: where includes are looked for, too; read: the files that are searched already. MuJoCo
    takes NaN for an attribute that is not given, and an infinite angle for none. A range may have
    no end. The text is searched, and not parsed, as MuJoCo reads more than well-formed XML.
    """
    read.add(path.resolve())
    text = COMMENT.sub("", path.read_text(errors="replace"))
    attributes = [(key, value) for key, _, value in _ATTRIBUTE.findall(text)]
    names = {value for key, value in attributes if key in ("name", "class")}
    # A body may be called `inf`, and what refers to it has that value as well.
    for key, value in attributes:
        if value not in names and not key.endswith("range") and not _finite(value):
            raise InputError(f"{path.name}: {key} takes finite numbers, not {value!r}")
    for file in _INCLUDED.findall(text):
        # MuJoCo looks beside the file that includes another, and beside the first of them.
        for each in {path.parent / file, folder / file}:
            if each.is_file() and each.resolve() not in read:
                _check_numbers(each, folder, read)


def _finite(text: str) -> bool:
    """Return whether no number of a text is NaN or infinite; words are no numbers."""
    try:
        return all(map(math.isfinite, map(float, text.split())))
    except ValueError:
        return True


if __name__ == "__main__":
    _main()
