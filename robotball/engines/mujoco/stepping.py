"""A model stepped by MuJoCo's own integrators between sample times and breakpoints.

Controls, and the plane's resistance to rolling, are computed at every evaluation of the forces, so
that RK4 keeps its order. MuJoCo's own rolling friction (condim 6) is another law: it shares one
cone with the friction that holds the ball, and acts against an acceleration, not the rolling.

Across a torque limit that a servo reaches or leaves RK4 is of second order. Within one step each
servo therefore stays on its side of the limit, and a step that should have switched is taken once
more, as far as the switch.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from robotball.drives import Motor, PositionServo, Servo
from robotball.engines.mujoco.model import Model, ModelHinge
from robotball.engines.mujoco.settings import INTEGRATORS, MUJOCOS_DEFAULT
from robotball.motion import Fault, pieces
from robotball.rotations import Array, rotation_matrix
from robotball.scene import spans

STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def read_row(data: mujoco.MjData) -> Array:
    """The row of Readings of a state whose sensors are up to date."""
    return np.concatenate([data.sensordata, data.warning.number])


def state_of(data: mujoco.MjData) -> Array:
    """All that a step depends on (n,), but for the sides of servos at their limits."""
    state = np.empty(mujoco.mj_stateSize(data.model, STATE))
    mujoco.mj_getState(data.model, data, state, STATE)
    return state


INSIDE = 1e-9  # s: how far before the end of a span its own side of a breakpoint is taken
# rad/s: a shell that rolls no faster stands, if it can be held; what is left of one that stands.
STANDING, RESTING = 1e-8, 1e-13
# The longest step near a standstill: of the time to it, and over the rate of what turns there.
APPROACH, TURNED = 0.5, 2.0


@dataclass
class Control:
    """The controls of a model's hinges within one smooth span of time [s].

    MuJoCo calls it, held by `controlled`, whenever it needs the forces.
    """

    model: Model
    span: Sequence[float] = (0.0, 0.0)
    resistance: float = field(init=False)  # N m, to rolling
    shell: int = field(init=False)
    trial: mujoco.MjData = field(init=False)  # in which torques on the shell are tried
    tried: Array | None = None  # (2,) N m, the torque while one is

    def __post_init__(self) -> None:
        scene = self.model.scene
        normal_force = -scene.ball.mass * scene.gravity_world[2]
        self.resistance = float(scene.friction.rolling * normal_force)
        self.shell = self.model.compiled.body("shell").id
        self.trial = mujoco.MjData(self.model.compiled)

    def inside(self, t: float) -> float:
        """A time [s] of the span, or the nearest one that is inside it."""
        begin, end = self.span
        return max(begin, min(t, end - INSIDE))

    def __call__(self, _: mujoco.MjModel, data: mujoco.MjData) -> None:
        t = self.inside(data.time)
        data.ctrl[:] = [hinge.control(t) for hinge in self.model.hinges if hinge.actuated]
        if self.resistance:
            torque = self._torque(data) if self.tried is None else self.tried
            data.xfrc_applied[self.shell, 3:5] = torque

    def _torque(self, data: mujoco.MjData) -> Array:
        """(2,) N m, of the plane against rolling; what holds the shell where it stands."""
        rolling: Array = data.cvel[self.shell, :2]
        speed = float(np.linalg.norm(rolling))
        along = rolling
        if speed <= STANDING:
            holding = self._holding(data)
            size = float(np.linalg.norm(holding))
            if size <= self.resistance:
                return holding
            along = rolling - (STANDING - speed) / size * holding
        return -self.resistance / float(np.linalg.norm(along)) * along

    def _holding(self, data: mujoco.MjData) -> Array:
        """(2,) N m: the torque under which the shell's rolling does not change."""
        free, *turned = (
            self._acceleration(data, torque)
            for torque in self.resistance * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        )
        solved = np.linalg.solve((np.array(turned) - free).T, free)
        return np.asarray(-self.resistance * solved, dtype=np.float64)

    def _acceleration(self, data: mujoco.MjData, torque: Array | None = None) -> Array:
        """(2,) rad/s²: of the shell's rolling, under a torque on it in place of the plane's."""
        compiled, trial = self.model.compiled, self.trial
        trial.time, trial.qpos, trial.qvel = data.time, data.qpos, data.qvel
        self.tried = torque
        mujoco.mj_forward(compiled, trial)
        self.tried = None
        mujoco.mj_rnePostConstraint(compiled, trial)
        return trial.cacc[self.shell, :2].copy()

    def stop(self, data: mujoco.MjData) -> bool:
        """Whether the plane has just come to hold the shell, whose rolling is taken from `data`."""
        rolling = self._rolling(data)
        if not RESTING < np.linalg.norm(rolling) <= STANDING:
            return False
        if np.linalg.norm(self._holding(data)) > self.resistance:
            return False
        to_world = rotation_matrix(data.qpos[3:7])
        data.qvel[:2] = 0.0
        data.qvel[3:6] -= rolling @ to_world[:2]
        return True

    def longest(self, data: mujoco.MjData, length: float) -> float:
        """A step's length [s], shorter where the shell comes to a standstill or leaves one.

        Near it the way of the rolling turns over at a rate of the resistance over the speed.
        """
        speed = float(np.linalg.norm(self._rolling(data)))
        if speed <= STANDING and np.linalg.norm(self._holding(data)) <= self.resistance:
            return length
        now, free = (self._acceleration(data, torque) for torque in (None, np.zeros(2)))
        turning = float(np.linalg.norm(now - free)) / max(speed, STANDING)
        slowing = float(np.linalg.norm(now)) / speed if speed > STANDING else 0.0
        return float(min(length, TURNED / turning, APPROACH / max(slowing, APPROACH / length)))

    def _rolling(self, data: mujoco.MjData) -> Array:
        """(2,) rad/s: the horizontal part of the shell's angular velocity."""
        compiled = self.model.compiled
        mujoco.mj_kinematics(compiled, data)
        mujoco.mj_comPos(compiled, data)
        mujoco.mj_comVel(compiled, data)
        return data.cvel[self.shell, :2].copy()


