"""The precheck of a run: is it beyond a predicted limit, and can it end at all."""

import math

import numpy as np

from robotball.engines.mujoco import contact_limits, hinge_limits, step_limits
from robotball.engines.mujoco.planned_run import LimitCheck, PlannedRun
from robotball.engines.mujoco.settings import Settings
from robotball.engines.spans import step_count
from robotball.errors import InputError, warn
from robotball.motion import Loads
from robotball.rotations import Array
from robotball.scene import Scene

LAWS = step_limits.LAWS | contact_limits.LAWS | hinge_limits.LAWS


def limit_checks(
    scene: Scene, settings: Settings, times: Array, loads: Loads | None = None
) -> tuple[LimitCheck, ...]:
    """Every limit that the settings have on this scene, exceeded or not.

    times: (n,) s, the run's; loads: of the whole motion by the equations, if known already, in
    place of the start's.
    """
    plan = PlannedRun(scene, settings, float(times[-1]), loads)
    with np.errstate(all="ignore"):
        found = (predict(plan) for predict in LAWS)
        return tuple(check for check in found if check is not None)


def exceeded(
    scene: Scene, settings: Settings, times: Array, loads: Loads | None = None
) -> tuple[LimitCheck, ...]:
    """The limits that a run is predicted to be beyond; arguments as for `limit_checks`."""
    return tuple(each for each in limit_checks(scene, settings, times, loads) if each.exceeded)


def precheck(
    scene: Scene,
    settings: Settings,
    times: Array,
    loads: Loads | None = None,
    *,
    strict: bool = False,
) -> None:
    """Warns, a line each, of the limits that the run is beyond; InputError if strict."""
    for each in exceeded(scene, settings, times, loads):
        line = f"{scene.name}, {settings.name}: {each}"
        if strict:
            raise InputError(line)
        warn(line)


def check_length(scene: Scene, settings: Settings, times: Array) -> None:
    """Raises InputError for a run of more steps than the settings allow.

    Steps that are chosen by their error are counted as they are taken instead, but for the least
    that the servos take.
    """
    if settings.adaptive and settings.timestep is None:
        least = step_limits.settling(PlannedRun(scene, settings, float(times[-1])))
        if least is not None and least.value > settings.max_steps:
            raise InputError(
                f"{scene.name} over {times[-1]:g} s: {least}; max_steps = {settings.max_steps}"
            )
        return
    timestep = PlannedRun(scene, settings, float(times[-1])).timestep
    steps = step_count(times, scene.breakpoints, timestep)
    if steps > settings.max_steps:
        size = f"{steps:.0f}" if steps < 1e15 else f"{steps:.2g}"
        raise InputError(
            f"{scene.name} over {times[-1]:g} s takes {size} steps of {timestep:g} s, more than "
            f"max_steps = {settings.max_steps}: shorten the run, lengthen the timestep, or raise it"
        )
    assert math.isfinite(steps)
