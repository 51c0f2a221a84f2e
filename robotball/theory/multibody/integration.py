"""Our own ideal rolling of any robot: Scene → Motion, integrated to round-off.

The derivative is that of system.py. A motion is smooth between its breakpoints and its events, and
DOP853 steps along each piece. Events are the zeros of margins, each positive while the modes stay:
a motor reaches its torque limit or leaves it, the plane's resistance to rolling holds the shell no
more, the ball lifts off, a joint reaches its range, where the motion ends. A margin is scaled to be
1 where it is farthest from zero.

A step over an event is taken back: one that ends there takes its place, and the motion begins anew
in the next modes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version

import numpy as np
from scipy.optimize import brentq

from robotball.errors import InputError, warn
from robotball.motion import (
    Label,
    Motion,
    Progress,
    ReferenceMotion,
    extended,
)
from robotball.robot.drives import turns
from robotball.robot.loads import Loads
from robotball.robot.loop import Loop, TrueReading
from robotball.robot.scene import Scene
from robotball.rotations import Array, rotation_matrix
from robotball.theory.dop853 import LEAST_RTOL, Compensated, take_step
from robotball.theory.multibody.derivative import (
    HINGES,
    LOSS,
    MOMENTUM,
    POINT,
    STANDING,
    Modes,
    Readings,
    readings_of,
)
from robotball.theory.multibody.system import System
from robotball.theory.plane import lift_off

# The equations' vermillion.
LABEL = Label("multibody equations", version("robotball"), "#D55E00", "P")

_MAX_STEPS = 1_000_000  # ten minutes, where motors settle so fast that they set the step
_MANY_STEPS = 100_000  # a minute
_SECONDS = 6e-4  # s that such a step takes, and one of the motion that estimates the error
_STABLE = 6.3  # over the rate at which anything settles: the longest step of DOP853
_DIFFERENCE = 1e-6  # of a state's scale, by which its Jacobian is taken
# Times the error of a step, of the motion by which its own error is estimated: its steps are longer
# by a fifth, so that no two of them round alike.
_COARSER = 4.0


def integrate(
    scene: Scene,
    times: Array,
    rtol: float = LEAST_RTOL,
    max_steps: int | None = None,
    progress: Progress | None = None,
) -> ReferenceMotion:
    """Integrate the motion of any robot that rolls, with an estimate of its error.

    times: (n,) s, increasing from 0; rtol: the error allowed in one step; max_steps: a limit;
    progress: called with the fraction of the motion that is known. Where a joint reaches its range
    the motion ends, with a warning and fewer times. Raises InputError where the ball lifts off,
    where a step shrinks to nothing, where the limit is met, and where it would be because the
    motors settle too fast.
    """
    limit = _MAX_STEPS if max_steps is None else max_steps
    ours = scene.until(float(times[-1]))
    _check_rates(ours, float(times[-1]), limit, progress)

    def march(allowed: float) -> March:
        # A system and a loop of its own each time, as they change on the way.
        loop = None if ours.controller is None else Loop(ours, ours.controller)
        system = System(loop.scene if loop else ours)
        return March(system, allowed, float(times[-1]), limit, progress, loop)

    def again() -> Array:
        coarser = march(_COARSER * rtol)
        coarser.system.ranges = []  # whose ends may come a rounding earlier
        return coarser.run(times)[0][:, POINT:MOMENTUM]

    first = march(rtol)
    states, readings = first.run(times)
    times, ended = times[: len(states)], None
    if first.stopped:
        t, which = first.stopped
        at, (joint, *ends) = first.system.ranges[which - 1]
        slides = scene.ball.tree[1 + at - HINGES].slides
        low, high = ends if slides else np.degrees(ends)
        unit = "m" if slides else "deg"
        allowed = f"{low:g} to {high:g} {unit}"
        ended = f"{joint} reaches its range of {allowed} at t = {t:.6g} s"
        if not t > 0:
            raise InputError(
                f"{scene.name}: {joint} starts at its stop, an end of {allowed}, and is pushed "
                "against it; widen its range, or start it elsewhere"
            )
        if len(times) < 2:
            raise InputError(
                f"{scene.name}: {ended}, before the first sample; widen its range, or sample more "
                "often"
            )
        warn(f"{scene.name}: {ended}, where the motion ends")
    hinges = len(scene.hinges)
    return extended(
        _motion_of(ours, times, states, readings_of(readings, hinges)),
        ReferenceMotion,
        scene=scene,
        again=again,
        motor_work=states[:, HINGES + 2 * hinges : HINGES + 3 * hinges],
        rolling_loss=states[:, LOSS],
        plane_work=states[:, -1] if scene.plane_moves else None,
        ended=ended,
    )


def integrate_together(scenes: Sequence[Scene], times: Array, rtol: float) -> list[Motion]:
    """Integrate robots whose numbers differ a little by the same steps, in the first one's modes.

    So the motions differ by the numbers alone, and not by the steps, and derivatives by differences
    are as exact as these are small. They are right where modes change too, as forces are
    continuous there. The scenes have no controller, and the first one's breakpoints. Raises
    InputError as `integrate` does.
    """
    end = float(times[-1])
    ours = [scene.until(end) for scene in scenes]
    march = March(System(*ours), rtol, end, _MAX_STEPS)
    states, readings = (np.split(each, len(ours), axis=1) for each in march.run(times))
    hinges, times = len(ours[0].hinges), times[: len(states[0])]
    return [
        _motion_of(scene, times, own, readings_of(read, hinges))
        for scene, own, read in zip(ours, states, readings, strict=True)
    ]


def _check_rates(scene: Scene, duration: float, limit: int, progress: Progress | None) -> None:
    """Raise InputError where the motors settle too fast for so many steps; warn of many."""
    if not any(hinge.motor for hinge in scene.hinges):
        return
    rate = _fastest(System(scene), progress)
    steps = rate * duration / _STABLE
    if steps > _MANY_STEPS:
        line = (
            f"{scene.name}: its motors settle at {rate:.3g} 1/s, so {duration:g} s take at least "
            f"{steps:.2g} steps, some {steps * _SECONDS / 60:.2g} min; lower the gains, raise the "
            "armatures, or prescribe the rates"
        )
        if steps > limit:
            raise InputError(f"{line} (max_steps = {limit})")
        warn(line)


def _fastest(system: System, progress: Progress | None) -> float:
    """Return the largest |λ| [1/s] of the Jacobian at the start, motors below their limits."""
    # At rest resistance is not smooth, and has no Jacobian.
    system.machine.resistance[:] = 0.0
    state, end = system.start(), HINGES + 2 * system.count
    # Neither place nor work changes a rate.
    changing = np.r_[:POINT, MOMENTUM:LOSS, HINGES:end]
    sides = []
    for step in np.diag(_DIFFERENCE * system.scale)[changing]:
        change = system.rate(0.0, state + step) - system.rate(0.0, state - step)
        sides.append(change[changing] / (2 * step.max()))
        # As hundreds of hinges take half a minute; not before the first, which may compile.
        if progress is not None:
            progress(0.0)
    if not np.isfinite(sides).all():
        raise InputError(
            f"{system.scene.name}: its equations have no finite solution at the start; see that "
            "all masses are in kg, lengths in m, and not too different"
        )
    return float(np.abs(np.linalg.eigvals(np.array(sides))).max())


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


# The place of this margin, after which there is no mode. Joints' ranges follow, after which the
# motion ends, then motors, then a standing shell.
_LIFT_OFF = 0
# s, and how often: a shell that begins to roll is looked at so far ahead to find its direction.
_NUDGE, _NUDGES = 1e-6, 30


def _margins_of(system: System, t: float, state: Array) -> Array:
    """Return the margins: lifting off, joints' ranges, limited motors, a shell that stands."""
    readings = system.readings(t, state)
    scene, modes = system.scene, system.modes
    weight = scene.ball.mass * scene.gravity
    found = [readings.normal / weight]
    for i, (_, low, high) in system.ranges:
        found.append(1 - abs(2 * state[i] - low - high) / (high - low))
    for j in system.limited:
        part = readings.unlimited[j] / system.limits[j]
        found.append(1 - abs(part) if modes.motors[j] == 0 else modes.motors[j] * part - 1)
    if modes.standing:
        found.append(1 - _held(readings) / (system.resistance * readings.normal))
    return np.array(found)


