"""Stick and slip of the shell on a plane with finite friction.

The slip velocity v = (v_X, v_Y, σ) is the velocity of the shell's point at the contact [m/s] and,
in the rubber model, the shell's spin about the vertical [rad/s], both relative to the plane.
W = diag(μ, μ, μ_t) has the sliding coefficient μ and the torsional coefficient μ_t [m]. A component
without a coefficient cannot slip.

* Stick: v = 0, as long as the friction f keeps |W⁻¹f| <= N, with N the normal force.
* Slip: f = -N W²v/|Wv|, the force in the cone with maximum dissipation. For W = μ this is Coulomb's
  law.

While the shell slips, the state also has the horizontal momentum P, and in the rubber model it has
L in place of M.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from robotball.errors import InputError
from robotball.robot.scene import Scene
from robotball.rotations import Array, rotation_matrix
from robotball.theory.multibody.derivative import (
    HINGES,
    MOMENTUM,
    POINT,
    Modes,
    Readings,
    readings_of,
)
from robotball.theory.multibody.slip_steps import NUDGE, SlipSteps
from robotball.theory.multibody.system import System

_FREE = np.zeros((1, 1, 3))  # `Modes.ahead` of a shell whose friction opposes its slip
_STOPPED = 1e-8  # m/s, of |Wv|: a slower slip ends within a step of Euler
# Slip is stiff if the direction of friction settles within _SETTLES seconds, and if the slip speed
# changes slower by a factor of _SLOW.
_SETTLES, _SLOW = 1e-2, 3.0
SLIP_RTOL = 1e-13  # relative error of a step during slip; with a larger one, steps miss slip's end
_LEAST_LOAD = 1e-300  # N, in place of a load of 0: root finding needs a finite grip
_ITERATIONS, _ALIKE = 30, 1e-9  # iterations to find a direction, and the last change of it
_MOST_EVENTS = 5000  # changes between stick and slip; more are chatter


def is_stiff(system: System, speed: float, rate: float) -> bool:
    """Return whether slip is stiff for its |Wv| [m/s] and the derivative of |Wv| [m/s²]."""
    # `settling` is about the largest change of W dv/dt if friction turns, for an inertia of m/3.
    a, scene = system.scene.ball.radius, system.scene
    settling = 3 * scene.gravity * max((system.weights / [1.0, 1.0, a]).tolist()) ** 2
    return speed < _SETTLES * settling and abs(rate) < settling / _SLOW


def slip_speed(system: System, readings: Readings) -> float:
    """Return |Wv| [m/s], with 0 for components that cannot slip."""
    return math.hypot(*(system.weights * readings.slip).tolist())


def grip(system: System, readings: Readings) -> float:
    """Return |W⁻¹f|/N of a sticking shell: the friction as a fraction of its limit."""
    load = readings.normal or _LEAST_LOAD
    return float(np.linalg.norm(_friction(readings) / system.friction)) / load


def _friction(readings: Readings) -> Array:
    return np.array([*readings.force[:2], readings.plane_torque[2]])


def begin(system: System, t: float, state: Array) -> Array:
    """At the start of a smooth piece, let the shell slip if friction cannot hold it."""
    if not system.slips or system.modes.slipping:
        return state
    return slide(system, t, state) if grip(system, system.readings(t, state)) > 1 else state


def follow(
    system: System, t: float, end: float, state: Array, readings: Readings
) -> tuple[float, Array]:
    """Return time and state after a step of a slipping shell; both are unchanged if it slips on.

    If the slip ends soon, they are those at its end. end: of the smooth piece [s].
    """
    if not readings.normal > 0:
        raise InputError(
            f"{system.scene.name}: the ball lifts off the plane or is jammed by its friction at "
            f"t = {t:.9g} s: shorten the motion, or lower friction.sliding"
        )
    if slip_speed(system, readings) > _STOPPED:
        return t, state
    slip = SlipSteps(system, t, end, state)
    if slip.left == np.inf:
        return t, state
    left = min(slip.left, end - t)
    return t + left, _stick(system, t + left, state + left * slip.derivative)


def _stick(system: System, t: float, state: Array) -> Array:
    """Set the mode of a shell that ceases to slip, and return the state."""
    # Friction ends the slip with an impulse at the contact, which changes neither L nor the momenta
    # along the hinges.
    held = state.copy()
    if system.spins:
        for row in _rows(system, held):
            row[MOMENTUM : MOMENTUM + 3] = across(row[MOMENTUM : MOMENTUM + 3])
    system.modes = system.modes._replace(slipping=False, ahead=_FREE)
    if grip(system, system.readings(t, held)) > 1:
        if len(system.scenes) > 1:
            # The slip of neighbouring robots turns at other times, at which their forces jump.
            raise InputError(f"{system.scene.name}: its slip turns at t = {t:.6g} s")
        return slide(system, t, held)
    _record(system, t, slips=False)
    return held


def slide(system: System, t: float, state: Array) -> Array:
    """Set the mode of a sticking shell that begins to slip, and return the state.

    If the friction reaches its limit continuously, the direction of Wv stays -W⁻¹f/|W⁻¹f|.
    """
    toward = -_friction(system.readings(t, state)) / system.friction
    numbers = system.numbers(t, state)
    system.modes = system.modes._replace(slipping=True, ahead=_FREE)
    state = with_momenta(system, t, state, numbers)
    toward /= np.linalg.norm(toward)
    modes = system.modes
    find_direction(
        system,
        t,
        state,
        lambda d: modes._replace(ahead=d.reshape(1, 1, 3)),
        lambda r: system.weights * r.slip,
        toward,
    )
    _record(system, t, slips=True)
    return state


def find_direction(
    system: System,
    t: float,
    state: Array,
    modes_of: Callable[[Array], Modes],
    motion_of: Callable[[Readings], Array],
    guess: Array,
) -> None:
    """Set the modes to the direction in which a shell begins to slip or to roll.

    The plane's reaction is opposite to the direction d. The shell accelerates along d, so a short
    time later (`NUDGE`) its velocity is also parallel to d. `motion_of` gives this velocity, which
    is a + Cd with nearly constant a and C. guess: a unit vector.
    """

    def ahead(direction: Array) -> Array:
        system.modes = modes_of(direction)
        return motion_of(system.readings(t + NUDGE, state + NUDGE * system.rate(t, state)))

    C, direction, c = np.stack([(ahead(e) - ahead(-e)) / 2 for e in np.eye(3)], axis=1), guess, 0.0
    for _ in range(_ITERATIONS):
        # d = (c - C)⁻¹a. Solve 1/|d| = 1, which is nearly linear in c, with Newton's method.
        a, before = ahead(direction) - C @ direction, direction
        least = float(np.finfo(float).eps * np.linalg.norm(a))  # C may be singular
        inverse = np.linalg.inv(max(c, least) * np.eye(3) - C)
        d = inverse @ a
        length = float(np.linalg.norm(d))
        direction, c = d / length, max(c, least) + length**2 * (length - 1) / float(d @ inverse @ d)
        if np.abs(direction - before).max() < _ALIKE and (abs(length - 1) < _ALIKE or c < least):
            break
    system.modes = modes_of(direction)


def _record(system: System, t: float, *, slips: bool) -> None:
    system.slip_events.append((float(t), slips))
    if len(system.slip_events) > _MOST_EVENTS:
        raise InputError(
            f"{system.scene.name}: the shell changes between stick and slip {_MOST_EVENTS} times "
            f"until t = {t:.6g} s: shorten the motion, or remove the limits of friction"
        )


def slip_intervals(
    events: Sequence[tuple[float, bool]], scene: Scene, end: float
) -> tuple[tuple[float, float], ...]:
    """Return the intervals in which the shell slips up to `end` [s]."""
    begins = [0.0] if scene.start.slips else []
    intervals = []
    for t, slips in [*events, (end, False)]:
        if slips and not begins:
            begins.append(t)
        elif not slips and begins:
            intervals.append((begins.pop(), t))
    return tuple(intervals)


def _rows(system: System, state: Array) -> Array:
    """Return the states (k, size) of k robots as a view of the whole state."""
    return state.reshape(-1, system.size)


def across(L: Array) -> Array:
    """Return e_z×L for L (..., 3) in world axes: M of a rubber shell that sticks."""
    return np.cross([0.0, 0.0, 1.0], L)


def with_momenta(system: System, t: float, state: Array, numbers: Array) -> Array:
    """Return the state at t [s] with momenta computed from velocities, in the present modes.

    numbers: the numbers of the readings that have the velocities, a row for each scene. The
    readings may be from other modes.
    """
    state = state.copy()
    for scene, row, values in zip(system.scenes, _rows(system, state), numbers, strict=True):
        readings = readings_of(values, system.count)
        moved = readings.slip + scene.plane_velocity(t, row[POINT:MOMENTUM])
        moved[2] = 0.0  # ω has the spin
        _write_momenta(system, scene, row, readings.omega, readings.rates, moved)
    return state


def _write_momenta(
    system: System, scene: Scene, state: Array, omega: Array, rates: Array, slip: Array
) -> None:
    """Write the momenta of velocities into a robot's state, in the present modes.

    omega: of the carrier, in its axes [rad/s]; rates (h,); slip (3,): of the shell's point at the
    contact along X and Y [m/s], and a spin that is not included in omega [rad/s].
    """
    count = system.count
    to_world, angles = rotation_matrix(state[:4]), state[HINGES : HINGES + count]
    one = scene.robot.states(to_world[None, 2], angles[None], omega[None], rates[None])
    moved, spin = to_world[:2].T @ slip[:2], slip[2] * to_world[2]
    pushes = one.pushes[:, :, 0]
    momenta = one.momenta[:, 0] + moved @ pushes + one.matrix[:, :3, 0] @ spin
    P = pushes @ one.u[:, 0] + pushes[:, :3] @ spin + scene.ball.mass * moved
    L = to_world @ momenta[:3]
    keeps = scene.rolling == "rubber" and not system.spins
    state[MOMENTUM : MOMENTUM + 3] = across(L) if keeps else L
    state[HINGES + count : HINGES + 2 * count] = np.where(system.free, momenta[3:], 0.0)
    if system.slips:
        state[HINGES + 3 * count : HINGES + 3 * count + 2] = to_world[:2] @ P


def start_state(system: System) -> Array:
    """Return the state at the start of the scene, which may slip."""
    state = system.start()
    if system.slips:
        system.modes = system.modes._replace(slipping=system.scene.start.slips)
        for scene, row in zip(system.scenes, _rows(system, state), strict=True):
            omega, rates = scene.angular_velocity_at(scene.start), scene.hinged[1, 0]
            _write_momenta(system, scene, row, omega, rates, scene.start_slip)
    return state
