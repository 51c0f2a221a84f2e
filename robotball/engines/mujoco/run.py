"""One run of a built model: stepped over its times, judged at every step, and recorded."""

from collections.abc import Iterable
from dataclasses import replace

from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.limits import check_length
from robotball.engines.mujoco.model import Model, build
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
    """Return the motion of a built model.

    Parameters
    ----------
    model : Model
        As built for a scene and settings.
    times : (n,), s
        The sample times from 0, which are not checked.
    progress : function, optional
        Called with the simulated fraction.
    scene : Scene, optional
        One of the same ball, from whose start to run in place of the model's own.

    Raises
    ------
    InputError
        For a run of more steps than the settings allow.
    """
    check_length(model.scene, model.settings, times)
    march = by_steps
    if model.settings.adaptive:
        from robotball.engines.mujoco.adaptive import by_forward

        march = by_forward
    assert model.compiled  # before the callbacks are set, which MuJoCo's compiler would call
    with controlled(model) as control:
        data = model.start_data(scene)
        motion = observed(control.model, times, march(control, data, times), progress)
        return replace(motion, scene=model.scene)  # without the commands of this run's loop


def observed(
    model: Model, times: Array, portions: Iterable[Portion], progress: Progress | None = None
) -> ContactMotion:
    """Return the motion of a run's portions at sample times (n,), up to where it breaks off."""
    recording = Recording(LABEL, model.scene, model.settings, times)
    steps, longest, seconds = 0, 0.0, 0.0
    for portion in portions:
        readings = readings_of(model, portion.rows)
        own = own_faults(model, portion.rows, readings)
        recording.add(readings, portion.sampled, own, portion.failure)
        steps, seconds = steps + portion.steps, seconds + portion.seconds
        longest = max(longest, portion.longest)
        if recording.ended:
            break
        if progress is not None and len(readings.time):
            progress(float(readings.time[-1] / times[-1]))
    return recording.motion(longest, steps, seconds)


def held(motion: ContactMotion) -> ContactMotion:
    """Return the motion of a run, held against runs in other steps where its M is no witness."""
    if motion.scene.not_reduced is None:
        return motion
    from robotball.engines.mujoco.accuracy import checked

    return checked(motion, lambda other, at: run(build(motion.scene, other), at))
