"""Steps of a model by MuJoCo's own integrators, between sample times and breakpoints.

Controls, and the plane's resistance to rolling, are computed at every evaluation of the forces, so
that RK4 keeps its order; held over a step they would cost it two. MuJoCo's own rolling friction
(condim 6) is another law: it shares one cone with the friction that holds the ball, and acts
against an acceleration, not the rolling.

RK4 is of second order across a torque limit that a servo reaches or leaves. Each servo therefore
stays on its side of the limit within a step, and a step that should have switched is repeated, as
far as the switch.

In order: the controls of a span of time, the torque limits, and the stepping of a run's stretches.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain, pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from robotball.drives import Drive
from robotball.engines.mujoco.model import Model, controls_at
from robotball.engines.mujoco.settings import INTEGRATORS, MUJOCOS_DEFAULT
from robotball.motion import Fault, pieces
from robotball.motors import Law
from robotball.rotations import Array, rotation_matrix
from robotball.scene import spans

FREE_QPOS, FREE_QVEL = 7, 6  # coordinates and velocities of the free joint; hinges follow
STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def read_row(data: mujoco.MjData) -> Array:
    """Return the row of Readings of a state whose sensors are up to date."""
    return np.concatenate([data.sensordata, data.warning.number])


def state_of(data: mujoco.MjData) -> Array:
    """Return all that a step depends on (n,), but for the sides of servos at their limits."""
    state = np.empty(mujoco.mj_stateSize(data.model, STATE))
    mujoco.mj_getState(data.model, data, state, STATE)
    return state


# s: a drive's value at the end of a span is taken this long before it, where a breakpoint's other
# side begins.
_INSIDE = 1e-9
# rad/s: a shell that rolls no faster than STANDING stands, if the plane can hold it; one that is
# below RESTING has nothing left to take away.
_STANDING, _RESTING = 1e-8, 1e-13
# Near a standstill a step is at most this part of the time to it, and this over the rate at which
# the rolling's direction turns over; RK4 is stable up to 2.8.
_APPROACH, _TURNED = 0.5, 2.0


class Control:
    """The controls of a model's hinges within one smooth span of time [s].

    MuJoCo calls it whenever it evaluates the forces, inside `controlled`. Where the plane resists
    rolling it also applies that torque, which needs trials of the forces in data of its own: both
    the shell's acceleration and the load are affine in it.
    """

    def __init__(self, model: Model) -> None:
        self.model, scene = model, model.scene
        self.span: Sequence[float] = (0.0, 0.0)
        self.resistance = scene.friction.rolling  # m
        self.weight = float(-scene.ball.mass * scene.gravity_world[2])  # N, of a ball that stands
        self.shell = model.compiled.body("shell").id
        self.trial = mujoco.MjData(model.compiled)  # in which torques on the shell are tried
        self.tried: Array | None = None  # (2,) N m, the torque while one is

    def inside(self, t: float) -> float:
        """Return the time [s] of the span that is nearest to t."""
        begin, end = self.span
        return max(begin, min(t, end - _INSIDE))

    def __call__(self, _: mujoco.MjModel, data: mujoco.MjData) -> None:
        t = self.inside(data.time)
        data.ctrl[:] = controls_at(self.model.scene, self.model.hinges, t)
        if self.resistance:
            torque = self._torque(data) if self.tried is None else self.tried
            data.xfrc_applied[self.shell, 3:5] = torque

    def _torque(self, data: mujoco.MjData) -> Array:
        """Return the plane's torque (2,) [N m] against rolling, or what holds a standing shell.

        Below STANDING the direction turns over to that of the holding torque, without a jump.
        """
        rolling: Array = data.cvel[self.shell, :2]
        speed = float(np.linalg.norm(rolling))
        along = rolling
        if speed <= _STANDING:
            holding, holds = self._holding(data)
            if holds:
                return holding
            along = rolling - (_STANDING - speed) / float(np.linalg.norm(holding)) * holding
        along = along / float(np.linalg.norm(along))
        return -self._resisting(data, along) * along

    def _resisting(self, data: mujoco.MjData, along: Array) -> float:
        """Return the plane's torque [N m] against rolling along a unit vector (2,)."""
        usual = self.resistance * self.weight
        if not self.model.scene.load_varies:
            return usual
        free, braked = (self._tried(data, t)[2] for t in (np.zeros(2), -usual * along))
        return float(self.resistance * free / (1 - (braked - free) / self.weight))

    def _holding(self, data: mujoco.MjData) -> tuple[Array, bool]:
        """Return the torque (2,) [N m] under which the shell's rolling does not change.

        Returns also whether the plane can give it. Three trials determine both.
        """
        usual = self.resistance * self.weight
        free, *turned = (self._tried(data, usual * each) for each in np.eye(3, 2, -1))
        change = np.array(turned) - free
        parts = np.linalg.solve(change[:, :2].T, -free[:2])
        load = float(free[2] + parts @ change[:, 2])
        torque = np.asarray(usual * parts, dtype=np.float64)
        return torque, bool(np.linalg.norm(torque) <= self.resistance * load)

    def _tried(self, data: mujoco.MjData, torque: Array) -> Array:
        """Return the rolling's acceleration [rad/s²] and the load [N] (3,) under a torque (2,)."""
        compiled, trial = self.model.compiled, self.trial
        trial.time, trial.qpos, trial.qvel = data.time, data.qpos, data.qvel
        trial.qacc_warmstart = data.qacc_warmstart
        self.tried = torque
        mujoco.mj_forward(compiled, trial)
        self.tried = None
        mujoco.mj_rnePostConstraint(compiled, trial)
        return np.append(trial.cacc[self.shell, :2], trial.sensor("contact").data[1])

    def stop(self, data: mujoco.MjData) -> bool:
        """Stop a shell in `data` that the plane has come to hold; return whether it did."""
        rolling = self._rolling(data)
        if not _RESTING < np.linalg.norm(rolling) <= _STANDING:
            return False
        if not self._holding(data)[1]:
            return False
        to_world = rotation_matrix(data.qpos[3:7])
        data.qvel[:2] = 0.0
        data.qvel[3:6] -= rolling @ to_world[:2]
        return True

    def longest(self, data: mujoco.MjData, length: float) -> float:
        """Return a step's length [s], shorter where the shell comes to a standstill or leaves one.

        Near it the rolling's direction turns at a rate of the resistance over the speed.
        """
        speed = float(np.linalg.norm(self._rolling(data)))
        if speed <= _STANDING and self._holding(data)[1]:
            return length
        torques = (self._torque(data), np.zeros(2))
        now, free = (self._tried(data, torque)[:2] for torque in torques)
        turning = float(np.linalg.norm(now - free)) / max(speed, _STANDING)
        slowing = float(np.linalg.norm(now)) / speed if speed > _STANDING else 0.0
        return 1 / max(1 / length, turning / _TURNED, slowing / _APPROACH)

    def _rolling(self, data: mujoco.MjData) -> Array:
        """Return the horizontal part (2,) of the shell's angular velocity [rad/s]."""
        compiled = self.model.compiled
        mujoco.mj_kinematics(compiled, data)
        mujoco.mj_comPos(compiled, data)
        mujoco.mj_comVel(compiled, data)
        return data.cvel[self.shell, :2].copy()


