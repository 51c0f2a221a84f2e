"""What ends a smooth piece of a motion, as margins: each is positive while the modes stay.

A motor reaches its torque limit or leaves it, the plane's resistance to rolling holds the shell no
more, the ball lifts off. A margin is 1 where what it is of is farthest from its end.
"""

from dataclasses import replace

import numpy as np

from robotball.engines.multibody.compiled import HINGES, MOMENTUM, STANDING
from robotball.engines.multibody.system import Modes, System, Told
from robotball.errors import InputError
from robotball.rotations import Array, rotation_matrix

LIFT_OFF = 0  # the margin that no mode comes after; the motors' follow, then the standing shell's
NUDGE, NUDGES = 1e-6, 30  # s, and how often: which way a shell goes that begins to roll


def margins(system: System, told: Told) -> Array:
    """(1 + motors with a limit, and 1 for a shell that stands)."""
    scene, modes = system.scene, system.modes
    weight = scene.ball.mass * scene.gravity
    found = [told.normal / weight]
    for j in system.limited:
        part = told.unlimited[j] / system.limits[j]
        found.append(1 - abs(part) if modes.motors[j] == 0 else modes.motors[j] * part - 1)
    if modes.standing:
        found.append(1 - _held(told) / (system.resistance * told.normal))
    return np.array(found)


def begin(system: System, t: float, state: Array) -> Array:
    """Set the modes in which a piece begins at t [s]; the state, as it is in them."""
    modes, unlimited = system.modes, system.told(t, state).unlimited
    sides = np.where(np.abs(unlimited) > system.limits, np.sign(unlimited), 0.0)
    system.modes = replace(modes, motors=sides.astype(np.int64))
    told = system.told(t, state)
    if not told.normal > 0:
        raise lift_off(t)
    return stand(system, t, state, told)


def stand(system: System, t: float, state: Array, told: Told) -> Array:
    """The state where the plane's resistance may hold a shell that does not roll; sets the mode."""
    modes = system.modes
    if not system.resistance or modes.standing:
        return state
    if np.linalg.norm(told.rolling) > STANDING:
        system.modes = Modes(modes.motors)
        return state
    system.modes = Modes(modes.motors, standing=True)
    held = system.told(t, state)
    if _held(held) <= system.resistance * held.normal:
        return state
    if np.any(modes.toward):
        system.modes = modes
        return state
    return let_go(system, t, state)


def let_go(system: System, t: float, state: Array) -> Array:
    """The state of a shell that stands no more and begins to roll; sets the mode.

    Resistance is against the way it will go, which depends on the resistance: t is found such that
    the acceleration with resistance against t is along t. The step towards it is damped by the
    acceleration without any, or it would overshoot. A load that grows leaves t where it was held.
    """
    told = system.told(t, state)
    state = _with_momentum(system, state, told)
    system.modes = Modes(system.modes.motors)

    def ahead() -> Array:
        return system.told(t, state + NUDGE * system.rate(t, state)).rolling

    free = ahead()
    system.modes.toward = -told.plane_torque * [1.0, 1.0, 0.0] / _held(told)
    for _ in range(NUDGES):
        to = float(np.linalg.norm(free)) * system.modes.toward + ahead()
        if np.any(to):
            system.modes.toward = to / np.linalg.norm(to)
    return state


def switch(system: System, t: float, state: Array, which: int) -> Array:
    """Set the modes that come after a margin has ended at t; the state, as it is in them."""
    told, modes = system.told(t, state), system.modes
    if which == LIFT_OFF:
        raise lift_off(t)
    if which > len(system.limited):
        return let_go(system, t, state)
    j = system.limited[which - 1]
    motors = modes.motors.copy()
    motors[j] = int(np.sign(told.unlimited[j])) if modes.motors[j] == 0 else 0
    system.modes = replace(modes, motors=motors)
    return state


def lift_off(t: float) -> InputError:
    return InputError(
        f"the ball lifts off the plane at t = {t:.9g} s, where its rolling ends; shorten the "
        "motion, or move the bodies more gently"
    )


def _held(told: Told) -> float:
    """What keeps a shell from rolling [N m]."""
    return float(np.linalg.norm(told.plane_torque[:2]))


def _with_momentum(system: System, state: Array, told: Told) -> Array:
    """The state with the M of what it is told to do: while the shell stands M is not asked for."""
    scene, state = system.scene, state.copy()
    to_world = rotation_matrix(state[:4])
    angles = state[HINGES : HINGES + system.count]
    one = scene.robot.states(to_world[None, 2], angles[None], told.omega[None], told.rates[None])
    state[MOMENTUM : MOMENTUM + 3] = to_world @ one.momentum(scene.rolling)[0]
    return state