@contextmanager
def controlled(model: Model) -> Iterator[Control]:
    """The model's Control, in force inside the block; constant controls are in its keyframe."""
    control = Control(model)
    if model.scene.steady and not control.resistance:
        yield control
        return
    mujoco.set_mjcb_control(control)
    try:
        yield control
    finally:
        mujoco.set_mjcb_control(None)


# Of the limit: how far a servo's law may be beyond it on the wrong side. A switch found so late
# changes the motion by the square of that.
LATE = 1e-9
SHARP = 1e-10  # of a step: how sharply a switch is found
SHORTEST = 1e-6  # of a step: a switch as near as that is at its begin or its end
MOST = 8  # switches in a step; one with more is taken with MuJoCo's own limits
OWN = 2  # in place of a side: MuJoCo limits the torque itself


@dataclass(frozen=True)
class Limited:
    """A servo with a torque limit: its law without it, and the places of its numbers in MjModel."""

    hinge: ModelHinge
    law: Motor
    limit: float
    actuator: int
    position: int
    velocity: int
    gain: Array
    bias: Array

    def wanted(self, data: mujoco.MjData, t: float) -> float:
        """What it would give at t [s] if there were no limit, over the limit."""
        angle, rate = float(data.qpos[self.position]), float(data.qvel[self.velocity])
        return float(self.law.torque(self.hinge.control(t), angle, rate)) / self.limit


