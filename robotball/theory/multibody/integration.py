"""Integrate the motion of any rolling robot to round-off, with an estimate of its error."""

from collections.abc import Sequence

import numpy as np

from robotball.errors import EarlyEndError, InputError, warn
from robotball.motion import Motion, Progress, ReferenceMotion, extended
from robotball.robot.drives import turns
from robotball.robot.loads import Loads
from robotball.robot.loop import Loop
from robotball.robot.scene import Scene
from robotball.rotations import Array
from robotball.theory.dop853 import LEAST_RTOL
from robotball.theory.friction import slip_intervals
from robotball.theory.multibody import LABEL
from robotball.theory.multibody.derivative import (
    HINGES,
    LOSS,
    MOMENTUM,
    POINT,
    Readings,
    readings_of,
)
from robotball.theory.multibody.march import March
from robotball.theory.multibody.system import System

_MAX_STEPS = 1_000_000  # take ten minutes, if motors settle so fast that they limit the step
_MANY_STEPS = 100_000  # take a minute
_SECONDS = 6e-4  # s of time per step of the motion and of the one that estimates its error
_STABLE = 6.3  # longest stable step of DOP853, times the rate at which the fastest motor settles
_DIFFERENCE = 1e-6  # of a state's scale: the half step of the Jacobian's differences
# Factor of the tolerance for the motion that estimates the error. The steps of this motion are a
# fifth longer, so that its rounding errors differ.
_COARSER = 4.0


def integrate(
    scene: Scene,
    times: Array,
    rtol: float = LEAST_RTOL,
    max_steps: int | None = None,
    progress: Progress | None = None,
) -> ReferenceMotion:
    """Integrate the motion of any robot that rolls, with an estimate of its error.

    If a joint reaches an end of its range, the motion ends at that time, and there is a warning.

    Parameters
    ----------
    scene : Scene
        The scene.
    times : (n,), s
        The sample times, increasing from 0.
    rtol : float, default 1e-15
        The relative error allowed in one step.
    max_steps : int, optional
        The largest number of steps.
    progress : callable, optional
        Called with the fraction of the motion that is complete, from 0 to 1.

    Returns
    -------
    ReferenceMotion
        The motion.

    Raises
    ------
    InputError
        If the ball lifts off, if a step becomes too short, if max_steps is reached, or if the
        motors settle so fast that max_steps would be reached.
    """
    limit = _MAX_STEPS if max_steps is None else max_steps
    whole = scene.until(float(times[-1]))
    _check_rates(whole, float(times[-1]), limit, progress)

    def march(tolerance: float) -> March:
        # The system and the loop change while they march, so each march has new ones.
        loop = None if whole.controller is None else Loop(whole, whole.controller)
        system = System(loop.scene if loop else whole)
        return March(system, tolerance, float(times[-1]), limit, progress, loop)

    def again() -> Array:
        coarser = march(_COARSER * rtol)
        coarser.system.ranges = []  # because of rounding, a range might end this motion earlier
        return coarser.run(times)[0][:, POINT:MOMENTUM]

    first = march(rtol)
    states, readings = first.run(times)
    hinges, times = len(scene.hinges), times[: len(states)]
    values = readings_of(readings, hinges)
    slipping = slip_intervals(first.system.slip_events, scene, float(times[-1]))
    return extended(
        _motion_of(whole, times, states, values),
        ReferenceMotion,
        scene=scene,
        again=again,
        calls=first.loop.calls if first.loop else (),
        motor_work=states[:, HINGES + 2 * hinges : HINGES + 3 * hinges],
        rolling_loss=states[:, LOSS],
        plane_work=None if scene.plane_is_still else states[:, -1],
        slip=values.slip * (first.system.weights > 0) if slipping else None,
        slipping=slipping,
        friction_loss=states[:, HINGES + 3 * hinges + 2] if slipping else None,
        ended=_end_of_range(scene, first, len(times)),
    )


