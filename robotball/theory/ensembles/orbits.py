"""Many motions at once, or one closely sampled, by compiled loops that drive the compiled step.

Each lane has an orbit of its own, with its own step length and acceptance, and takes the next
orbit of the queue when it is done; threads share a queue. A step has no memory: a state asked for
within a step is found by a shorter step from the same start, so no interpolant is needed and every
output has the full order.

All axes named "frame" here are the principal axes of the ball's inertia, as in Parameters.
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
from robotball.robot import formulas as eq
from robotball.robot.formulas import Parameters, as_vector, check_speed
from robotball.robot.scene import Scene, check_times
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.theory.compiled import Function, compiled_from, inlined, text_of
from robotball.theory.ensembles.flatten import FEW, LANES
from robotball.theory.ensembles.steppers import (
    ALLOWED,
    BALL,
    LENGTH,
    LEVEL,
    LOOKED,
    MARCHED,
    PATH,
    REJECTED,
    SECTION,
    STATE,
    TARGET,
    TIME,
    System,
    ball_of,
    level_of,
    places,
    row_of,
    stepper,
)  # fmt: skip

DONE, TOO_MANY_STEPS, COLLAPSED = 0, 1, 2  # the status of an orbit at its end
STEP = "FunctionType(void(f8[::1]))"
_SOURCES = text_of(*sorted(Path(__file__).parent.glob("*.py")))


def compiled(signature: str) -> Callable[[Function], Function]:
    """Return a decorator that compiles a loop of this folder."""
    return compiled_from(_SOURCES, signature)


def work(size: int, counters: int) -> tuple[Array, tuple[Array, ...]]:
    """Return what a loop keeps of its lanes: the step's numbers, and so many integers of each.

    Arrays that compiled code makes by itself would be a quarter of what is compiled.
    """
    return np.zeros(places(size)[3] * LANES), tuple(np.zeros((counters, LANES), np.int64))


def _take(_: Any, queue: Any) -> Any:
    """Return the number that a queue (1,) holds, which then holds the next, atomically."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        one = context.get_constant(types.int64, 1)
        # Atomic, as threads share a queue without a lock; it orders no other memory.
        return builder.atomic_rmw("add", array.data, one, "monotonic")

    return types.int64(queue), generate


take: Any = intrinsic(_take)


@inlined
def load(w: Any, lanes: int, lane: int, row: Any, length: float, tolerance: float) -> None:
    """Put an orbit into one of so many lanes; row: the rows from BALL on, up to its slope's end."""
    w[LENGTH * lanes + lane] = length
    w[ALLOWED * lanes + lane] = tolerance
    w[TIME * lanes + lane] = 0.0
    w[TARGET * lanes + lane] = np.inf
    for j in range(len(row)):
        w[(BALL + j) * lanes + lane] = row[j]


@inlined
def load_next(
    w: Any, orbit: Any, lane: int, queue: Any, rows: Any, lengths: Any, tolerance: float
) -> bool:
    """Put the queue's next orbit into a lane. Returns False, with orbit -1, where none is left."""
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
    time = w[TIME * lanes + lane]
    return time + w[LENGTH * lanes + lane] == time


