"""Run a built model: step it over its times, monitor every step, and record the motion."""

from collections.abc import Iterable
from dataclasses import replace

from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.limits import check_length
from robotball.engines.mujoco.model import Model
from robotball.engines.mujoco.readings import own_faults, readings_of
from robotball.engines.mujoco.stepping import Portion, by_steps, controlled
from robotball.engines.observe import Recording
from robotball.motion import ContactMotion, Progress
from robotball.robot.scene import Scene
from robotball.rotations import Array


def run(
    model: Model,
    times: Array,
    progress: Progress | None = None,
    scene: Scene | None = None,
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
    check_length(model.scene, model.settings, times)
    march = by_steps
    if model.settings.adaptive:
        from robotball.engines.mujoco.adaptive import by_forward

        march = by_forward
    assert model.compiled  # MuJoCo's compiler would call the callbacks that are set below
    with controlled(model) as control:
        data = model.start_data(scene)
        motion = observed(control.model, times, march(control, data, times), progress)
        return replace(motion, scene=model.scene)  # the control's scene has the loop's commands


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