@contextmanager
def controlled(model: Model) -> Iterator[Control]:
    """Put the model's Control in force inside the block."""
    control = Control(model)
    if model.scene.steady and not control.resistance:
        # Constant controls are in the keyframe; a call of Python at each evaluation costs 8 µs.
        yield control
        return
    mujoco.set_mjcb_control(control)
    try:
        yield control
    finally:
        mujoco.set_mjcb_control(None)


# The part of a limit by which a servo's law may be beyond it on the wrong side. A switch found so
# late changes the motion by the square of that.
_LATE = 1e-9
_SHARP = 1e-10  # of a step: the precision of a switch's time
_SHORTEST = 1e-6  # of a step: a switch nearer to its begin or end is taken to be there
_MOST = 8  # switches in a step; one with more is taken with MuJoCo's own limits
_OWN = 2  # in place of a side: MuJoCo limits the torque itself


def is_plain(model: Model) -> bool:
    """Return whether a run is steps alone: no control changes, and nothing ends a step early."""
    with controlled(model) as control, switched(control) as switches:
        return switches is None and mujoco.get_mjcb_control() is None


@dataclass(frozen=True)
class _Limited:
    """A motor with a torque limit: its law without it, and its index and numbers in MjModel.

    gears (h,): the ratios of its hinges among the model's.
    """

    law: Law
    limit: float
    command: Drive
    gears: Array
    actuator: int
    gain: Array
    bias: Array

    def wanted(self, data: mujoco.MjData, t: float) -> float:
        """Return the torque at t [s] that its law alone would give, over the limit."""
        angle = float(data.qpos[FREE_QPOS:] @ self.gears)
        rate = float(data.qvel[FREE_QVEL:] @ self.gears)
        return float(self.law.torque(self.command.rate(t), angle, rate)) / self.limit