@compiled(
    f"void({STEP}, i8[::1], f8[:, ::1], f8[::1], f8[::1], f8, i8, f8[::1], UniTuple(i8[::1], 3), "
    "f8[:, :, ::1], i8[::1])"
)
def march_lanes(
    step: Any, queue: Any, rows: Any, lengths: Any, times: Any, tolerance: float, step_limit: int,
    w: Any, counters: Any, states: Any, status: Any,
) -> None:  # fmt: skip
    """Write the states (n, m, size) of n orbits at m times, all after 0 and increasing.

    queue: for `take`, of the orbits that are still to be done; rows: (n, k) as `load` takes them;
    lengths: (n,) s, of each orbit's first step; w, counters: of `work`. Writes states and status
    (n,) of those that it takes; the states of an orbit that is given up stay as they were.
    """
    size = states.shape[2]
    _, new, flag, _ = places(size)
    orbit, sample, steps = counters
    running = 0
    for lane in range(LANES):
        load(w, LANES, lane, rows[0], lengths[0], tolerance)  # idle lanes compute too, to no end
        if load_next(w, orbit, lane, queue, rows, lengths, tolerance):
            w[TARGET * LANES + lane] = times[0]
            running += 1
    while running > 0:
        step(w)
        for lane in range(LANES):
            i = orbit[lane]
            if i < 0:
                continue
            steps[lane] += 1
            if w[flag * LANES + lane] == LOOKED:
                for j in range(size):
                    states[i, sample[lane], j] = w[(new + j) * LANES + lane]
                sample[lane] += 1
                if sample[lane] < len(times):
                    w[TARGET * LANES + lane] = times[sample[lane]]
                    continue
                status[i] = DONE
            elif steps[lane] >= step_limit:
                status[i] = TOO_MANY_STEPS
            elif w[flag * LANES + lane] == REJECTED and collapsed(w, LANES, lane):
                status[i] = COLLAPSED
            else:
                continue
            sample[lane], steps[lane] = 0, 0
            if load_next(w, orbit, lane, queue, rows, lengths, tolerance):
                w[TARGET * LANES + lane] = times[0]
            else:
                running -= 1


@compiled(f"Tuple((i8, f8))({STEP}, f8[::1], f8, f8[::1], f8, i8, f8[::1], f8[::1], f8[:, ::1])")
def follow(
    step: Any, row: Any, length: float, times: Any, tolerance: float, step_limit: int, w: Any,
    old: Any, states: Any,
) -> tuple[int, float]:  # fmt: skip
    """Write the states (m, size) of one orbit at m times, all after 0 and increasing.

    step: of FEW lanes. Lane 0 marches; the others look for the outputs within the step that it took
    before. w, old: for the numbers of the lanes, and of lane 0 before its step. Returns the status
    and the time that was reached.
    """
    size = states.shape[1]
    _, new, flag, _ = places(size)
    for lane in range(FEW):
        load(w, FEW, lane, row, length, tolerance)
    sample, reached = 0, 0  # outputs found, and outputs that lane 0 has passed
    for _ in range(step_limit):
        helping = min(reached - sample, FEW - 1)
        for k in range(helping):
            # Longer than the way to any target, so that these lanes only look.
            w[LENGTH * FEW + 1 + k] = np.inf
            w[TARGET * FEW + 1 + k] = times[sample + k]
        # With more outputs than lanes, lane 0 waits: it looks at where it stands.
        waits = sample + helping < reached
        w[TARGET * FEW] = w[TIME * FEW] if waits else np.inf
        before = w[TIME * FEW]
        # Kept, as those that look for outputs start where lane 0 stands before its step.
        for j in range(len(old)):
            old[j] = w[(STATE + j) * FEW]
        step(w)
        for k in range(helping):
            for j in range(size):
                states[sample + k, j] = w[(new + j) * FEW + 1 + k]
        sample += helping
        if sample == len(times):
            return DONE, w[TIME * FEW]
        if w[flag * FEW] == MARCHED:
            for lane in range(1, FEW):
                w[TIME * FEW + lane] = before
            for j in range(len(old)):
                for lane in range(1, FEW):
                    w[(STATE + j) * FEW + lane] = old[j]
            while reached < len(times) and times[reached] <= w[TIME * FEW]:
                reached += 1
        elif w[flag * FEW] == REJECTED and collapsed(w, FEW, 0):
            return COLLAPSED, w[TIME * FEW]
    return TOO_MANY_STEPS, w[TIME * FEW]


# The error of one step in the unit quaternion: near the least that double precision can judge.
STEP_TOLERANCE = 1e-14
# The error of one step where the long run counts: an attractor forgives what a path does not.
LONG_RUN_TOLERANCE = 1e-9
_STEPS_PER_TURN = 600  # allowed, where an ordinary orbit takes 6 to 60
_MOST_STEPS = 2**62  # what a counter holds

