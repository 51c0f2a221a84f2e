"""Many motions at once, or one densely sampled, in compiled loops around the compiled step.

Each lane has an orbit with its own step length and error control. When the orbit is done, the lane
takes the next orbit of the queue, which all threads share. Outputs within a step are computed with
a shorter step from the same start, so they have the full order and need no interpolant.

"Frame" axes here are the principal axes of the ball's inertia, in which `Parameters` are.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from robotball.errors import InputError, too_many_steps
from robotball.motion import pieces
from robotball.processes import Queue, in_threads
from robotball.robot.formulas import Parameters, as_vector, check_speed
from robotball.robot.scene import Scene, times_of
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.theory.compiled import Function, compiled_from, inlined, text_of
from robotball.theory.ensembles import steppers as st
from robotball.theory.ensembles.flatten import FEW, LANES
from robotball.theory.ensembles.steppers import PATH, System, places

DONE, TOO_MANY_STEPS, COLLAPSED = 0, 1, 2  # the status of an orbit at its end
STEP = "FunctionType(void(f8[::1]))"
_SOURCES = text_of(*sorted(Path(__file__).parent.glob("*.py")))


def compiled(signature: str) -> Callable[[Function], Function]:
    """Return a decorator that compiles a loop of this folder."""
    return compiled_from(_SOURCES, signature, no_cfunc_wrapper=True)


def work(size: int, counters: int) -> tuple[Array, tuple[Array, ...]]:
    """Return the workspace of the step, and `counters` integers for each lane.

    Arrays made within compiled code would take a quarter of its compilation.
    """
    return np.zeros(places(size)[3] * LANES), tuple(np.zeros((counters, LANES), np.int64))


def _take(_: Any, queue: Any) -> Any:
    """Return the number in a queue (1,) and increment it, atomically."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        one = context.get_constant(types.int64, 1)
        # Threads share a queue without a lock; no other memory is ordered.
        return builder.atomic_rmw("add", array.data, one, "monotonic")

    return types.int64(queue), generate


take: Any = intrinsic(_take)


@inlined
def load(w: Any, lanes: int, lane: int, row: Any, length: float, tolerance: float) -> None:
    """Put an orbit into a lane. row: the rows from BALL on, up to the end of the slope."""
    w[st.LENGTH * lanes + lane] = length
    w[st.ALLOWED * lanes + lane] = tolerance
    w[st.TIME * lanes + lane] = 0.0
    w[st.TARGET * lanes + lane] = np.inf
    for j in range(len(row)):
        w[(st.BALL + j) * lanes + lane] = row[j]


@inlined
def load_next(
    w: Any, orbit: Any, lane: int, queue: Any, rows: Any, lengths: Any, tolerance: float
) -> bool:
    """Put the queue's next orbit into a lane. If the queue is empty, return False and orbit -1."""
    waiting = take(queue)
    if waiting >= len(rows):
        orbit[lane] = -1
        return False
    load(w, LANES, lane, rows[waiting], lengths[waiting], tolerance)
    orbit[lane] = waiting
    return True


@inlined
def collapsed(w: Any, lanes: int, lane: int) -> bool:
    """Return whether a lane's step is too short to move its time."""
    time = w[st.TIME * lanes + lane]
    return time + w[st.LENGTH * lanes + lane] == time


@compiled(
    f"void({STEP}, i8[::1], f8[:, ::1], f8[::1], f8[::1], f8, i8, f8[::1], UniTuple(i8[::1], 3), "
    "f8[:, :, ::1], i8[::1])"
)
def march_lanes(
    step: Any, queue: Any, rows: Any, lengths: Any, times: Any, tolerance: float, step_limit: int,
    w: Any, counters: Any, states: Any, status: Any,
) -> None:  # fmt: skip
    """Write the states (n, m, size) of n orbits at m times, all after 0 and increasing.

    queue: of the remaining orbits, for `take`; rows: (n, k) for `load`; lengths: (n,) s, the first
    steps; w, counters: from `work`. Writes the states and status (n,) of the orbits that it takes.
    The later states of an abandoned orbit are not written.
    """
    size = states.shape[2]
    _, new, flag, _ = places(size)
    orbit, sample, steps = counters
    running = 0
    for lane in range(LANES):
        load(w, LANES, lane, rows[0], lengths[0], tolerance)  # idle lanes compute too
        if load_next(w, orbit, lane, queue, rows, lengths, tolerance):
            w[st.TARGET * LANES + lane] = times[0]
            running += 1
    while running > 0:
        step(w)
        for lane in range(LANES):
            i = orbit[lane]
            if i < 0:
                continue
            steps[lane] += 1
            if w[flag * LANES + lane] == st.LOOKED:
                for j in range(size):
                    states[i, sample[lane], j] = w[(new + j) * LANES + lane]
                sample[lane] += 1
                if sample[lane] < len(times):
                    w[st.TARGET * LANES + lane] = times[sample[lane]]
                    continue
                status[i] = DONE
            elif steps[lane] >= step_limit:
                status[i] = TOO_MANY_STEPS
            elif w[flag * LANES + lane] == st.REJECTED and collapsed(w, LANES, lane):
                status[i] = COLLAPSED
            else:
                continue
            sample[lane], steps[lane] = 0, 0
            if load_next(w, orbit, lane, queue, rows, lengths, tolerance):
                w[st.TARGET * LANES + lane] = times[0]
            else:
                running -= 1