class _Switches:
    """The servos of a model that have a torque limit, and the side of each.

    A side is 0 between the limits, where the law acts alone, -1 or 1 at a limit, where the torque
    is constant, or OWN.
    """

    def __init__(self, control: Control, servos: tuple[_Limited, ...]) -> None:
        self.control, self.servos = control, servos
        self.set([0] * len(servos))

    def set(self, sides: list[int]) -> None:
        """Set the compiled model to each servo's side: its law alone, or a constant torque."""
        compiled, self.sides = self.control.model.compiled, list(sides)
        for servo, side in zip(self.servos, sides, strict=True):
            i, at_limit = servo.actuator, side in (-1, 1)
            compiled.actuator_forcelimited[i] = side == _OWN
            compiled.actuator_gainprm[i] = 0.0 if at_limit else servo.gain
            compiled.actuator_biasprm[i] = 0.0 if at_limit else servo.bias
            if at_limit:
                compiled.actuator_biasprm[i, 0] = side * servo.limit

    def steps(self, data: mujoco.MjData, length: float) -> Iterator[float]:
        """Take one step in parts that end at its switches. Yields the length of each [s]."""
        left = length
        while self.control.resistance and left > 0:
            self.control.stop(data)
            part = self.control.longest(data, left)
            part = left if left - part < _SHORTEST * length else part
            yield from self._to_switches(data, part)
            left -= part
        if left > 0:
            yield from self._to_switches(data, left)

    def _to_switches(self, data: mujoco.MjData, length: float) -> Iterator[float]:
        """Take a part of a step as `steps` does, with the resistance to rolling as it is."""
        left = length
        for _ in range(_MOST):
            # A command that has jumped leaves a servo beyond its side before the step.
            if self._late(data) > 0:
                self._settle(data)
            before = state_of(data)
            if not self._after(data, left) > 0:  # a NaN ends here too
                yield left
                return
            taken = self._until_switch(data, before, left)
            if taken > left - _SHORTEST * length:
                taken = left
            mujoco.mj_setState(data.model, data, before, STATE)
            if taken > _SHORTEST * length:
                self._after(data, taken)
                yield taken
                left -= taken
            self._switch(data)
            if left == 0:
                return
        self.set([_OWN] * len(self.servos))
        self._after(data, left)
        yield left
        self._settle(data)

    def _settle(self, data: mujoco.MjData) -> None:
        """Put every servo on the side where its law is."""
        self.set([int(w > 1) - int(w < -1) for w in self._wanted(data)])

    def _wanted(self, data: mujoco.MjData) -> list[float]:
        """Return each servo's torque by its law alone, over the limit."""
        t = self.control.inside(data.time)
        return [servo.wanted(data, t) for servo in self.servos]

    def _beyond(self, data: mujoco.MjData) -> list[float]:
        """Return how far each servo's law is beyond its own side of the limit, over the limit."""
        sided = zip(self._wanted(data), self.sides, strict=True)
        return [1 - side * wanted if side else abs(wanted) - 1 for wanted, side in sided]

    def _late(self, data: mujoco.MjData) -> float:
        """Return a number that is positive where a servo should have switched."""
        return max(self._beyond(data), default=0.0) - _LATE

    def _after(self, data: mujoco.MjData, length: float) -> float:
        """Take a step, and return `_late` after it."""
        data.model.opt.timestep = length
        mujoco.mj_step(data.model, data)
        return self._late(data)

    def _until_switch(self, data: mujoco.MjData, before: Array, left: float) -> float:
        """Return the length of a step [s] up to the first switch; one of `left` goes beyond it."""

        # Each trial begins from the same state, so that `late` is continuous in the step's length.
        def late(length: float) -> float:
            mujoco.mj_setState(data.model, data, before, STATE)
            return self._after(data, length) if length else self._late(data)

        return float(brentq(late, 0.0, left, xtol=_SHARP * left, rtol=_SHARP))

    def _switch(self, data: mujoco.MjData) -> None:
        """Put the servo that has just reached or left its limit on its other side."""
        beyond, wanted = self._beyond(data), self._wanted(data)
        i, sides = int(np.argmax(beyond)), list(self.sides)
        sides[i] = 0 if sides[i] else int(np.sign(wanted[i]))
        self.set(sides)