def _begin(system: System, t: float, state: Array) -> Array:
    """Set the modes in which a piece begins at t [s]. Returns the state as it is in them."""
    # First the motors' sides, as the load on the plane depends on their torques.
    if system.limited:
        modes, unlimited = system.modes, system.readings(t, state).unlimited
        sides = np.where(np.abs(unlimited) > system.limits, np.sign(unlimited), 0.0)
        if (sides != modes.motors).any():
            system.modes = modes._replace(motors=sides.astype(np.int64))
    readings = system.readings(t, state)
    if not readings.normal > 0:
        raise lift_off(t)
    return _stand(system, t, state, readings)


def _stand(system: System, t: float, state: Array, readings: Readings) -> Array:
    """Set whether the plane's resistance holds a shell that does not roll. Returns the state."""
    modes = system.modes
    if not system.resistance or modes.standing:
        return state
    if np.linalg.norm(readings.rolling) > STANDING:
        system.modes = Modes(modes.motors)
        return state
    system.modes = Modes(modes.motors, standing=True)
    held = system.readings(t, state)
    if _held(held) <= system.resistance * held.normal:
        return _with_momentum(system, t, state)  # without the last of the rolling
    # It was let go just now, and does not roll faster than STANDING yet.
    if np.any(modes.toward):
        system.modes = modes
        return state
    return _let_go(system, t, state)


