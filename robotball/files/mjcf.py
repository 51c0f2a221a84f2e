"""MJCF files: our own parts, and a user's body."""

import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robotball.bodies import Frame
from robotball.errors import InputError

with warnings.catch_warnings(action="ignore"):
    # Without a screen, dm_control's search for a window system warns; nothing here needs one.
    from dm_control import mjcf

PARTS = Path(__file__).parents[2] / "mjcf"


def part(name: str) -> Any:
    """The hand-written part mjcf/`name`.xml as it is, in units of the ball's radius."""
    return mjcf.from_path(str(PARTS / f"{name}.xml"))


def frame_of_mjcf(path: Path, name: str) -> Frame:
    """The mass, centre and inertia of the body `name` of an MJCF file, in the body's own axes.

    Its origin is taken as the centre of the sphere. Raises InputError where the file does not
    compile, has no such body, or the body carries others that move on it.
    """
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    if body < 0:
        names = [model.body(i).name for i in range(1, model.nbody)]
        raise InputError(f"{path}: no body is called {name!r}; there are {names}")
    fixed = [i for i in range(model.nbody) if model.body_weldid[i] == model.body_weldid[body]]
    below = [i for i in range(body, model.nbody) if _is_below(model, i, body)]
    if not set(below) <= set(fixed):
        raise InputError(f"{path}: body {name!r} carries bodies that move on it")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    to_body, origin = data.xmat[body].reshape(3, 3).T, data.xpos[body]
    masses = model.body_mass[below]
    if not masses.sum() > 0:
        raise InputError(f"{path}: body {name!r} has no mass")
    centres = (data.xipos[below] - origin) @ to_body.T
    centre = masses @ centres / masses.sum()
    inertia = np.zeros((3, 3))
    for i, mass, r in zip(below, masses, centres - centre, strict=True):
        axes = to_body @ data.ximat[i].reshape(3, 3)
        inertia += axes @ np.diag(model.body_inertia[i]) @ axes.T
        inertia += mass * (r @ r * np.eye(3) - np.outer(r, r))
    return Frame(mass=float(masses.sum()), inertia=inertia, centre=centre)


def _is_below(model: mujoco.MjModel, body: int, ancestor: int) -> bool:
    while body > ancestor:
        body = model.body_parentid[body]
    return body == ancestor