@dataclass
class Switches:
    """The servos of a model that have a limit, and on which side of it each is: -1, 0, 1 or OWN."""

    control: Control
    servos: tuple[Limited, ...]
    sides: list[int] = field(init=False)

    def __post_init__(self) -> None:
        self.set([0] * len(self.servos))

    def set(self, sides: list[int]) -> None:
        """Lets each servo follow its law alone, or give its limit."""
        compiled, self.sides = self.control.model.compiled, list(sides)
        for servo, side in zip(self.servos, sides, strict=True):
            i, at_limit = servo.actuator, side in (-1, 1)
            compiled.actuator_forcelimited[i] = side == OWN
            compiled.actuator_gainprm[i] = 0.0 if at_limit else servo.gain
            compiled.actuator_biasprm[i] = 0.0 if at_limit else servo.bias
            if at_limit:
                compiled.actuator_biasprm[i, 0] = side * servo.limit

    def restore(self) -> None:
        """Leaves the compiled model as it was."""
        self.set([OWN] * len(self.servos))

    def steps(
        self, data: mujoco.MjData, length: float
    ) -> Iterator[tuple[float, tuple[Array, list[int]]]]:
        """One step, or as many as there are switches in it; what each began from once it is taken.

        (its length [s], (state, sides))
        """
        left = length
        while self.control.resistance and left > 0:
            self.control.stop(data)
            part = self.control.longest(data, left)
            part = left if left - part < SHORTEST * length else part
            yield from self._to_switches(data, part)
            left -= part
        if left > 0:
            yield from self._to_switches(data, left)

    def _to_switches(
        self, data: mujoco.MjData, length: float
    ) -> Iterator[tuple[float, tuple[Array, list[int]]]]:
        left = length
        for _ in range(MOST):
            # A command that has jumped leaves a servo beyond its side before the step.
            if self._late(data) > 0:
                self._settle(data)
            before, sides = state_of(data), self.sides
            if not self._after(data, left) > 0:  # nor is a NaN
                yield left, (before, sides)
                return
            taken = self._until_switch(data, before, left)
            if taken > left - SHORTEST * length:
                taken = left
            mujoco.mj_setState(data.model, data, before, STATE)
            if taken > SHORTEST * length:
                self._after(data, taken)
                yield taken, (before, sides)
                left -= taken
            self._switch(data)
            if left == 0:
                return
        self.set([OWN] * len(self.servos))
        before = state_of(data)
        self._after(data, left)
        yield left, (before, self.sides)
        self._settle(data)

    def _settle(self, data: mujoco.MjData) -> None:
        """Puts every servo on the side where its law is."""
        self.set([int(w > 1) - int(w < -1) for w in self._wanted(data)])

    def _wanted(self, data: mujoco.MjData) -> list[float]:
        t = self.control.inside(data.time)
        return [servo.wanted(data, t) for servo in self.servos]

    def _beyond(self, data: mujoco.MjData) -> list[float]:
        """How far each servo's law is beyond its own side of the limit, over the limit."""
        sided = zip(self._wanted(data), self.sides, strict=True)
        return [1 - side * wanted if side else abs(wanted) - 1 for wanted, side in sided]

    def _late(self, data: mujoco.MjData) -> float:
        """Positive where a servo should have switched."""
        return max(self._beyond(data), default=0.0) - LATE

    def _after(self, data: mujoco.MjData, length: float) -> float:
        """`_late` after a step."""
        data.model.opt.timestep = length
        mujoco.mj_step(data.model, data)
        return self._late(data)

    def _until_switch(self, data: mujoco.MjData, before: Array, left: float) -> float:
        """The length of a step from a state to the first switch [s], of one that goes beyond."""

        def late(length: float) -> float:
            mujoco.mj_setState(data.model, data, before, STATE)
            return self._after(data, length) if length else self._late(data)

        return float(brentq(late, 0.0, left, xtol=SHARP * left, rtol=SHARP))

    def _switch(self, data: mujoco.MjData) -> None:
        """Puts the servo that has just reached or left its limit on its other side."""
        beyond, wanted = self._beyond(data), self._wanted(data)
        i, sides = int(np.argmax(beyond)), list(self.sides)
        sides[i] = 0 if sides[i] else int(np.sign(wanted[i]))
        self.set(sides)


@contextmanager
def switched(control: Control) -> Iterator[Switches | None]:
    """Those of a model that steps by an order above the first, or rolls against resistance."""
    model = control.model
    integrator = INTEGRATORS[model.settings.integrator or MUJOCOS_DEFAULT]
    servos = [_limited(model.compiled, hinge) for hinge in model.hinges if hinge.torque_limit]
    if integrator.order == 1:
        servos = []
    if not servos and not control.resistance:
        yield None
        return
    switches = Switches(control, tuple(servos))
    try:
        yield switches
    finally:
        switches.restore()


