"""The check before a run: is it near a predicted edge, and can it end at all."""

import math
import warnings

import numpy as np

from robotball.engines.mujoco import contact_limits, step_limits
from robotball.engines.mujoco.planned_run import Case, Edge
from robotball.engines.mujoco.settings import Settings
from robotball.engines.mujoco.timing import step_count
from robotball.errors import InputError, SceneWarning
from robotball.motion import Loads
from robotball.rotations import Array
from robotball.scene import Scene


def edges(
    scene: Scene, settings: Settings, times: Array, loads: Loads | None = None
) -> tuple[Edge, ...]:
    """Every edge that the settings have on this scene, crossed or not.

    times: (n,) s, the run's; loads: of the whole motion by the equations, if known already, in
    place of the start's.
    """
    case = Case(scene, settings, float(times[-1]), loads)
    with np.errstate(all="ignore"):
        found = (predict(case) for predict in (*step_limits.EDGES, *contact_limits.EDGES))
        return tuple(edge for edge in found if edge is not None)


def check(
    scene: Scene, settings: Settings, times: Array, loads: Loads | None = None
) -> tuple[Edge, ...]:
    """The edges that a run is predicted to be beyond; arguments as for `edges`."""
    return tuple(edge for edge in edges(scene, settings, times, loads) if edge.crossed)


def warn(
    scene: Scene,
    settings: Settings,
    times: Array,
    loads: Loads | None = None,
    *,
    strict: bool = False,
    stacklevel: int = 4,
) -> None:
    """A SceneWarning, a line each, of the edges that the run is beyond; InputError if strict."""
    for edge in check(scene, settings, times, loads):
        line = f"{scene.name}, {settings.name}: {edge}"
        if strict:
            raise InputError(line)
        warnings.warn(line, SceneWarning, stacklevel=stacklevel)


def check_length(scene: Scene, settings: Settings, times: Array) -> None:
    """Raises InputError for a run of more steps than the settings allow.

    Steps that are chosen by their error are counted as they are taken instead.
    """
    if settings.adaptive and settings.timestep is None:
        return
    timestep = Case(scene, settings, float(times[-1])).timestep
    steps = step_count(times, scene.breakpoints, timestep)
    if steps > settings.max_steps:
        size = f"{steps:.0f}" if steps < 1e15 else f"{steps:.2g}"
        raise InputError(
            f"{scene.name} over {times[-1]:g} s takes {size} steps of {timestep:g} s, more than "
            f"max_steps = {settings.max_steps}: shorten the run, lengthen the timestep, or raise it"
        )
    assert math.isfinite(steps)
