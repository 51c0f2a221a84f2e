"""Integration of a system from event to event.

A motion is smooth between its breakpoints and its events, and DOP853 steps along each smooth piece.
If a step extends over an event, shorter steps that end at the event replace this step. The next
piece begins in the modes that follow the event.
"""

from dataclasses import dataclass, field
from functools import partial
from operator import attrgetter

import numpy as np

from robotball.motion import Progress
from robotball.robot.loop import Loop, TrueReading
from robotball.rotations import Array
from robotball.theory import friction
from robotball.theory.dop853 import Compensated, Steps, take_step
from robotball.theory.multibody.derivative import HINGES, MOMENTUM, POINT, STANDING, Modes, Readings
from robotball.theory.multibody.slip_steps import SlipSteps
from robotball.theory.multibody.system import System
from robotball.theory.plane import lift_off

_LEEWAY = 1.08  # times scipy's proposed step, which is 0.9 of the step that the error allows
_LOOKS = 4  # times in a step at which margins are evaluated, to find an event that ends within it
# No event is searched in a step if a margin is larger than this, and than twice its change, at both
# ends of the step: a step is short compared with the time in which a margin turns back.
_FAR = 0.1
_ROOT = 1e-15  # s, and relative: the tolerance of an event's time
# The index of this margin, whose event ends the rolling. After it come the margins of the ranges of
# joints, which end the motion, of the limited motors, of a standing shell, and of a sticking shell.
_LIFT_OFF = 0


@dataclass
class March:
    """Integrate a system up to a time.

    Attributes
    ----------
    system : System
        The robots, with their modes now.
    rtol : float
        The relative error allowed in one step.
    end : float, s
        The time of the motion's end.
    max_steps : int
        The largest number of steps.
    progress : callable or None
        Called with the fraction of the motion that is complete.
    loop : Loop or None
        The loop of the scene's controller.
    natural : float or None, s
        The longest step that the error permitted in the last piece.
    stiff : bool
        Whether a shell slips in such a way that the equations are stiff.
    steps : int
        The number of steps so far.
    switches : list of float, s
        The times of the events so far.
    stopped : (float, int) or None
        The time [s] and the margin of the event that ended the motion.
    """

    system: System
    rtol: float
    end: float
    max_steps: int
    progress: Progress | None = None
    loop: Loop | None = None
    natural: float | None = None
    stiff: bool = False
    steps: int = 0
    switches: list[float] = field(default_factory=list)
    stopped: tuple[float, int] | None = None

    def run(self, times: Array) -> tuple[Array, Array]:
        """Return states (n, size) at times (n,), increasing from 0, and the numbers of readings.

        There are fewer states if a joint's range ends the motion. Raises InputError if the ball
        lifts off, if the limit of steps is reached, or if a step becomes too short.
        """
        system = self.system
        samples = _Samples(system, times)
        state, t = friction.start_state(system), 0.0
        for end in (*(t for t in system.scene.breakpoints if t < times[-1]), float(times[-1])):
            if self.loop is not None:
                self.loop.reach(t, partial(self._sensed, t, state))
            system.begin(t, end)
            state = _begin_modes(system, t, state)
            if not samples.done:
                samples.add(0.0, state[None])
            while t < end and not self.stopped:
                t, state = self._piece(t, end, state, samples)
            if self.stopped:
                break
        return samples.states[: samples.done], samples.readings[: samples.done]

    def _sensed(self, t: float, state: Array) -> TrueReading:
        """Return the sensor values of a state at t [s]."""
        readings, count = self.system.readings(t, state), self.system.count
        attitude, point = state[:4] / np.linalg.norm(state[:4]), state[POINT:MOMENTUM].copy()
        angles, rates = state[HINGES : HINGES + count].tolist(), readings.rates.tolist()
        return TrueReading(readings.omega, attitude, angles, rates, point)

    def _piece(
        self, t: float, end: float, state: Array, samples: "_Samples"
    ) -> tuple[float, Array]:
        """Integrate to the next event or to `end` [s]. Returns the time and the state there."""
        system = self.system
        solver = self._solver(t, end, state)
        margins, longest = _margins_of(system, t, state), 0.0
        speed = friction.slip_speed(system, system.readings(t, state))
        while solver.t < end:
            before = (solver.t, solver.state, system.modes)
            self.steps = take_step(solver, self.steps, self.max_steps, self.end, self.progress)
            event, margins = self._event(solver, before[0], margins)
            samples.add(solver.t if event is None else event[0], solver)
            if event is not None:
                t, margin = event
                if 0 < margin <= len(system.ranges):
                    self.stopped = event
                    return t, state
                self.switches.append(t)
                # Steps end at the event: the interpolant is of order 7 only, and its error would
                # stay in the rest of the motion.
                return t, _switch_modes(system, t, self._at(before, t), margin)
            longest = max(longest, solver.next_step)
            # When a shell comes to rest, no margin changes its sign, so every step is checked.
            if system.resistance and not system.modes.standing:
                readings = system.readings(solver.t, solver.state)
                state = _hold_at_rest(system, solver.t, solver.state, readings)
                if system.modes.standing:
                    return solver.t, state
            if system.modes.slipping:
                readings = system.readings(solver.t, solver.state)
                last, speed = speed, friction.slip_speed(system, readings)
                rate = (speed - last) / (solver.t - before[0])
                self.stiff = friction.is_stiff(system, speed, rate)
                t, state = friction.follow(system, solver.t, end, solver.state, readings)
                if t > solver.t:
                    samples.add(t, state[None])
                if state is not solver.state or self.stiff != isinstance(solver, SlipSteps):
                    return t, state.copy()
        self.natural = longest
        return solver.t, solver.state

    def _event(
        self, solver: Steps, before: float, margins: Array
    ) -> tuple[tuple[float, int] | None, Array]:
        """Return time and margin of the last step's first event, and the margins after that."""
        system = self.system
        after = _margins_of(system, solver.t, solver.state)
        if (np.minimum(margins, after) > _FAR + 2 * np.abs(after - margins)).all():
            return None, after
        looks = np.linspace(before, solver.t, _LOOKS + 2)

        def margin(t: float, index: int) -> float:
            state = solver.within(np.array([t]))[0]
            return float(_margins_of(system, t, state)[index])

        inside = zip(looks[1:-1], solver.within(looks[1:-1]), strict=True)
        rows = [margins, *(_margins_of(system, t, state) for t, state in inside), after]
        events: list[tuple[float, int]] = []
        for index in range(len(after)):
            for i in range(1, len(looks)):
                if rows[i][index] >= 0:
                    continue
                begin, end = float(looks[i - 1]), float(looks[i])
                # The margin of a mode that has just begun is 0 up to rounding, with either sign.
                if margin(begin, index) > 0:
                    from scipy.optimize import brentq  # late: many motions have no event

                    begin = brentq(margin, begin, end, args=(index,), xtol=_ROOT, rtol=4 * _ROOT)
                events.append((begin, index))
                break
        return (min(events) if events else None), after

    def _solver(self, begin: float, end: float, state: Array) -> Steps:
        system = self.system
        if np.any(system.modes.ahead) or (system.modes.slipping and self.stiff):
            return SlipSteps(system, begin, end, state)
        rtol = min(self.rtol, friction.SLIP_RTOL) if system.modes.slipping else self.rtol
        solver = Compensated(system.stages, begin, end, state, rtol, system.scale)
        if system.holds and self.natural is not None:
            # Take equal steps of about the length in the last piece. Searching for the length of
            # the first step after each of many commands would take as long as the motion.
            count = float(np.ceil((end - begin) / (_LEEWAY * self.natural)))
            solver.next_step = (end - begin) / count
        return solver

    def _at(self, before: tuple[float, Array, Modes], t: float) -> Array:
        """Return the state at t in the last step, from steps that end there."""
        begin, state, modes = before
        if t <= begin:
            self.system.modes = modes
            return state
        now, self.system.modes = self.system.modes, modes
        solver = self._solver(begin, t, state)
        solver.next_step = t - begin  # not longer than the step that was taken
        while solver.t < t:
            self.steps = take_step(solver, self.steps, self.max_steps, self.end, self.progress)
        self.system.modes = now
        return solver.state


