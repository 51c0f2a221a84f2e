"""A body of an MJCF file that somebody else wrote, compiled in a process of its own.

Run as a script: PATH and NAME in, JSON out. A file of a few lines may ask MuJoCo for any amount of
time and memory, or end its process, so this one is limited.
"""

import contextlib
import difflib
import json
import math
import re
import resource
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

MEMORY = 500_000_000  # bytes, beyond what MuJoCo itself takes
SECONDS = 5  # of processor time
NO_MEMORY = ("Could not allocate memory", "unknown exception")  # MuJoCo's words for that
FEW = 10  # names that a message holds
COMMENT = re.compile("<!--.*?-->", re.DOTALL)
ATTRIBUTE = re.compile(r"""([\w.:-]+)\s*=\s*(["'])(.*?)\2""", re.DOTALL)
INCLUDED = re.compile(r"""<include\s+file\s*=\s*["'](.*?)["']""")


def main() -> None:
    """Print what `body` gives, or {"error": …}."""
    _, path, name = sys.argv
    _limit()
    try:
        answer = body(path, name)
    except (ValueError, mujoco.FatalError, RuntimeError, MemoryError) as error:
        of_memory = isinstance(error, MemoryError) or any(w in str(error) for w in NO_MEMORY)
        large = f"it takes more than {MEMORY / 1e6:.0f} MB to load"
        answer = {"error": large if of_memory else str(error)}
    print(json.dumps(answer))


def body(path: str, name: str) -> dict[str, Any]:
    """mass, centre (3,) and inertia (3, 3) of a body with all that is fixed to it, in its axes.

    Raises ValueError where the file does not compile, has a number that is none, has no such body,
    or the body carries others that move on it.
    """
    model = mujoco.MjModel.from_xml_path(path)
    _check_numbers(Path(path), Path(path).parent)
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    if number < 0:
        names = [model.body(i).name for i in range(1, model.nbody)]
        near = difflib.get_close_matches(name, names, n=FEW) or names[:FEW]
        raise ValueError(f"no body is called {name!r}; there are {len(names)}, as {near}")
    fixed = [i for i in range(model.nbody) if model.body_weldid[i] == model.body_weldid[number]]
    below = [i for i in range(number, model.nbody) if _is_below(model, i, number)]
    if not set(below) <= set(fixed):
        raise ValueError(f"body {name!r} carries bodies that move on it")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    to_body, origin = data.xmat[number].reshape(3, 3).T, data.xpos[number]
    masses = model.body_mass[below]
    if not masses.sum() > 0:
        raise ValueError(f"body {name!r} has no mass")
    centres = (data.xipos[below] - origin) @ to_body.T
    centre = masses @ centres / masses.sum()
    inertia = np.zeros((3, 3))
    for i, mass, r in zip(below, masses, centres - centre, strict=True):
        axes = to_body @ data.ximat[i].reshape(3, 3)
        inertia += axes @ np.diag(model.body_inertia[i]) @ axes.T
        inertia += mass * (r @ r * np.eye(3) - np.outer(r, r))
    return {"mass": float(masses.sum()), "centre": centre.tolist(), "inertia": inertia.tolist()}


def _check_numbers(path: Path, folder: Path) -> None:
    """Raise ValueError for NaN or infinity in a file or one that it includes, also from a folder.

    MuJoCo takes NaN for an attribute that is not given, and an infinite angle for none. A range may
    have no end. The text is searched, as MuJoCo reads more than well-formed XML.
    """
    text = COMMENT.sub("", path.read_text(errors="replace"))
    attributes = [(key, value) for key, _, value in ATTRIBUTE.findall(text)]
    names = {value for key, value in attributes if key in ("name", "class")}
    for key, value in attributes:
        if value not in names and not key.endswith("range") and not _finite(value):
            raise ValueError(f"{path.name}: {key} takes finite numbers, not {value!r}")
    for file in INCLUDED.findall(text):
        for each in {path.parent / file, folder / file}:
            if each.is_file():
                _check_numbers(each, folder)


def _finite(text: str) -> bool:
    """Whether no number of a text is NaN or infinite; words are no numbers."""
    try:
        return all(map(math.isfinite, map(float, text.split())))
    except ValueError:
        return True


def _is_below(model: mujoco.MjModel, body: int, ancestor: int) -> bool:
    while body > ancestor:
        body = model.body_parentid[body]
    return body == ancestor


def _limit() -> None:
    """Hold this process to MEMORY and SECONDS, where the system can."""
    with contextlib.suppress(OSError, ValueError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        taken = pages * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY, taken + MEMORY))
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


if __name__ == "__main__":
    main()