@compiled(f"Tuple((i8, f8))({STEP}, f8[::1], f8, f8[::1], f8, i8, f8[::1], f8[::1], f8[:, ::1])")
def follow(
    step: Any, row: Any, length: float, times: Any, tolerance: float, step_limit: int, w: Any,
    old: Any, states: Any,
) -> tuple[int, float]:  # fmt: skip
    """Write the states (m, size) of one orbit at m times, all after 0 and increasing.

    step: for FEW lanes. Lane 0 marches; the other lanes compute the outputs within the last step of
    lane 0. w, old: workspaces for the lanes, and for lane 0 before its step. Returns the status and
    the time reached.
    """
    size = states.shape[1]
    _, new, flag, _ = places(size)
    for lane in range(FEW):
        load(w, FEW, lane, row, length, tolerance)
    sample, reached = 0, 0  # outputs found, and outputs that lane 0 has passed
    for _ in range(step_limit):
        helping = min(reached - sample, FEW - 1)
        for k in range(helping):
            # Longer than the time to any target, so that these lanes only look.
            w[st.LENGTH * FEW + 1 + k] = np.inf
            w[st.TARGET * FEW + 1 + k] = times[sample + k]
        # With more outputs than lanes, lane 0 waits: its target is its time.
        waits = sample + helping < reached
        w[st.TARGET * FEW] = w[st.TIME * FEW] if waits else np.inf
        before = w[st.TIME * FEW]
        # The lanes that look for outputs start from the state of lane 0 before its step.
        for j in range(len(old)):
            old[j] = w[(st.STATE + j) * FEW]
        step(w)
        for k in range(helping):
            for j in range(size):
                states[sample + k, j] = w[(new + j) * FEW + 1 + k]
        sample += helping
        if sample == len(times):
            return DONE, w[st.TIME * FEW]
        if w[flag * FEW] == st.MARCHED:
            for lane in range(1, FEW):
                w[st.TIME * FEW + lane] = before
            for j in range(len(old)):
                for lane in range(1, FEW):
                    w[(st.STATE + j) * FEW + lane] = old[j]
            while reached < len(times) and times[reached] <= w[st.TIME * FEW]:
                reached += 1
        elif w[flag * FEW] == st.REJECTED and collapsed(w, FEW, 0):
            return COLLAPSED, w[st.TIME * FEW]
    return TOO_MANY_STEPS, w[st.TIME * FEW]


STEP_TOLERANCE = 1e-14  # error of one step in the unit quaternion, near rounding
LONG_RUN_TOLERANCE = 1e-9  # the same for attractors, which depend less on errors than paths
_STEPS_PER_TURN = 600  # the largest number; most orbits take 6 to 60
_MOST_STEPS = 2**62  # below the largest value of a counter

Integers = NDArray[np.int64]
Balls = Parameters | Sequence[Parameters]
"""One ball, or several of one rolling model with equally many starts each, in order."""


@dataclass(frozen=True)
class _Orbits:
    """Motions of n starts at m times.

    attitudes (n, m, 4) quaternions, frame to world; contact_points (n, m, 2) m,
    world, from (0, 0); status (n,): DONE, TOO_MANY_STEPS or COLLAPSED. The later states of an
    abandoned orbit are NaN.
    """

    attitudes: Array
    contact_points: Array
    status: Integers


def orbits(
    parameters: Parameters,
    attitudes: Array,
    momenta: Array,
    times: Array,
    tolerance: float = STEP_TOLERANCE,
) -> _Orbits:
    """Integrate (3.2) or (3.3) from many starts, on all cores.

    attitudes: (n, 4) unit quaternions, frame to world; momenta: (n, 3) kg m²/s, world, horizontal
    in the rubber model; times: (m,) s, increasing from 0; tolerance: the error of the quaternion
    allowed in one step. Raises InputError for invalid starts or times.
    """
    times = times_of(times)
    starts = Starts(parameters, attitudes, momenta)
    states, status = starts.march(PATH, np.zeros((len(starts.turns), 2)), times[1:], tolerance)
    first = np.concatenate([starts.attitudes, np.zeros((len(states), 2))], axis=1)
    states = np.concatenate([first[:, None], states], axis=1)
    points = starts.turned_back(states[..., 4:])
    return _Orbits(starts.to_world(states[..., :4]), points, status)