@contextmanager
def switched(control: Control) -> Iterator[_Switches | None]:
    """Yield the Switches of a run, None where nothing ends a step; restore the model afterwards.

    First-order steps need none, as MuJoCo's own limits cost them no order.
    """
    model = control.model
    first_order = INTEGRATORS[model.settings.integrator or MUJOCOS_DEFAULT].order == 1
    servos = () if first_order else tuple(_limited(model))
    if not servos and not control.resistance:
        yield None
        return
    switches = _Switches(control, servos)
    try:
        yield switches
    finally:
        switches.set([_OWN] * len(servos))


def _limited(model: Model) -> Iterator[_Limited]:
    """Yield the motors with a limit, with a copy of the numbers that their switches overwrite."""
    scene, compiled, motors = model.scene, model.compiled, []
    units = np.eye(len(model.hinges))
    for hinge, gears in zip(model.hinges, units, strict=True):
        if hinge.law:
            motors.append((hinge.body, hinge.law, hinge.drive, gears))
    places = {hinge.body: gears for hinge, gears in zip(model.hinges, units, strict=True)}
    for each, command in zip(scene.actuators, scene.controls, strict=True):
        gears = np.sum([ratio * places[name] for name, ratio in each.gears], axis=0)
        motors.append((each.name, each.law, command, gears))
    for name, law, command, gears in motors:
        if law.limit < np.inf:
            i = compiled.actuator(name).id
            gain, bias = compiled.actuator_gainprm[i].copy(), compiled.actuator_biasprm[i].copy()
            unlimited = law._replace(limit=np.inf)
            yield _Limited(unlimited, law.limit, command, gears, i, gain, bias)


_LOOK = 4096  # steps between two looks of the monitor; at most so many are taken after a fault


@dataclass(frozen=True)
class _Stretch:
    """Consecutive spans of time that are stepped before the monitor looks at them.

    ends     (m, 2)  s, the begin and end of each span
    lengths  (m,)    s, of the steps in each
    counts   (m,)    of the steps in each
    samples  (k,)    the steps, counted over the stretch, that start at a sample time
    """

    ends: Array
    lengths: Array
    counts: Array
    samples: Array

    def __iter__(self) -> Iterator[tuple[list[float], float, int]]:
        yield from zip(
            *(each.tolist() for each in (self.ends, self.lengths, self.counts)), strict=True
        )


def stretches(times: Array, breakpoints: tuple[float, ...], timestep: float) -> Iterator[_Stretch]:
    """Yield the stretches of a run over `times` (n,) [s], each of about LOOK steps.

    Between two sample times or breakpoints lie the fewest equal steps not longer than `timestep`.
    """
    # Piece by piece of the spans, so that a long run's stretches are not all in memory.
    every = spans(times, breakpoints, timestep)
    for piece in pieces(len(every[0])):
        yield from _stretches(times, *(each[piece] for each in every))


def _stretches(times: Array, ends: Array, lengths: Array, counts: Array) -> Iterator[_Stretch]:
    """Yield the stretches of a piece of the spans."""
    # A long span is cut into parts of LOOK steps.
    parts = np.ceil(counts / _LOOK).astype(int)
    first = np.cumsum(parts) - parts
    part = np.arange(parts.sum()) - np.repeat(first, parts)
    lengths, begins = np.repeat(lengths, parts), np.repeat(ends[:, 0], parts)
    sizes = np.minimum(np.repeat(counts, parts) - _LOOK * part, _LOOK).astype(int)
    begins = begins + _LOOK * part * lengths
    ends = np.stack([begins, begins + sizes * lengths], axis=1)
    sampled = (part == 0) & (times[np.searchsorted(times, begins)] == begins)
    look = (np.cumsum(sizes) - 1) // _LOOK
    for which in np.split(np.arange(len(sizes)), np.flatnonzero(np.diff(look)) + 1):
        starts = np.cumsum(sizes[which]) - sizes[which]
        yield _Stretch(ends[which], lengths[which], sizes[which], starts[sampled[which]])


@dataclass(frozen=True)
class Portion:
    """A part of a run, between two looks of the monitor.

    rows     (m, columns of Readings)  in the order of time
    sampled  the indices of the rows at the run's sample times
    steps    the number of steps taken
    longest  s, the longest of them
    failure  why the run cannot go on, if it cannot
    """

    rows: Array
    sampled: Array
    steps: int
    longest: float
    failure: Fault | None = None