def _end_of_range(scene: Scene, march: March, samples: int) -> str | None:
    """Return a text, also as a warning, on the range that ended the motion; None if none did.

    Raises InputError if the motion has fewer than two samples.
    """
    if march.stopped is None:
        return None
    t, event = march.stopped
    at, (joint, *ends) = march.system.ranges[event - 1]
    slides = scene.ball.tree[1 + at - HINGES].slides
    low, high = ends if slides else np.degrees(ends)
    interval = f"{low:g} to {high:g} {'m' if slides else 'deg'}"
    ended = f"{joint} reaches its range of {interval} at t = {t:.6g} s"
    if not t > 0:
        raise EarlyEndError(
            f"{scene.name}: {joint} starts at an end of its range of {interval} and is pushed "
            "against the stop: widen the range, or start elsewhere"
        )
    if samples < 2:
        raise EarlyEndError(
            f"{scene.name}: {ended}, before the first sample: widen the range, or sample more often"
        )
    warn(f"{scene.name}: {ended}, where the motion ends")
    return ended


def integrate_together(
    scenes: Sequence[Scene], times: Array, rtol: float, max_steps: int = _MAX_STEPS
) -> list[Motion]:
    """Integrate robots whose parameters differ slightly, with the same steps and the same modes.

    The motions then differ only because of the parameters, so finite differences of the motions are
    the more accurate, the smaller the differences of the parameters are. Steps and modes are those
    of the first scene. The motions stay accurate when modes change, because forces are continuous
    at a change. The scenes must have no controller and must have the breakpoints of the first
    scene. Raises InputError as `integrate` does.
    """
    end = float(times[-1])
    wholes = [scene.until(end) for scene in scenes]
    march = March(System(*wholes), rtol, end, max_steps)
    states, readings = (np.split(rows, len(wholes), axis=1) for rows in march.run(times))
    hinges, times = len(wholes[0].hinges), times[: len(states[0])]
    return [
        _motion_of(scene, times, rows, readings_of(numbers, hinges))
        for scene, rows, numbers in zip(wholes, states, readings, strict=True)
    ]


def _check_rates(scene: Scene, duration: float, limit: int, progress: Progress | None) -> None:
    """Raise InputError if the motors settle too fast for the limit of steps; warn of many steps."""
    if not any(hinge.motor for hinge in scene.hinges):
        return
    rate = _fastest_rate(System(scene), progress)
    steps = rate * duration / _STABLE
    if steps > _MANY_STEPS:
        line = (
            f"{scene.name}: its motors settle at {rate:.3g} 1/s, so {duration:g} s need at least "
            f"{steps:.2g} steps, about {steps * _SECONDS / 60:.2g} min: lower the gains, raise the "
            "armatures, or prescribe the rates"
        )
        if steps > limit:
            raise InputError(f"{line} (max_steps = {limit})")
        warn(line)


def _fastest_rate(system: System, progress: Progress | None) -> float:
    """Return the largest |λ| [1/s] of the Jacobian at the start, with unlimited motors."""
    # Resistance is not smooth at rest, so it has no Jacobian.
    system.machine.resistance[:] = 0.0
    state, end = system.start(), HINGES + 2 * system.count
    # The contact point and the work do not affect any rate.
    changing = np.r_[:POINT, MOMENTUM:LOSS, HINGES:end]
    columns = []
    for step in np.diag(_DIFFERENCE * system.scale)[changing]:
        change = system.rate(0.0, state + step) - system.rate(0.0, state - step)
        columns.append(change[changing] / (2 * step.max()))
        # With hundreds of hinges this takes half a minute. The first column may include compiling.
        if progress is not None:
            progress(0.0)
    if not np.isfinite(columns).all():
        raise InputError(
            f"{system.scene.name}: its equations have no finite solution at the start: check that "
            "masses are in kg and lengths in m, and that they do not differ too much"
        )
    return float(np.abs(np.linalg.eigvals(np.array(columns))).max())


def _motion_of(scene: Scene, times: Array, states: Array, readings: Readings) -> Motion:
    moving = [hinge.motor is not None or turns(hinge.command) for hinge in scene.hinges]
    return Motion(
        scene=scene,
        engine=LABEL,
        times=times,
        contact_point=states[:, POINT:MOMENTUM],
        attitude=states[:, :4] / np.linalg.norm(states[:, :4], axis=1, keepdims=True),
        momentum=states[:, MOMENTUM:LOSS],
        angular_velocity=readings.omega,
        hinge_angles=states[:, HINGES : HINGES + len(moving)],
        hinge_rates=readings.rates,
        loads=Loads(
            contact_force=readings.force,
            spin_torque=readings.plane_torque[:, 2],
            motor_torques=readings.torques * np.array(moving),
        ),
    )
