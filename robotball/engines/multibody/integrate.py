"""Scene → Motion by the equations of any robot, integrated to round-off."""

from dataclasses import fields, replace

import numpy as np

from robotball.drives import turns
from robotball.engines.dop853 import LEAST_RTOL
from robotball.engines.multibody import LABEL
from robotball.engines.multibody.compiled import (
    FORCE,
    HINGES,
    LOSS,
    MOMENTUM,
    OMEGA,
    PLANE_TORQUE,
    POINT,
    TOLD,
)
from robotball.engines.multibody.marching import March
from robotball.engines.multibody.system import System
from robotball.errors import InputError, warn
from robotball.motion import Loads, Motion, ReferenceMotion
from robotball.rotations import Array
from robotball.scene import Scene

MAX_STEPS = 1_000_000  # some minutes' work
MANY_STEPS = 20_000  # ten seconds' at least
STABLE = 6.3  # over the rate at which anything settles: the longest step of DOP853
DIFFERENCE = 1e-6  # of a state's scale, by which its Jacobian is taken
COARSER = 4.0  # times the error of a step, of the motion by which its own error is estimated


def integrate(
    scene: Scene, times: Array, rtol: float = LEAST_RTOL, max_steps: int | None = None
) -> ReferenceMotion:
    """The motion of any robot that rolls, with an estimate of its own error.

    times: (n,) s, increasing from 0; rtol: the error allowed in one step; max_steps: a limit.
    Raises InputError where the ball lifts off, where the limit is met, or will be for its motors
    settle too fast, and where a step shrinks to nothing.
    """
    limit = MAX_STEPS if max_steps is None else max_steps
    ours = scene.until(float(times[-1]))
    _check_rates(ours, float(times[-1]), limit)

    def run(allowed: float) -> tuple[Array, Array]:
        return March(System(ours), allowed, float(times[-1]), limit).run(times)

    states, told = run(rtol)
    whole, count = replace(_motion_of(ours, times, states, told), scene=scene), len(scene.hinges)
    values = {each.name: getattr(whole, each.name) for each in fields(whole)}
    return ReferenceMotion(
        **values,
        again=lambda: run(COARSER * rtol)[0][:, POINT:MOMENTUM],
        motor_work=states[:, HINGES + 2 * count :],
        rolling_loss=states[:, LOSS],
    )


def _check_rates(scene: Scene, duration: float, limit: int) -> None:
    """Raises InputError where the motors settle too fast for so many steps; warns of many."""
    if not any(scene.motors):
        return
    rate = _fastest(System(scene))
    steps = rate * duration / STABLE
    if steps > MANY_STEPS:
        line = (
            f"{scene.name}: its motors settle at {rate:.3g} 1/s, so {duration:g} s take at least "
            f"{steps:.2g} steps; lower the gains, raise the armatures, or prescribe the rates"
        )
        if steps > limit:
            raise InputError(f"{line} (max_steps = {limit})")
        warn(line)


def _fastest(system: System) -> float:
    """|λ| [1/s], the largest at the start of a system whose motors are below their limits."""
    system.resistance = 0.0  # that alone is not smooth
    state = system.start()
    sides = [
        (system.rate(0.0, state + step) - system.rate(0.0, state - step)) / (2 * step.max())
        for step in np.diag(DIFFERENCE * system.scale)
    ]
    return float(np.abs(np.linalg.eigvals(np.array(sides))).max())


def _motion_of(scene: Scene, times: Array, states: Array, told: Array) -> Motion:
    attitude = states[:, :4] / np.linalg.norm(states[:, :4], axis=1, keepdims=True)
    count = len(scene.hinges)
    moving = np.array([hinge.motor is not None or turns(hinge.command) for hinge in scene.hinges])
    return Motion(
        scene=scene,
        engine=LABEL,
        times=times,
        contact_point=states[:, POINT:MOMENTUM],
        attitude=attitude,
        momentum=states[:, MOMENTUM:LOSS],
        angular_velocity=told[:, OMEGA : OMEGA + 3],
        hinge_angles=states[:, HINGES : HINGES + count],
        hinge_rates=told[:, TOLD : TOLD + count],
        loads=Loads(
            contact_force=told[:, FORCE : FORCE + 3],
            spin_torque=told[:, PLANE_TORQUE + 2],
            motor_torques=told[:, TOLD + count : TOLD + 2 * count] * moving,
        ),
    )