def by_steps(control: Control, data: mujoco.MjData, times: Array) -> Iterator[Portion]:
    """Run over sample `times` (n,) [s] by mj_step, in steps not longer than the timestep."""
    compiled, scene = control.model.compiled, control.model.scene
    parts = stretches(times, scene.breakpoints, compiled.opt.timestep)
    with switched(control) as switches:
        for stretch, following in pairwise(chain(parts, (None,))):
            assert stretch is not None
            end = float(times[-1]) if following is None else None
            if switches:
                rows, firsts, longest = _step_to_switches(control, switches, data, stretch)
            else:
                rows, firsts, longest = _step(control, data, stretch)
            samples = firsts[stretch.samples]
            steps = len(rows) - 1
            if end is None:
                rows = rows[:steps]
            else:
                control.span = (end, end)
                # After a step the sensors are those of the state before it.
                mujoco.mj_forward(compiled, data)
                rows[steps] = read_row(data)
                samples = np.append(samples, steps)
            yield Portion(rows, samples, steps, longest)


def _step(
    control: Control, data: mujoco.MjData, stretch: _Stretch
) -> tuple[Array, NDArray[np.int64], float]:
    """Return the rows of a stretch, the indices of its planned steps in them, the longest step.

    A row is of the state before its step. There is room for one row more.
    """
    compiled, sensors, warned = control.model.compiled, data.sensordata, data.warning.number
    start, warned_before = state_of(data), warned.copy()
    count = int(stretch.counts.sum())
    rows = np.empty((count + 1, len(sensors) + len(warned)))
    rows[:, len(sensors) :] = warned_before
    # Slices of memoryviews copy 50 numbers faster than NumPy does: a run takes 1.05 times as long
    # as a bare loop of mj_step.
    step, read, to = mujoco.mj_step, sensors.data, rows.reshape(-1).data
    place, size, width = 0, len(sensors), rows.shape[1]
    for _, taken in _set_for_each(control, stretch):
        for _ in range(taken):
            step(compiled, data)
            to[place : place + size] = read
            place += width
    if (warned != warned_before).any():
        rows[:count, size:] = _warnings(control, start, stretch, warned_before)
    return rows, np.arange(count, dtype=np.int64), float(stretch.lengths.max())


def _warnings(control: Control, start: Array, stretch: _Stretch, before: Array) -> Array:
    """Return MuJoCo's counters (m, 7) after each step of a stretch, which is repeated.

    To read them at every step would slow all runs for the few in which one changes.
    """
    data = mujoco.MjData(control.model.compiled)
    mujoco.mj_setState(control.model.compiled, data, start, STATE)
    data.warning.number[:] = before
    return np.array([data.warning.number.copy() for _ in _each(control, None, data, stretch)])


def _step_to_switches(
    control: Control, switches: _Switches, data: mujoco.MjData, stretch: _Stretch
) -> tuple[Array, NDArray[np.int64], float]:
    """Return the same as `_step`, with a step more at every switch of a servo's torque limit."""
    rows: list[Array] = []
    firsts: list[int] = []
    longest = 0.0
    for first, length in _each(control, switches, data, stretch):
        if first:
            firsts.append(len(rows))
        rows.append(read_row(data))
        longest = max(longest, length)
    return np.array([*rows, np.empty_like(rows[0])]), np.array(firsts, np.int64), longest


def _each(
    control: Control, switches: _Switches | None, data: mujoco.MjData, stretch: _Stretch
) -> Iterator[tuple[bool, float]]:
    """Take the steps of a stretch. Yields (planned, length [s]) of each.

    planned is False for the later parts of a step that was cut at a switch.
    """
    for length, count in _set_for_each(control, stretch):
        for _ in range(count):
            if switches is None:
                mujoco.mj_step(control.model.compiled, data)
                yield True, length
                continue
            for i, taken in enumerate(switches.steps(data, length)):
                yield i == 0, taken


def _set_for_each(control: Control, stretch: _Stretch) -> Iterator[tuple[float, int]]:
    """Set model and control for every span of a stretch. Yields (length [s], number) of its steps.

    The model's own timestep is set back at the end.
    """
    option = control.model.compiled.opt
    timestep = option.timestep
    for span, length, count in stretch:
        option.timestep, control.span = length, span
        yield length, count
    option.timestep = timestep
