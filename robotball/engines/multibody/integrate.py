"""Integrate the ideal rolling of any robot to round-off: Scene → Motion.

A motion is smooth between its breakpoints and its events, and DOP853 steps along each piece. Events
are the zeros of margins, each positive while the modes stay: a motor reaches its torque limit or
leaves it, the plane's resistance to rolling holds the shell no more, the ball lifts off. A margin
is 1 where what it is of is farthest from its end.

A step over an event is taken back: one that ends there takes its place, and the motion begins anew.
"""

from dataclasses import dataclass, field, fields, replace
from importlib.metadata import version

import numpy as np
from scipy.optimize import brentq

from robotball.drives import turns
from robotball.engines.dop853 import LEAST_RTOL, Compensated
from robotball.engines.multibody.system import (
    FORCE,
    HINGES,
    LOSS,
    MOMENTUM,
    OMEGA,
    PLANE_TORQUE,
    POINT,
    STANDING,
    TOLD,
    Modes,
    System,
    Told,
)
from robotball.errors import InputError, too_many_steps, warn
from robotball.motion import Label, Loads, Motion, ReferenceMotion
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Scene

LABEL = Label("multibody equations", version("robotball"), "#D55E00")  # the equations' vermillion


LIFT_OFF = 0  # the margin that no mode comes after; the motors' follow, then the standing shell's
NUDGE, NUDGES = 1e-6, 30  # s, and how often: which way a shell goes that begins to roll


def margins_of(system: System, told: Told) -> Array:
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


LOOKS = 4  # within a step, for an event that comes and goes
PRESSED = 0.5  # of the weight: a ball that is pressed so hard at both ends of a step stays down
ROOT = 1e-15  # s, and relative: how near to its time an event is found


@dataclass
class March:
    """A system along a motion up to `end` [s], which may have so many steps in all.

    switches: the times of the events that it met.
    """

    system: System
    rtol: float
    end: float
    max_steps: int
    steps: int = 0
    switches: list[float] = field(default_factory=list)

    def run(self, times: Array) -> tuple[Array, Array]:
        """States (n, size) at times (n,), increasing from 0, and what is told of them (n, told).

        Raises InputError where the ball lifts off, the limit is met or a step shrinks to nothing.
        """
        system = self.system
        samples = Samples(system, times)
        state, t = begin(system, 0.0, system.start()), 0.0
        samples.add(0.0, state[None])
        for end in (*(t for t in system.scene.breakpoints if t < times[-1]), float(times[-1])):
            system.end = float(np.nextafter(end, t))
            state = begin(system, t, state)
            while t < end:
                t, state = self._piece(t, end, state, samples)
        return samples.states, samples.told

    def _piece(self, t: float, end: float, state: Array, samples: "Samples") -> tuple[float, Array]:
        """To the next event or to the end of the smooth span: the time and the state there."""
        system = self.system
        solver = self._solver(t, end, state)
        margins = margins_of(system, system.told(t, state))
        while solver.running:
            before = (solver.t, solver.state)
            self._step(solver)
            event, margins = self._event(solver, before[0], margins)
            samples.add(solver.t if event is None else event[0], solver)
            if event is not None:
                t, which = event
                self.switches.append(t)
                return t, switch(system, t, self._at(before, t), which)
            if system.resistance and not system.modes.standing:
                told = system.told(solver.t, solver.state)
                state = stand(system, solver.t, solver.state, told)
                if system.modes.standing:
                    return solver.t, state
        return solver.t, solver.state

    def _event(
        self, solver: Compensated, before: float, margins: Array
    ) -> tuple[tuple[float, int] | None, Array]:
        """The first event of the last step, as its time and margin, if any; the margins after."""
        system = self.system
        after = margins_of(system, system.told(solver.t, solver.state))
        if len(after) == 1 and min(margins[0], after[0]) > PRESSED:
            return None, after
        looks = np.linspace(before, solver.t, LOOKS + 2)

        def margin(t: float, which: int) -> float:
            state = solver.within(np.array([t]))[0]
            return float(margins_of(system, system.told(t, state))[which])

        seen = [margins]
        seen += [
            margins_of(system, system.told(t, state))
            for t, state in zip(looks[1:-1], solver.within(looks[1:-1]), strict=True)
        ]
        seen.append(after)
        found: list[tuple[float, int]] = []
        for which in range(len(after)):
            for i in range(1, len(looks)):
                if seen[i][which] >= 0:
                    continue
                begin, end = float(looks[i - 1]), float(looks[i])
                # A margin that has just begun is 0 but for rounding, of either sign.
                if margin(begin, which) > 0:
                    begin = brentq(margin, begin, end, args=(which,), xtol=ROOT, rtol=4 * ROOT)
                found.append((begin, which))
                break
        return (min(found) if found else None), after

    def _solver(self, begin: float, end: float, state: Array) -> Compensated:
        return Compensated(self.system.rate, (begin, end), state, self.rtol, self.system.scale)

    def _step(self, solver: Compensated) -> None:
        if self.steps >= self.max_steps:
            speed = 2 * float(np.linalg.norm(solver.derivative[:4]))  # dq/dt = q∘ω/2
            raise too_many_steps(self.max_steps, solver.t, self.end, speed)
        message = solver.step()
        self.steps += 1
        if message is not None:
            raise InputError(
                f"the equations could not be integrated past t = {solver.t:g} s: {message}"
            )

    def _at(self, before: tuple[float, Array], t: float) -> Array:
        """The state at t in the last step, by steps that end there."""
        if t <= before[0]:
            return before[1]
        solver = self._solver(before[0], t, before[1])
        while solver.running:
            self._step(solver)
        return solver.state


class Samples:
    """The states at the times of a motion, and what is told of them, as a march comes by."""

    def __init__(self, system: System, times: Array) -> None:
        self.system, self.times, self.done = system, times, 0
        self.states = np.empty((len(times), system.size))
        self.told = np.empty((len(times), system.told_size))

    def add(self, reached: float, solver: Compensated | Array) -> None:
        """Those up to the time reached [s], in the solver's last step or the one state there."""
        new = slice(self.done, int(np.searchsorted(self.times, reached, side="right")))
        if new.start < new.stop:
            times = self.times[new]
            self.states[new] = solver.within(times) if isinstance(solver, Compensated) else solver
            for i, t in enumerate(times.tolist(), start=new.start):
                self.told[i] = self.system.told(t, self.states[i]).numbers
            self.done = new.stop


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