def orbit(
    parameters: Parameters,
    attitude: Array,
    momentum: Array,
    times: Array,
    tolerance: float = STEP_TOLERANCE,
    max_steps: int | None = None,
) -> Array:
    """Return the attitudes and contact points (m, 4 + 2) of one motion, for dense times.

    attitude (4,), momentum (3,), times (m,), tolerance: as in `orbits`. Raises InputError if the
    motion needs more than max_steps, or if a step becomes too short.
    """
    times = times_of(times)
    starts = Starts(parameters, attitude[None], momentum[None])
    states = np.empty((len(times), PATH.size))
    states[0] = (*starts.attitudes[0], 0.0, 0.0)
    length = starts.first_lengths(times[-1], tolerance)[0]
    limit = starts.step_limit(times[-1]) if max_steps is None else max_steps
    step, row = st.stepper(PATH, parameters.rolling, FEW), starts.rows_of(PATH, np.zeros((1, 2)))[0]
    _, new, _, total = places(PATH.size)
    most, space, old = limit + len(times), np.zeros(total * FEW), np.zeros(new - st.STATE)
    status, reached = follow(step, row, length, times[1:], tolerance, most, space, old, states[1:])
    if status == TOO_MANY_STEPS:
        speed = math.hypot(*angular_velocity(parameters, attitude, momentum))
        raise too_many_steps(limit, reached, times[-1], speed)
    if status == COLLAPSED:
        raise InputError(
            f"the step became too short at t = {reached:g} s: allow a larger error in one step"
        )
    # In pieces, because the copies would take several times the memory of a long motion.
    for piece in pieces(len(times)):
        states[piece, :4] = starts.to_world(states[None, piece, :4])[0]
        states[piece, 4:] = starts.turned_back(states[None, piece, 4:])[0]
    return states


def angular_velocity(parameters: Parameters, attitude: Array, momentum: Array) -> Array:
    """Return ω (3,) in frame axes [rad/s]."""
    axes = rotation_matrix(attitude)
    return np.array(parameters.angular_velocity(as_vector(momentum @ axes), as_vector(axes[2])))


def kernel_start(scene: Scene) -> tuple[Parameters, Array, Array]:
    """Return a scene's Parameters, attitudes (1, 4) of the principal axes and momenta (1, 3)."""
    attitude = multiply(scene.start.attitude, scene.principal_quaternion)
    return scene.parameters, attitude[None], scene.start.momentum[None]