def _let_go(system: System, t: float, state: Array) -> Array:
    """Set the mode of a shell that stands no more and begins to roll. Returns the state.

    Resistance is against the direction in which it will go, which depends on the resistance: d is
    found such that the acceleration with resistance against d is along d. The step towards it is
    damped by the acceleration without any, or it would overshoot. A load that grows leaves d where
    the shell was held.
    """
    readings = system.readings(t, state)
    state = _with_momentum(system, t, state)
    system.modes = Modes(system.modes.motors)

    def ahead() -> Array:
        return system.readings(t, state + _NUDGE * system.rate(t, state)).rolling

    free = ahead()
    toward = -readings.plane_torque * [1.0, 1.0, 0.0] / _held(readings)
    system.modes = system.modes._replace(toward=toward)
    for _ in range(_NUDGES):
        to = float(np.linalg.norm(free)) * system.modes.toward + ahead()
        if np.any(to):
            system.modes = system.modes._replace(toward=to / np.linalg.norm(to))
    return state


def _switch(system: System, t: float, state: Array, which: int) -> Array:
    """Set the modes that follow where a margin reaches zero at t. Returns the state in them."""
    readings, modes = system.readings(t, state), system.modes
    if which == _LIFT_OFF:
        raise lift_off(t)
    which -= 1 + len(system.ranges)
    if which >= len(system.limited):
        return _let_go(system, t, state)
    j = system.limited[which]
    motors = modes.motors.copy()
    motors[j] = int(np.sign(readings.unlimited[j])) if modes.motors[j] == 0 else 0
    system.modes = modes._replace(motors=motors)
    return state


def _held(readings: Readings) -> float:
    """Return the plane's horizontal torque [N m], which keeps a standing shell from rolling."""
    return float(np.linalg.norm(readings.plane_torque[:2]))


def _with_momentum(system: System, t: float, state: Array) -> Array:
    """Return the state with M recomputed from the velocities."""
    state = state.copy()
    rows, read = state.reshape(-1, system.size), system.numbers(t, state)
    for scene, row, numbers in zip(system.scenes, rows, read, strict=True):
        readings = readings_of(numbers, system.count)
        to_world, angles = rotation_matrix(row[:4]), row[HINGES : HINGES + system.count]
        one = scene.robot.states(
            to_world[None, 2], angles[None], readings.omega[None], readings.rates[None]
        )
        row[MOMENTUM : MOMENTUM + 3] = to_world @ one.momentum(scene.rolling)[0]
    return state


# Of the step that scipy proposes, which is 0.9 of the one that the error allows.
_LEEWAY = 1.08
_LOOKS = 4  # within a step, for an event that comes and goes between its ends
# Where all margins are larger at both ends of a step, no event is taken to lie between them, which
# saves most steps the looks.
_FAR = 0.5
_ROOT = 1e-15  # s, and relative: how near to its time an event is found


