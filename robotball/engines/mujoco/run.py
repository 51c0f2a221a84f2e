"""Check a planned run; run a built model: step it, monitor every step, record the motion."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from robotball.engines.mujoco import LABEL, limits
from robotball.engines.mujoco.control import Portion
from robotball.engines.mujoco.limits import LimitCheck, PlannedRun
from robotball.engines.mujoco.model import Model
from robotball.engines.mujoco.readings import own_faults, readings_of
from robotball.engines.mujoco.settings import Settings
from robotball.engines.mujoco.stepping import by_steps, controlled
from robotball.engines.observe import Recording, step_count
from robotball.errors import InputError, warn
from robotball.motion import ContactMotion, Progress
from robotball.robot.loads import Loads
from robotball.robot.scene import Scene
from robotball.rotations import Array


def limit_checks(plan: PlannedRun) -> dict[str, LimitCheck]:
    """Return the predictions of all laws that apply to a run, by the name of the law."""
    laws = [*limits.LAWS]
    if not plan.plain:
        from robotball.engines.mujoco import special_limits

        laws += special_limits.LAWS
    # With extreme settings numbers overflow here, and an infinite value exceeds its limit.
    with np.errstate(all="ignore"):
        checks = {law.__name__: law(plan) for law in laws}
    return {name: check for name, check in checks.items() if check is not None}


def exceeded(
    scene: Scene, settings: Settings, times: Array, loads: Loads | None = None
) -> dict[str, LimitCheck]:
    """Return the limits that a run over times (n,) [s] is predicted to exceed, by name.

    loads: the loads of the whole motion, if a reference gives them.
    """
    checks = limit_checks(PlannedRun(scene, settings, float(times[-1]), loads))
    return {name: check for name, check in checks.items() if check.exceeded}


def precheck(
    scene: Scene,
    settings: Settings,
    times: Array,
    loads: Loads | None = None,
    *,
    strict: bool = False,
) -> None:
    """Warn of each limit that the run is predicted to exceed; raise InputError if strict."""
    for check in exceeded(scene, settings, times, loads).values():
        line = f"{scene.name}, {settings.name}: {check.warning}"
        if strict:
            raise InputError(line)
        warn(line)


def check_length(plan: PlannedRun, times: Array) -> None:
    """Raise InputError for a run of more steps than the settings allow."""
    scene, settings = plan.scene, plan.settings
    # Steps of order 8 have samples inside.
    stops = times if settings.own else times[[0, -1]]
    steps = step_count(stops, scene.breakpoints, plan.timestep)
    if not steps <= settings.max_steps:  # a NaN is refused as well
        size = f"{steps:.0f}" if steps < 1e15 else f"{steps:.2g}"
        raise InputError(
            f"{scene.name} over {times[-1]:g} s takes {size} steps of {plan.timestep:g} s, more "
            f"than max_steps = {settings.max_steps}: shorten the run, lengthen the timestep, or "
            "raise max_steps"
        )


def run(
    model: Model, times: Array, progress: Progress | None = None, scene: Scene | None = None
) -> ContactMotion:
    """Run a built model.

    Parameters
    ----------
    model : Model
        A model as `build` returns it.
    times : (n,), s
        The sample times, from 0. They are not checked.
    progress : callable, optional
        Called with the simulated fraction, from 0 to 1.
    scene : Scene, optional
        A scene with the same ball, whose start replaces the model's start.

    Returns
    -------
    ContactMotion
        The motion, with its report.

    Raises
    ------
    InputError
        If the run needs more steps than the settings allow.
    """
    plan = PlannedRun(model.scene, model.settings, float(times[-1]))
    check_length(plan, times)
    _ = model.compiled  # MuJoCo's compiler would call the callbacks that are set below
    with controlled(model) as control:
        control.timestep = plan.timestep
        data = model.start_data(scene)
        motion = observed(control.model, times, by_steps(control, data, times), progress)
        calls = control.loop.calls if control.loop else ()
        # The control's scene has the loop's commands.
        return replace(motion, scene=model.scene, calls=calls)


def observed(
    model: Model, times: Array, portions: Iterable[Portion], progress: Progress | None = None
) -> ContactMotion:
    """Return the motion of a run's portions at sample times (n,), up to its first fatal fault."""
    recording = Recording(LABEL, model.scene, model.settings, times)
    steps, longest, seconds = 0, 0.0, 0.0
    for portion in portions:
        readings = readings_of(model, portion.rows)
        faults = own_faults(model, portion.rows, readings)
        recording.add(readings, portion.sampled, faults, portion.failure)
        steps, seconds = steps + portion.steps, seconds + portion.seconds
        longest = max(longest, portion.longest)
        if recording.ended:
            break
        if progress is not None and len(readings.time):
            progress(float(readings.time[-1] / times[-1]))
    return recording.motion(longest, steps, seconds)