Integers = NDArray[np.int64]
Balls = Parameters | Sequence[Parameters]
"""One ball, or several of one rolling model with equally many starts each, in their order."""


@dataclass(frozen=True)
class _Orbits:
    """Motions of n starts at m times.

    attitudes (n, m, 4) quaternions, frame to world; contact_points (n, m, 2) m,
    world, from (0, 0); status (n,): DONE, TOO_MANY_STEPS or COLLAPSED. What was given up is NaN
    from there on.
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
    allowed in one step. Raises InputError on unusable starts or times.
    """
    times = check_times(times)
    starts = Starts(parameters, attitudes, momenta)
    states, status = starts.march(PATH, np.zeros((len(starts.turns), 2)), times[1:], tolerance)
    first = np.concatenate([starts.attitudes, np.zeros((len(states), 2))], axis=1)
    states = np.concatenate([first[:, None], states], axis=1)
    return _Orbits(
        attitudes=starts.to_world(states[..., :4]),
        contact_points=starts.turned_back(states[..., 4:]),
        status=status,
    )


def orbit(
    parameters: Parameters,
    attitude: Array,
    momentum: Array,
    times: Array,
    tolerance: float = STEP_TOLERANCE,
    max_steps: int | None = None,
) -> Array:
    """Return the attitudes and contact points (m, 4 + 2) of one motion, for times close together.

    attitude (4,), momentum (3,), times (m,), tolerance: as for `orbits`. Raises InputError where
    the motion would be given up, or needs more than max_steps.
    """
    times = check_times(times)
    starts = Starts(parameters, attitude[None], momentum[None])
    states = np.empty((len(times), PATH.size))
    states[0] = (*starts.attitudes[0], 0.0, 0.0)
    length = starts.first_lengths(times[-1], tolerance)[0]
    limit = starts.step_limit(times[-1]) if max_steps is None else max_steps
    step, row = stepper(PATH, parameters.rolling, FEW), starts.rows_of(PATH, np.zeros((1, 2)))[0]
    _, new, _, total = places(PATH.size)
    status, reached = follow(
        step, row, length, times[1:], tolerance, limit + len(times), np.zeros(total * FEW),
        np.zeros(new - STATE), states[1:],
    )  # fmt: skip
    if status == TOO_MANY_STEPS:
        speed = math.hypot(*angular_velocity(parameters, attitude, momentum))
        raise too_many_steps(limit, reached, times[-1], speed)
    if status == COLLAPSED:
        raise InputError(
            f"the orbit was given up: the step length fell to nothing at t = {reached:g} s"
        )
    # Piece by piece: the copies would else take several times the memory of a long motion.
    for piece in pieces(len(times)):
        states[piece, :4] = starts.to_world(states[None, piece, :4])[0]
        states[piece, 4:] = starts.turned_back(states[None, piece, 4:])[0]
    return states


def angular_velocity(parameters: Parameters, attitude: Array, momentum: Array) -> Array:
    """Return ω (3,) in frame axes [rad/s]."""
    axes = rotation_matrix(attitude)
    return np.array(parameters.angular_velocity(as_vector(momentum @ axes), as_vector(axes[2])))


def kernel_start(scene: Scene) -> tuple[Parameters, Array, Array]:
    """Return a scene's Parameters, attitudes (1, 4) and momenta (1, 3), as `orbits` takes them.

    The attitude is that of the principal axes, in which Parameters are.
    """
    attitude = multiply(scene.start.attitude, scene.principal_quaternion)
    return scene.parameters, attitude[None], scene.start.momentum[None]