class _Samples:
    """States and readings at the sample times, filled as the integration proceeds."""

    def __init__(self, system: System, times: Array) -> None:
        self.system, self.times, self.done = system, times, 0
        self.states = np.empty((len(times), len(system.scenes) * system.size))
        self.readings = np.empty((len(times), len(system.scenes) * system.readings_size))

    def add(self, reached: float, solver: Steps | Array) -> None:
        """Add the samples up to `reached` [s], from the solver's last step or from one state."""
        new = slice(self.done, int(self.times.searchsorted(reached, side="right")))
        if new.start < new.stop:
            times = self.times[new]
            self.states[new] = solver if isinstance(solver, np.ndarray) else solver.within(times)
            for i, t in enumerate(times.tolist(), start=new.start):
                self.readings[i] = self.system.numbers(t, self.states[i]).ravel()
            if self.system.spins:  # the states have L in place of M = γ×L
                for states in np.split(self.states[new], len(self.system.scenes), axis=1):
                    L = states[:, MOMENTUM : MOMENTUM + 3]
                    L[:] = friction.across(L)
            self.done = new.stop


def _margins_of(system: System, t: float, state: Array) -> Array:
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


def _begin_modes(system: System, t: float, state: Array) -> Array:
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
    return friction.begin(system, t, _hold_at_rest(system, t, state, readings))


def _switch_modes(system: System, t: float, state: Array, event: int) -> Array:
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


def _hold_at_rest(system: System, t: float, state: Array, readings: Readings) -> Array:
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

    If the load increases, the direction stays opposite to the holding torque.
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
