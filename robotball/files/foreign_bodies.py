"""Read a body of a user's MJCF file or a link of a URDF file: mass, centre of mass and inertia.

Whether a whole file loads is asked here as well, by `check_loads`.

MuJoCo reads the file in a process of its own, which runs this module as a script: KIND, PATH and
NAME in, JSON out. A file of a few lines may ask MuJoCo for any amount of time and memory, or end
its process, so that process is limited. An MJCF file is compiled, because its masses may follow
from geoms. A URDF file is parsed only: its links have their inertials, compiling it would need the
meshes that it names, and would refuse it for a link that nobody asked for.
"""

import contextlib
import json
import math
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from robotball.errors import InputError, unknown
from robotball.files import contents
from robotball.robot import Solid, composed
from robotball.rotations import Array, rotation_matrix

_WAIT = 20.0  # s, of a process that may be starved of its few seconds
_MEMORY = 500_000_000  # bytes, beyond what MuJoCo itself takes
_SECONDS = 5  # of processor time: a large robot takes a tenth of one
# MuJoCo reports memory that it does not get in two ways, of which the second has no better word.
_NO_MEMORY = ("Could not allocate memory", "unknown exception")
_COMMENT = re.compile("<!--.*?-->", re.DOTALL)
_ATTRIBUTE = re.compile(r"""([\w.:-]+)\s*=\s*(["'])(.*?)\2""", re.DOTALL)
_INCLUDED = re.compile(r"""<include\s+file\s*=\s*["'](.*?)["']""")


def solid_of_mjcf(path: Path, name: str) -> Solid:
    """Return the body `name` of an MJCF file with all that is fixed to it, in the body's own axes.

    Raises InputError where the file does not compile within a few seconds and a few hundred MB,
    has no such body, or the body carries others that move on it.
    """
    return _solid("body", path, name)


def solid_of_urdf(path: Path, name: str) -> Solid:
    """Return the link `name` with all that fixed joints hold on it, in the link's own axes.

    Raises InputError where there is no such link, or others move on it, or it has no inertia.
    """
    return _solid("link", path, name)


def check_loads(path: Path) -> None:
    """Raise InputError unless MuJoCo compiles a file within a few seconds and a few hundred MB."""
    contents(path)  # to be refused, as in `_solid`
    answer = _asked("model", path, "")
    if "error" in answer:
        raise InputError(f"{path}: {answer['error']}")


def drop_missing_looks(spec: Any, folder: Path) -> Iterator[str]:
    """Delete geoms of an MjSpec whose mesh has no file, where they are only drawn; yield the files.

    folder: of the spec's own file. Raises InputError where a body has its mass or contacts by one.
    """
    import mujoco

    by_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    for mesh in list(spec.meshes):
        file = Path(mesh.file)
        place = folder / spec.meshdir / (file.name if spec.strippath else file)
        if not mesh.file or place.is_file():
            continue
        for geom in [each for each in spec.geoms if each.meshname == (mesh.name or file.stem)]:
            body = geom.parent
            weighs = geom.mass != 0 and (by_geoms or not body.explicitinertial)
            if weighs or geom.contype or geom.conaffinity:
                raise InputError(f"there is no {place}, by which {body.name} has mass or contacts")
            spec.delete(geom)
        spec.delete(mesh)
        yield mesh.file


def _solid(kind: str, path: Path, name: str) -> Solid:
    contents(path)  # to be refused, and read once more by MuJoCo, with the files beside it
    answer = _asked(kind, path, name)
    if "error" in answer:
        raise InputError(f"{path}: {answer['error']}")
    return Solid(answer["mass"], np.array(answer["centre"]), np.array(answer["inertia"]))


def _asked(kind: str, path: Path, name: str) -> dict[str, Any]:
    """Return the answer of a process of its own, or why that process has ended."""
    try:
        done = subprocess.run(
            # -P: a file of the user's folder cannot stand in for one of Python's own modules.
            [sys.executable, "-P", "-m", __name__, kind, str(path), name],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_WAIT,
        )
    except subprocess.TimeoutExpired:
        return {"error": f"it takes more than {_WAIT:g} s to load"}
    if done.returncode == 0:
        answer: dict[str, Any] = json.loads(done.stdout)
        return answer
    # The system ends a process that used up its processor time.
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return {"error": f"it takes more than {_SECONDS} s to load"}
    # Any other end is by memory: MuJoCo's, or Python's own while it had none for a message.
    why = (done.stderr.decode(errors="replace").splitlines() or ["no word"])[-1]
    return {"error": f"it cannot be loaded with {_MEMORY / 1e6:.0f} MB of memory: {why}"}