class Starts:
    """Starts as the stepper takes them: turned about the vertical until M = -mα + cγ.

    Of one ball, or of several of one rolling model with equally many starts each, in their order.
    attitudes: (n, 4) so turned; rows: (n, k), the constants of each orbit; turns: (n,) rad;
    size: (n,) |M| kg m²/s; fastest: (n,) rad/s, a bound on |ω|.
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
        # M = -mα + cγ has its horizontal part against α; a vertical M has none to turn.
        self.turns = np.where(across > 0, np.arctan2(-momenta[:, 1], -momenta[:, 0]), 0.0)
        unit = attitudes / np.linalg.norm(attitudes, axis=1, keepdims=True)
        self.attitudes = _turned_starts(-self.turns, unit)
        numbers = np.repeat([row_of(ball) for ball in several], len(sizes[0]), axis=0)
        level = np.stack([across, momenta[:, 2]], axis=1)
        no_section = np.zeros((len(level), STATE - SECTION))
        self.rows = np.concatenate([numbers, level, no_section], axis=1)

    def rows_of(self, system: System, rest: Array) -> Array:
        """Return constants, states and slopes (n, k), side by side, as `load` takes them.

        rest: (n, size - 4), the numbers of the first state after the quaternion.
        """
        columns = list(self.rows.T)
        parameters = ball_of(self.rolling, columns[: LEVEL - BALL])
        level = level_of(self.rolling, columns[LEVEL - BALL : SECTION - BALL])
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
        # An orbit that is given up writes no more, and its states stay NaN from there on.
        states, status = np.full((n, len(times), system.size), np.nan), np.zeros(n, np.int64)
        step = stepper(system, self.rolling)
        rows = self.rows_of(system, rest)
        lengths = self.first_lengths(times[-1], tolerance)
        # An output takes a step of its own, which looks and does not move.
        stops, limit = np.ascontiguousarray(times), self.step_limit(times[-1]) + len(times)

        def march(queue: Queue) -> None:
            own = work(system.size, 3)
            march_lanes(step, queue, rows, lengths, stops, tolerance, limit, *own, states, status)

        in_threads(march, math.ceil(n / LANES))
        return states, status

    def first_lengths(self, duration: float, tolerance: float) -> Array:
        """Return a first step (n,) for each orbit, rather short; it grows by itself [s]."""
        # A radian by the bound on |ω|, for a tolerance of 1, at the pair's lower order, 8.
        return np.minimum(duration, tolerance**0.125 / np.maximum(self.fastest, 1e-300))

    def step_limit(self, duration: float) -> int:
        """Return more steps than any orbit needs, so that none can hang the others."""
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
    turns = (np.cos(angles / 2), 0.0, 0.0, np.sin(angles / 2))
    return np.stack(eq.quaternion_product(turns, components(attitudes)), axis=-1)


def components(q: Array) -> eq.Quaternion:
    """Return quaternions (..., 4) as four columns (...)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    return (w, x, y, z)


def _check_starts(balls: Sequence[Parameters], attitudes: Array, momenta: Array) -> None:
    """Raise InputError unless attitudes (n, 4) and momenta (n, 3) are starts of sound balls."""
    for ball in balls:
        if not np.isfinite(row_of(ball)).all():
            raise InputError(f"the numbers of the ball are not finite: {ball}")
    if attitudes.shape[1:] != (4,) or momenta.shape != (len(attitudes), 3):
        raise InputError(
            f"n starts are attitudes (n, 4) and momenta (n, 3), not {attitudes.shape} and "
            f"{momenta.shape}"
        )
    if len(attitudes) == 0 or not (np.isfinite(attitudes).all() and np.isfinite(momenta).all()):
        raise InputError("starts must be at least one, and finite")
    # Nearer to one is rounding, and is scaled away.
    if np.abs(np.linalg.norm(attitudes, axis=1) - 1).max() > 1e-9:
        raise InputError("attitudes must be unit quaternions")
    if not balls or len(attitudes) % len(balls) or len({ball.rolling for ball in balls}) > 1:
        raise InputError(
            f"{len(balls)} balls need equally many starts each, of {len(attitudes)}, and one "
            "rolling model"
        )
    vertical = np.abs(momenta[:, 2])
    if balls[0].rolling == "rubber" and (vertical > 1e-9 * np.linalg.norm(momenta, axis=1)).any():
        raise InputError("momenta must be horizontal in the rubber model, by (3.1)")