def _limited(compiled: mujoco.MjModel, hinge: ModelHinge) -> Limited:
    actuator, joint = compiled.actuator(hinge.body), compiled.joint(hinge.joint)
    servo = hinge.actuation
    assert isinstance(servo, Servo | PositionServo)
    assert servo.torque_limit is not None
    return Limited(
        hinge,
        replace(servo, torque_limit=None),
        servo.torque_limit,
        actuator.id,
        int(joint.qposadr[0]),
        int(joint.dofadr[0]),
        compiled.actuator_gainprm[actuator.id].copy(),
        compiled.actuator_biasprm[actuator.id].copy(),
    )


LOOK = 4096  # steps between two looks at the run


@dataclass(frozen=True)
class Stretch:
    """Consecutive spans of time that are stepped before the run is looked at.

    ends    (m, 2)  s, where the spans begin and end
    lengths  (m,)    s, of the steps in each
    counts   (m,)    how many there are
    samples  (k,)    which steps, counted over the stretch, start at a sample time
    """

    ends: Array
    lengths: Array
    counts: Array
    samples: Array

    def __iter__(self) -> Iterator[tuple[list[float], float, int]]:
        spans = zip(self.ends.tolist(), self.lengths.tolist(), self.counts.tolist(), strict=True)
        yield from spans


def stretches(times: Array, breakpoints: tuple[float, ...], timestep: float) -> Iterator[Stretch]:
    """A run over `times` (n,) [s], in stretches of about LOOK steps however far apart they are.

    Between two sample times or breakpoints go the fewest equal steps not longer than `timestep`.
    """
    for piece in pieces(len(times) - 1):
        some = times[piece.start : piece.stop + 1]
        later = tuple(t for t in breakpoints if t > some[0])
        yield from _stretches(some, later, timestep)


def _stretches(times: Array, breakpoints: tuple[float, ...], timestep: float) -> Iterator[Stretch]:
    """The same for a part of the samples."""
    ends, lengths, counts = spans(times, breakpoints, timestep)
    # A long span is cut into parts of LOOK steps.
    parts = np.ceil(counts / LOOK).astype(int)
    first = np.cumsum(parts) - parts
    part = np.arange(parts.sum()) - np.repeat(first, parts)
    lengths, begins = np.repeat(lengths, parts), np.repeat(ends[:, 0], parts)
    sizes = np.minimum(np.repeat(counts, parts) - LOOK * part, LOOK).astype(int)
    begins = begins + LOOK * part * lengths
    ends = np.stack([begins, begins + sizes * lengths], axis=1)
    sampled = part == 0
    if breakpoints:
        sampled &= np.isin(begins, times)
    look = (np.cumsum(sizes) - 1) // LOOK
    for which in np.split(np.arange(len(sizes)), np.flatnonzero(np.diff(look)) + 1):
        starts = np.cumsum(sizes[which]) - sizes[which]
        yield Stretch(ends[which], lengths[which], sizes[which], starts[sampled[which]])


@dataclass(frozen=True)
class Steps:
    """What each row of a portion began from, so that it can be done again.

    states   (m, n)  MuJoCo's integration states
    lengths  (m,)    s, of the step from each; 0 where there was none
    spans    (m, 2)  s, the smooth span of time that each is in
    sides    m       of their torque limits, on which the servos are that have one
    """

    states: Array
    lengths: Array
    spans: Array
    sides: list[list[int]]


@dataclass(frozen=True)
class Portion:
    """A part of a run, between two looks at it.

    rows     (m, columns of Readings)  in the order of time
    sampled  which of them, as an index, are at the run's sample times
    steps    how many were taken
    longest  of them [s]
    again    gives what its rows began from; deferred, as only faulty runs need it
    failure  why the run can't go on, if it can't
    """

    rows: Array
    sampled: Array
    steps: int
    longest: float
    again: Callable[[], Steps]
    failure: Fault | None = None


def by_steps(control: Control, data: mujoco.MjData, times: Array) -> Iterator[Portion]:
    """The run over sample `times` (n,) [s] by mj_step, in steps not longer than the timestep."""
    compiled, scene = control.model.compiled, control.model.scene
    parts = stretches(times, scene.breakpoints, compiled.opt.timestep)
    with switched(control) as switches:
        for stretch, following in pairwise(chain(parts, (None,))):
            assert stretch is not None
            end = float(times[-1]) if following is None else None
            sides = switches.sides if switches else []
            again = partial(_again, control, switches, state_of(data), sides, stretch, end)
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
                mujoco.mj_forward(compiled, data)
                rows[steps] = read_row(data)
                samples = np.append(samples, steps)
            yield Portion(rows, samples, steps, longest, again)