def _main() -> None:
    """Print the mass, centre and inertia of a body, or {"error": …}."""
    import mujoco  # before the limit, which is on what a file takes beyond it

    _, kind, path, name = sys.argv
    _limit()
    try:
        # Before MuJoCo parses, which leaves a file MUJOCO_LOG.TXT behind where it meets a NaN.
        _check_numbers(Path(path), Path(path).parent, set())
        if kind == "model":
            spec = mujoco.MjSpec.from_file(path)
            list(drop_missing_looks(spec, Path(path).parent))
            spec.compile()
            answer: dict[str, Any] = {}
        else:
            solid = _of_mjcf(path, name) if kind == "body" else _of_urdf(path, name)
            answer = {
                "mass": solid.mass,
                "centre": solid.centre.tolist(),
                "inertia": solid.inertia.tolist(),
            }
    except (ValueError, mujoco.FatalError, RuntimeError, MemoryError) as error:
        of_memory = isinstance(error, MemoryError) or any(w in str(error) for w in _NO_MEMORY)
        large = f"it takes more than {_MEMORY / 1e6:.0f} MB to load"
        answer = {"error": large if of_memory else str(error)}
    print(json.dumps(answer))


def _limit() -> None:
    """Hold this process to MEMORY and SECONDS, where the system can."""
    with contextlib.suppress(OSError, ValueError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        taken = pages * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + _MEMORY, taken + _MEMORY))
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_CPU, (_SECONDS, _SECONDS))
        # A process that ends at a limit would else leave its memory in the user's folder.
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _check_numbers(path: Path, folder: Path, read: set[Path]) -> None:
    """Raise InputError for NaN or infinity in a file or one that it includes, also from a folder.

    MuJoCo takes NaN for an attribute that is not given, and an infinite angle for none. A range may
    have no end. The text is searched, as MuJoCo reads more than well-formed XML; each file once.
    """
    read.add(path.resolve())
    text = _COMMENT.sub("", path.read_text(errors="replace"))
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


def _of_mjcf(path: str, name: str) -> Solid:
    import mujoco

    model = mujoco.MjModel.from_xml_path(path)
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    if number < 0:
        raise unknown("body", name, [model.body(i).name for i in range(1, model.nbody)])
    below = [number]
    for i in range(number + 1, model.nbody):  # a body has a higher number than its parent
        if model.body_parentid[i] in below:
            if model.body_weldid[i] != model.body_weldid[number]:
                raise _moves("body", name, model.body(i).name)
            below.append(i)
    # The pose of all bodies at the model's reference, to bring what is fixed into one body's axes.
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    to_body, origin = data.xmat[number].reshape(3, 3).T, data.xpos[number]
    solids = []
    for i in below:
        axes = to_body @ data.ximat[i].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[i]) @ axes.T
        solids.append(Solid(float(model.body_mass[i]), to_body @ (data.xipos[i] - origin), inertia))
    if not sum(solid.mass for solid in solids) > 0:
        raise InputError(f"body {name!r} has no mass")
    return composed(solids)


def _moves(kind: str, name: str, other: str) -> InputError:
    return InputError(
        f"{kind} {name!r} carries {other!r}, which moves on it; take each as a body of its own"
    )


def _of_urdf(path: str, name: str) -> Solid:
    import mujoco

    root = re.search(r"<(\w+)", _COMMENT.sub("", Path(path).read_text(errors="replace")))
    if root and root[1] != "robot":  # MuJoCo would read its own format as well
        raise InputError(f"no URDF: its root is <{root[1]}>, not <robot>")
    spec = mujoco.MjSpec.from_file(path)
    link = spec.body(name)
    if link is None:
        raise unknown("link", name, [each.name for each in spec.bodies[1:]])
    solids = list(_inertials(link, name, np.zeros(3), np.eye(3)))
    if not solids:
        raise InputError(f"link {name!r} has no inertial")
    return composed(solids)


def _inertials(link: Any, name: str, origin: Array, axes: Array) -> Iterator[Solid]:
    """Yield the inertials of a link at a place, in axes (3, 3), and of what is fixed to it."""
    if link.explicitinertial:
        if not link.mass > 0:
            raise InputError(f"link {link.name!r}'s inertial has no mass: {link.mass:g} kg")
        turned = axes @ rotation_matrix(link.iquat)
        xx, yy, zz, xy, xz, yz = link.fullinertia
        inertia = turned @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turned.T
        yield Solid(link.mass, origin + axes @ link.ipos, inertia)
    for child in link.bodies:
        if child.joints:
            raise _moves("link", name, child.name)
        turned = axes @ rotation_matrix(child.quat)
        yield from _inertials(child, name, origin + axes @ child.pos, turned)


if __name__ == "__main__":
    _main()