@dataclass
class March:
    """The integration of a system up to `end` [s], in at most `max_steps` steps.

    rtol: the error allowed in one; loop: of the scene's controller; natural: the longest step that
    the error asked for in the piece before [s], of a loop; switches: the times [s] of the events so
    far; stopped: the time and the margin of the one that ended the motion.
    """

    system: System
    rtol: float
    end: float
    max_steps: int
    progress: Progress | None = None
    loop: Loop | None = None
    natural: float | None = None
    steps: int = 0
    switches: list[float] = field(default_factory=list)
    stopped: tuple[float, int] | None = None

    def run(self, times: Array) -> tuple[Array, Array]:
        """Return states (n, size) at times (n,), increasing from 0, and their readings' numbers.

        They are fewer where the motion is stopped. Raises InputError where the ball lifts off, the
        limit is met or a step shrinks to nothing.
        """
        system = self.system
        samples = Samples(system, times)
        state, t = system.start(), 0.0
        for end in (*(t for t in system.scene.breakpoints if t < times[-1]), float(times[-1])):
            self._control(t, state)
            system.begin(t, end)
            state = _begin(system, t, state)
            if not samples.done:
                samples.add(0.0, state[None])
            while t < end and not self.stopped:
                t, state = self._piece(t, end, state, samples)
            if self.stopped:
                break
        return samples.states[: samples.done], samples.readings[: samples.done]

    def _control(self, t: float, state: Array) -> None:
        """Have the controller act where it is due at t [s]."""
        if self.loop is None:
            return

        def sense() -> TrueReading:
            readings, count = self.system.readings(t, state), self.system.count
            attitude, point = state[:4] / np.linalg.norm(state[:4]), state[POINT:MOMENTUM].copy()
            angles, rates = state[HINGES : HINGES + count].tolist(), readings.rates.tolist()
            return TrueReading(readings.omega, attitude, angles, rates, point)

        self.loop.reach(t, sense)

    def _piece(self, t: float, end: float, state: Array, samples: "Samples") -> tuple[float, Array]:
        """Go to the next event or the smooth span's end. Returns the time and the state there."""
        system = self.system
        solver = self._solver(t, end, state)
        margins, longest = _margins_of(system, t, state), 0.0
        while solver.t < end:
            before = (solver.t, solver.state)
            self.steps = take_step(solver, self.steps, self.max_steps, self.end, self.progress)
            event, margins = self._event(solver, before[0], margins)
            samples.add(solver.t if event is None else event[0], solver)
            if event is not None:
                t, which = event
                if 0 < which <= len(system.ranges):
                    self.stopped = event
                    return t, state
                self.switches.append(t)
                # Stepped to anew: the interpolant is of order 7, and all that follows would keep
                # its error.
                return t, _switch(system, t, self._at(before, t), which)
            longest = max(longest, solver.next_step)
            # A rolling that dies out has no margin with a sign: it is looked at after every step.
            if system.resistance and not system.modes.standing:
                readings = system.readings(solver.t, solver.state)
                state = _stand(system, solver.t, solver.state, readings)
                if system.modes.standing:
                    return solver.t, state
        self.natural = longest
        return solver.t, solver.state

    def _event(
        self, solver: Compensated, before: float, margins: Array
    ) -> tuple[tuple[float, int] | None, Array]:
        """Return the last step's first event, as its time and margin, and the margins after it."""
        system = self.system
        after = _margins_of(system, solver.t, solver.state)
        if min(margins.min(), after.min()) > _FAR:
            return None, after
        looks = np.linspace(before, solver.t, _LOOKS + 2)

        def margin(t: float, which: int) -> float:
            state = solver.within(np.array([t]))[0]
            return float(_margins_of(system, t, state)[which])

        inside = zip(looks[1:-1], solver.within(looks[1:-1]), strict=True)
        seen = [margins, *(_margins_of(system, t, state) for t, state in inside), after]
        found: list[tuple[float, int]] = []
        for which in range(len(after)):
            for i in range(1, len(looks)):
                if seen[i][which] >= 0:
                    continue
                begin, end = float(looks[i - 1]), float(looks[i])
                # A margin that has just begun is 0 but for rounding, of either sign.
                if margin(begin, which) > 0:
                    begin = brentq(margin, begin, end, args=(which,), xtol=_ROOT, rtol=4 * _ROOT)
                found.append((begin, which))
                break
        return (min(found) if found else None), after

    def _solver(self, begin: float, end: float, state: Array) -> Compensated:
        system = self.system
        solver = Compensated(system.stages, begin, end, state, self.rtol, system.scale)
        if system.holds and self.natural is not None:
            # As many equal steps as the piece before would have taken: to find the first step's
            # length anew, after each of many commands, would take as long as the motion.
            count = float(np.ceil((end - begin) / (_LEEWAY * self.natural)))
            solver.next_step = (end - begin) / count
        return solver

    def _at(self, before: tuple[float, Array], t: float) -> Array:
        """Return the state at t in the last step, by steps that end there."""
        if t <= before[0]:
            return before[1]
        solver = self._solver(before[0], t, before[1])
        while solver.t < t:
            self.steps = take_step(solver, self.steps, self.max_steps, self.end, self.progress)
        return solver.state


class Samples:
    """The states at the times of a motion and their readings, filled as the integration goes on."""

    def __init__(self, system: System, times: Array) -> None:
        self.system, self.times, self.done = system, times, 0
        self.states = np.empty((len(times), len(system.scenes) * system.size))
        self.readings = np.empty((len(times), len(system.scenes) * system.readings_size))

    def add(self, reached: float, solver: Compensated | Array) -> None:
        """Add those up to `reached` [s], from the solver's last step or the one state there."""
        new = slice(self.done, int(self.times.searchsorted(reached, side="right")))
        if new.start < new.stop:
            times = self.times[new]
            self.states[new] = solver.within(times) if isinstance(solver, Compensated) else solver
            for i, t in enumerate(times.tolist(), start=new.start):
                self.readings[i] = self.system.numbers(t, self.states[i]).ravel()
            self.done = new.stop