def _step(
    control: Control, data: mujoco.MjData, stretch: Stretch
) -> tuple[Array, NDArray[np.int64], float]:
    """Rows, one a step of the stretch, each of the state before its step, and room for one more.

    Also which of them begins each planned step, and the longest step.
    """
    compiled, sensors, warned = control.model.compiled, data.sensordata, data.warning.number
    start, warned_before = state_of(data), warned.copy()
    count = int(stretch.counts.sum())
    rows = np.empty((count + 1, len(sensors) + len(warned)))
    rows[:, len(sensors) :] = warned_before
    # Few of the ways to copy 50 numbers are as quick as this.
    step, read, to = mujoco.mj_step, sensors.data, rows.reshape(-1).data
    place, size, width = 0, len(sensors), rows.shape[1]
    for _, _, taken in _set_for_each(control, stretch):
        for _ in range(taken):
            step(compiled, data)
            to[place : place + size] = read
            place += width
    if (warned != warned_before).any():
        rows[:count, size:] = _warnings(control, start, stretch, warned_before)
    return rows, np.arange(count, dtype=np.int64), float(stretch.lengths.max())


def _warnings(control: Control, start: Array, stretch: Stretch, before: Array) -> Array:
    """MuJoCo's counters (m, 7) after each step of a stretch, which is taken once more."""
    data = _data_at(control, start)
    data.warning.number[:] = before
    rows = []
    for _, _, count in _set_for_each(control, stretch):
        for _ in range(count):
            mujoco.mj_step(control.model.compiled, data)
            rows.append(data.warning.number.copy())
    return np.array(rows)


def _step_to_switches(
    control: Control, switches: Switches, data: mujoco.MjData, stretch: Stretch
) -> tuple[Array, NDArray[np.int64], float]:
    """The same with a step more at every switch of a servo's torque limit."""
    rows: list[Array] = []
    firsts: list[int] = []
    longest = 0.0
    for length, _, count in _set_for_each(control, stretch):
        for _ in range(count):
            firsts.append(len(rows))
            for taken, _ in switches.steps(data, length):
                rows.append(read_row(data))
                longest = max(longest, taken)
    return np.array([*rows, np.empty_like(rows[0])]), np.array(firsts, np.int64), longest


def _again(
    control: Control,
    switches: Switches | None,
    start: Array,
    sides: list[int],
    stretch: Stretch,
    end: float | None,
) -> Steps:
    """The steps of a stretch, taken once more from the state that it began from.

    end: of the run [s], where the stretch is its last; then the last row is of the state there.
    """
    compiled = control.model.compiled
    data = _data_at(control, start)
    states, lengths, spans, all_sides = [], [], [], []
    if switches:
        switches.set(sides)
    for length, span, count in _set_for_each(control, stretch):
        for _ in range(count):
            if switches:
                for taken, (before, side) in switches.steps(data, length):
                    states.append(before)
                    lengths.append(taken)
                    spans.append(span)
                    all_sides.append(side)
                continue
            states.append(state_of(data))
            lengths.append(length)
            spans.append(span)
            all_sides.append(sides)
            mujoco.mj_step(compiled, data)
    if end is not None:
        states.append(state_of(data))
        lengths.append(0.0)
        spans.append((end, end))
        all_sides.append(switches.sides if switches else [])
    return Steps(np.array(states), np.array(lengths), np.array(spans), all_sides)


def _data_at(control: Control, state: Array) -> mujoco.MjData:
    data = mujoco.MjData(control.model.compiled)
    mujoco.mj_setState(control.model.compiled, data, state, STATE)
    return data


def _set_for_each(
    control: Control, stretch: Stretch
) -> Iterator[tuple[float, Sequence[float], int]]:
    """Sets model and control for every span of a stretch, and gives its step, itself and how many
    steps it has.
    """
    option = control.model.compiled.opt
    timestep = option.timestep
    for span, length, count in stretch:
        option.timestep, control.span = length, span
        yield length, span, count
    option.timestep = timestep