class Starts:
    """Starts for the stepper, turned about the vertical so that M = -mα + cγ.

    Attributes
    ----------
    attitudes : (n, 4)
        The turned attitudes.
    rows : (n, k)
        The constants of each orbit.
    turns : (n,), rad
        The angles of the turns.
    size : (n,), kg m²/s
        |M|.
    fastest : (n,), rad/s
        A bound on |ω|.
    """

    def __init__(self, balls: Balls, attitudes: Array, momenta: Array) -> None:
        several = [balls] if isinstance(balls, Parameters) else balls
        attitudes = np.atleast_2d(np.asarray(attitudes, dtype=float))
        momenta = np.atleast_2d(np.asarray(momenta, dtype=float))
        _check_starts(several, attitudes, momenta)
        self.rolling = several[0].rolling
        self.size = np.linalg.norm(momenta, axis=1)
        sizes = np.split(self.size, len(several))
        self.fastest = np.concatenate([*map(check_speed, several, sizes)])
        across = np.hypot(momenta[:, 0], momenta[:, 1])
        # The horizontal part of M = -mα + cγ is opposite to α; a vertical M needs no turn.
        self.turns = np.where(across > 0, np.arctan2(-momenta[:, 1], -momenta[:, 0]), 0.0)
        unit = attitudes / np.linalg.norm(attitudes, axis=1, keepdims=True)
        self.attitudes = _turned_starts(-self.turns, unit)
        numbers = np.repeat([st.row_of(ball) for ball in several], len(sizes[0]), axis=0)
        level = np.stack([across, momenta[:, 2]], axis=1)
        no_section = np.zeros((len(level), st.STATE - st.SECTION))
        self.rows = np.concatenate([numbers, level, no_section], axis=1)

    def rows_of(self, system: System, rest: Array) -> Array:
        """Return constants, states and slopes (n, k) in columns, for `load`.

        rest: (n, size - 4), the numbers of the first state after the quaternion.
        """
        columns = list(self.rows.T)
        parameters = st.ball_of(self.rolling, columns[: st.LEVEL - st.BALL])
        level = st.level_of(self.rolling, columns[st.LEVEL - st.BALL : st.SECTION - st.BALL])
        states = np.concatenate([self.attitudes, rest], axis=1)
        slopes = system.rate(tuple(states.T), parameters, level)
        return np.concatenate([self.rows, states, np.stack(slopes, axis=1)], axis=1)

    def march(
        self, system: System, rest: Array, times: Array, tolerance: float
    ) -> tuple[Array, Integers]:
        """Return a system's states (n, m, size), in turned axes, and status (n,) at times (m,) > 0.

        rest: as in `rows_of`.
        """
        n = len(self.rows)
        # The later states of an abandoned orbit stay NaN.
        states, status = np.full((n, len(times), system.size), np.nan), np.zeros(n, np.int64)
        step = st.stepper(system, self.rolling)
        rows = self.rows_of(system, rest)
        lengths = self.first_lengths(times[-1], tolerance)
        # An output takes an additional step, which only looks.
        stops, limit = np.ascontiguousarray(times), self.step_limit(times[-1]) + len(times)

        def march(queue: Queue) -> None:
            space = work(system.size, 3)
            march_lanes(step, queue, rows, lengths, stops, tolerance, limit, *space, states, status)

        in_threads(march, math.ceil(n / LANES))
        return states, status

    def first_lengths(self, duration: float, tolerance: float) -> Array:
        """Return a rather short first step (n,) for each orbit [s]; steps grow."""
        # A radian at the bound on |ω| for a tolerance of 1, with the pair's lower order, 8.
        return np.minimum(duration, tolerance**0.125 / np.maximum(self.fastest, 1e-300))

    def step_limit(self, duration: float) -> int:
        """Return more steps than any orbit needs, so that no orbit blocks the others."""
        turns = float(self.fastest.max()) * duration / (2 * np.pi)
        return int(min(1000 + _STEPS_PER_TURN * turns, _MOST_STEPS))

    def to_world(self, attitudes: Array) -> Array:
        """Return attitudes (n, m, 4) in world axes."""
        return _turned_starts(self.turns[:, None], attitudes)

    def turned_back(self, points: Array) -> Array:
        """Return points (n, m, 2) of the plane in world axes."""
        cos, sin = np.cos(self.turns)[:, None], np.sin(self.turns)[:, None]
        X, Y = points[..., 0], points[..., 1]
        return np.stack([cos * X - sin * Y, sin * X + cos * Y], axis=-1)


def _turned_starts(angles: Array, attitudes: Array) -> Array:
    """Return attitudes (..., 4) after turns (...) about the vertical [rad]."""
    zero = np.zeros(angles.shape)
    turns = np.stack([np.cos(angles / 2), zero, zero, np.sin(angles / 2)], axis=-1)
    return multiply(turns, attitudes)


def _check_starts(balls: Sequence[Parameters], attitudes: Array, momenta: Array) -> None:
    """Raise InputError unless attitudes (n, 4) and momenta (n, 3) are starts of sound balls."""
    for ball in balls:
        if not np.isfinite(st.row_of(ball)).all():
            raise InputError(f"the numbers of the ball are not finite: {ball}")
    if attitudes.shape[1:] != (4,) or momenta.shape != (len(attitudes), 3):
        raise InputError(
            f"n starts are attitudes (n, 4) and momenta (n, 3), not {attitudes.shape} and "
            f"{momenta.shape}"
        )
    if len(attitudes) == 0 or not (np.isfinite(attitudes).all() and np.isfinite(momenta).all()):
        raise InputError("starts must be at least one, and finite")
    # A smaller deviation is rounding and is removed.
    if np.abs(np.linalg.norm(attitudes, axis=1) - 1).max() > 1e-9:
        raise InputError("attitudes must be unit quaternions")
    if not balls or len(attitudes) % len(balls) or len({ball.rolling for ball in balls}) > 1:
        raise InputError(
            f"{len(balls)} balls need equally many starts each, of {len(attitudes)}, and one "
            "rolling model"
        )
    vertical = np.abs(momenta[:, 2])
    if balls[0].rolling == "rubber" and (vertical > 1e-9 * np.linalg.norm(momenta, axis=1)).any():
        raise InputError("momenta must be horizontal in the rubber model, see (3.1)")
