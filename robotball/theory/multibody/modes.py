"""Modes of a robot and the events that end them.

While the modes stay, the derivative is a smooth function of the state. An event is the zero of a
margin, which is positive while the modes stay and about 1 far from an event: the ball lifts off, a
joint reaches an end of its range, a motor reaches or leaves its torque limit, the plane's
resistance to rolling no longer holds the shell, or the shell begins to slip.
"""

from operator import attrgetter

import numpy as np

from robotball.rotations import Array
from robotball.theory import friction
from robotball.theory.multibody.derivative import STANDING, Readings
from robotball.theory.multibody.system import System
from robotball.theory.plane import lift_off

# The index of this margin; its event ends the rolling. The ranges of joints follow, which end the
# motion, then the limited motors, a standing shell, and a sticking one.
_LIFT_OFF = 0


def margins_of(system: System, t: float, state: Array) -> Array:
    """Return the margins of all events at time t [s]."""
    readings = system.readings(t, state)
    scene, modes = system.scene, system.modes
    weight = scene.ball.mass * scene.gravity
    margins = [readings.normal / weight]
    for i, (_, low, high) in system.ranges:
        margins.append(1 - abs(2 * state[i] - low - high) / (high - low))
    for j in system.limited:
        part = readings.unlimited[j] / system.limits[j]
        margins.append(1 - abs(part) if modes.motors[j] == 0 else modes.motors[j] * part - 1)
    if modes.standing:
        margins.append(1 - _holding_torque(readings) / (system.resistance * readings.normal))
    if system.slips and not modes.slipping:
        margins.append(1 - friction.grip(system, readings))
    return np.array(margins)


def begin_modes(system: System, t: float, state: Array) -> Array:
    """Set the modes of a smooth piece that begins at t [s], and return the state in them."""
    # The motors come first, because the load on the plane depends on their torques.
    if system.limited:
        modes, unlimited = system.modes, system.readings(t, state).unlimited
        sides = np.where(np.abs(unlimited) > system.limits, np.sign(unlimited), 0.0)
        if (sides != modes.motors).any():
            system.modes = modes._replace(motors=sides.astype(np.int64))
    readings = system.readings(t, state)
    if not readings.normal > 0:
        raise lift_off(t)
    return friction.begin(system, t, hold_at_rest(system, t, state, readings))


def switch_modes(system: System, t: float, state: Array, event: int) -> Array:
    """Set the modes that follow an event at t [s], and return the state in them."""
    readings, modes = system.readings(t, state), system.modes
    if event == _LIFT_OFF:
        raise lift_off(t)
    event -= 1 + len(system.ranges)
    if event >= len(system.limited):
        stands = modes.standing and event == len(system.limited)
        return _let_go(system, t, state) if stands else friction.slide(system, t, state)
    j = system.limited[event]
    motors = modes.motors.copy()
    motors[j] = int(np.sign(readings.unlimited[j])) if modes.motors[j] == 0 else 0
    system.modes = modes._replace(motors=motors)
    return state


def hold_at_rest(system: System, t: float, state: Array, readings: Readings) -> Array:
    """Set whether the plane holds a shell that has come to rest, and return the state."""
    modes = system.modes
    if not system.resistance or modes.standing:
        return state
    if np.linalg.norm(readings.rolling) > STANDING:
        system.modes = modes._replace(standing=False, toward=np.zeros(3))
        return state
    system.modes = modes._replace(standing=True, toward=np.zeros(3))
    at_rest = system.readings(t, state)
    if _holding_torque(at_rest) <= system.resistance * at_rest.normal:
        # This drops the residual rolling velocity.
        return friction.with_momenta(system, t, state, system.numbers(t, state))
    # The shell has just begun to roll, and is still slower than STANDING.
    if np.any(modes.toward):
        system.modes = modes
        return state
    return _let_go(system, t, state)


def _let_go(system: System, t: float, state: Array) -> Array:
    """Set the mode of a standing shell that begins to roll, and return the state.

    If the load grows, the direction stays opposite to the holding torque.
    """
    readings = system.readings(t, state)
    state = friction.with_momenta(system, t, state, system.numbers(t, state))
    system.modes = modes = system.modes._replace(standing=False, toward=np.zeros(3))
    toward = -readings.plane_torque * [1.0, 1.0, 0.0] / _holding_torque(readings)
    friction.find_direction(
        system, t, state, lambda d: modes._replace(toward=d), attrgetter("rolling"), toward
    )
    return state


def _holding_torque(readings: Readings) -> float:
    """Return the horizontal torque [N m] with which the plane holds a standing shell."""
    return float(np.linalg.norm(readings.plane_torque[:2]))
