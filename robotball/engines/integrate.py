"""Scene → ReferenceMotion, by the smallest equations that describe it."""

from dataclasses import fields
from typing import Literal, get_args

import numpy as np

from robotball.engines.dop853 import LEAST_RTOL
from robotball.engines.reduced import integrate as reduced
from robotball.errors import InputError, unknown
from robotball.motion import ReferenceMotion
from robotball.room import let_go
from robotball.rotations import Array
from robotball.scene import Scene
from robotball.times import check_times

Equations = Literal["reduced", "multibody"]


def integrate(
    scene: Scene,
    times: Array | None = None,
    rtol: float = LEAST_RTOL,
    max_steps: int | None = None,
    *,
    equations: Equations | None = None,
) -> ReferenceMotion:
    """The scene's motion by equations, with an estimate of its own error; its label says by which.

    times: (n,) s, increasing from 0; the scene's own if None. rtol: the error allowed in one step,
    from 1e-15 on; max_steps: a limit for motions that turn too often, some minutes' work if None.
    equations: (3.2)/(3.3) where they describe the scene, if None, else those of any robot; both
    can be asked for by name. Raises InputError on unusable times, for a scene that the equations
    asked for do not describe, where the ball lifts off, where the limit is met or a step shrinks to
    nothing, and where a number would overflow: a motion that is returned is finite.
    """
    times = scene.times if times is None else check_times(times)
    if not LEAST_RTOL <= rtol < 1:
        raise InputError(f"rtol must be at least {LEAST_RTOL:g} and less than 1, not {rtol:g}")
    if equations not in (None, *get_args(Equations)):
        raise unknown("set of equations", equations, get_args(Equations))
    chosen = equations or ("multibody" if scene.not_reduced else "reduced")
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        if chosen == "reduced":
            motion = reduced.integrate(scene, times, rtol, max_steps)
        else:
            # Its compiled code takes a while to come.
            from robotball.engines.multibody import integrate as multibody

            motion = multibody.integrate(scene, times, rtol, max_steps)
    _check_finite(motion)
    return motion


def _check_finite(motion: ReferenceMotion) -> None:
    """Raises InputError, with the first number that overflowed, unless all are finite."""
    for part in (motion, motion.loads):
        for field in fields(part):
            let_go()
            value = getattr(part, field.name)
            if isinstance(value, np.ndarray) and not np.isfinite(value).all():
                i = int(np.argmin(np.isfinite(value).reshape(len(value), -1).all(axis=1)))
                raise InputError(
                    f"{motion.scene.name}: the {field.name.replace('_', ' ')} exceeds "
                    f"{np.finfo(float).max:.2g}, the largest number that there is, at "
                    f"t = {motion.times[i]:g} s; bring the bodies or the rates nearer to 1"
                )
