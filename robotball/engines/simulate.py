"""Scene + request → Motion by a contact engine."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from robotball.engines import DEFAULT, engine_named
from robotball.engines.protocol import Engine, Progress, Request
from robotball.errors import InputError, warn
from robotball.motion import ContactMotion, Loads
from robotball.motors import Servo
from robotball.rotations import Array
from robotball.scene import Scene
from robotball.settings import EngineSettings, preset_named
from robotball.times import check_times

LARGEST_RADIUS = 10.0  # m; balls that people ride in have 1.5
STILL = 10.0  # s, in which a ball that rolls at all rolls farther than its radius
SAMPLED = 100  # samples of a path at least, by which its length is known
# Times torque_limit/kv, which is a motor's rate without load where the limit is its stall torque;
# electronics may limit it to less, but seldom to a fifth.
NO_LOAD = 5.0


def simulate(
    scene: Scene,
    times: Array | None = None,
    settings: EngineSettings | str | None = None,
    *,
    engine: Engine | str = DEFAULT,
    accuracy: float | None = None,
    strict: bool = False,
    fault_window: Path | None = None,
    progress: Progress | None = None,
) -> ContactMotion:
    """The motion of the ball as a contact engine rolls it, with a report.

    times: (n,) s, increasing from 0; the scene's own if None. settings: a preset's name or the
    engine's settings, its default preset if None. engine: its name or itself. accuracy: instead of
    settings, the path error to reach, relative to the path's length. A run that faults ends there,
    with fewer times; with stop_at_fault off, only one that has no state any more does.
    fault_window: where the states around the first fault go, for `robotball replay`; without a
    fault the file of a former run is taken away. progress is called with the simulated fraction.

    Warns of an accuracy that is not reached, of a ball or a motion that can hardly be what was
    meant, and of settings that are predicted to fail, which are an InputError if `strict`. Raises
    InputError on unusable times, an unknown engine or preset, a scene that the engine cannot
    express, an accuracy that rounding forbids and a run of more steps than the settings allow.
    """
    return run_request(
        scene,
        times,
        request_of(engine, settings, accuracy),
        strict=strict,
        fault_window=fault_window,
        progress=progress,
    )


def request_of(
    of: Engine | str = DEFAULT,
    settings: EngineSettings | str | None = None,
    accuracy: float | None = None,
    *,
    keep_going: bool = False,
) -> Request:
    """The request that a user's choices make.

    keep_going: not to end at the first fault. Raises InputError for an unknown engine or preset,
    for both settings and accuracy, and for an accuracy that the engine cannot reach.
    """
    chosen = engine_named(of) if isinstance(of, str) else of
    if accuracy is not None:
        _check_accuracy(chosen, settings, accuracy, keep_going)
        return Request(chosen, None, float(accuracy))
    if not isinstance(settings, EngineSettings):
        settings = preset_named(chosen.presets, settings or chosen.default)
    return Request(chosen, replace(settings, stop_at_fault=False) if keep_going else settings)


def run_request(
    scene: Scene,
    times: Array | None,
    request: Request,
    *,
    loads: Loads | None = None,
    strict: bool = False,
    fault_window: Path | None = None,
    progress: Progress | None = None,
) -> ContactMotion:
    """`simulate` by a request; loads: of the whole motion, where a reference knows them."""
    if why := request.engine.cannot_express(scene):
        raise InputError(f"{request.engine.label.name} cannot run {scene.name}: {why}")
    times = scene.times if times is None else check_times(times)
    motion = request.engine.run(
        scene.until(float(times[-1])),
        times,
        request,
        loads=loads,
        strict=strict,
        fault_window=fault_window,
        progress=progress,
    )
    for line in _doubts(motion):
        warn(f"{scene.name}: {line}")
    return replace(motion, scene=scene)


def _doubts(motion: ContactMotion) -> Iterator[str]:
    """Why the motion can hardly be what was meant, a line each; wrong units are the usual cause."""
    scene, radius = motion.scene, motion.scene.ball.radius
    if radius > LARGEST_RADIUS:
        yield f"a radius of {radius:g} m is beyond any robot's; lengths are in m, 150 mm is 0.15"
    if motion.report.faults or len(motion.times) < SAMPLED:
        return
    if motion.times[-1] >= STILL and motion.path_length < radius:
        yield (
            f"the ball rolls {motion.path_length:.2g} m in {motion.times[-1]:g} s, less than its "
            f"radius of {radius:g} m; check the start, the rates [rad/s] and the masses [kg]"
        )
    for i, motor in enumerate(scene.motors):
        if isinstance(motor, Servo) and motor.torque_limit is not None:
            rate, no_load = np.abs(motion.hinge_rates[:, i]).max(), motor.torque_limit / motor.gain
            if rate > NO_LOAD * no_load:
                yield (
                    f"{scene.hinges[i].name}'s motor turns at {rate:.3g} rad/s, but without load "
                    f"at {no_load:.3g} = torque_limit/kv if it stalls at its limit; check rate "
                    "(1 rpm is 0.105 rad/s), kv and torque_limit"
                )


def _check_accuracy(
    of: Engine, settings: EngineSettings | str | None, accuracy: float, keep_going: bool
) -> None:
    if settings is not None:
        raise InputError("give settings or an accuracy, not both: an accuracy chooses its own")
    if keep_going:
        raise InputError("a run with a fault reaches no accuracy: give --keep-going with a preset")
    if of.least_accuracy is None:
        raise InputError(f"{of.label.name} has no settings for an accuracy: give a preset")
    if not of.least_accuracy <= accuracy < 1:
        raise InputError(
            f"an accuracy must be at least {of.least_accuracy:g}, where rounding ends it, and "
            f"below 1, not {accuracy:g}"
        )
