"""The compiled loops that drive a step: many orbits in lanes, or one orbit closely sampled.

Each lane has an orbit of its own, with its own step length and acceptance, and takes the next
orbit of the queue when it is done; threads share a queue. A step has no memory: a state asked for
within a step is found by a shorter step from the same start, so no interpolant is needed and every
output has the full order.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from robotball.engines.kept import Function, compiled_from
from robotball.engines.reduced.compiled.flatten import FEW, LANES
from robotball.engines.reduced.compiled.steppers import (
    ALLOWED,
    BALL,
    LENGTH,
    LOOKED,
    MARCHED,
    REJECTED,
    STATE,
    TARGET,
    TIME,
    places,
)

DONE, TOO_MANY_STEPS, COLLAPSED = 0, 1, 2
STEP = "FunctionType(void(f8[::1]))"
COMPILED_FROM = ("flatten", "steppers", "marching", "crossing")


@cache
def sources() -> str:
    """All the source that the loops are compiled from."""
    folder = Path(__file__).parent
    return "".join((folder / f"{name}.py").read_text(encoding="utf-8") for name in COMPILED_FROM)


def compiled(signature: str) -> Callable[[Function], Function]:
    """Numba's njit with what every loop here wants."""
    return compiled_from(sources(), signature, nogil=True, error_model="numpy")


def _take(_: Any, queue: Any) -> Any:
    """The number that a queue (1,) holds, which then holds the next; no other thread gets it."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        one = context.get_constant(types.int64, 1)
        return builder.atomic_rmw("add", array.data, one, "monotonic")

    return types.int64(queue), generate


take: Any = intrinsic(_take)


@compiled("void(f8[::1], i8, i8, f8[::1], f8, f8)")
def load(w: Any, lanes: int, lane: int, row: Any, length: float, tolerance: float) -> None:
    """Put an orbit into one of so many lanes; row: the rows from BALL on, up to its slope's end."""
    w[LENGTH * lanes + lane] = length
    w[ALLOWED * lanes + lane] = tolerance
    w[TIME * lanes + lane] = 0.0
    w[TARGET * lanes + lane] = np.inf
    for j in range(len(row)):
        w[(BALL + j) * lanes + lane] = row[j]


@compiled("b1(f8[::1], i8, i8)")
def collapsed(w: Any, lanes: int, lane: int) -> bool:
    """Whether a lane's step is too short to move its time."""
    time = w[TIME * lanes + lane]
    return time + w[LENGTH * lanes + lane] == time


@compiled(f"void({STEP}, i8[::1], f8[:, ::1], f8[::1], f8[::1], f8, i8, f8[:, :, ::1], i8[::1])")
def march(
    step: Any,
    queue: Any,
    rows: Any,
    lengths: Any,
    times: Any,
    tolerance: float,
    step_limit: int,
    states: Any,
    status: Any,
) -> None:
    """States (n, m, size) of n orbits at m times, all after 0 and increasing.

    queue: for `take`, of the orbits that are still to be done; rows: (n, k) as `load` takes them;
    lengths: (n,) s, of each orbit's first step. Writes states and status (n,) of those that it
    takes; the states of an orbit that is given up stay as they were.
    """
    size = states.shape[2]
    _, new, flag, total = places(size)
    w = np.zeros(total * LANES)
    orbit = np.full(LANES, -1)
    sample, steps = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    running = 0
    for lane in range(LANES):
        load(w, LANES, lane, rows[0], lengths[0], tolerance)  # idle lanes compute too, to no end
        waiting = take(queue)
        if waiting < len(rows):
            load(w, LANES, lane, rows[waiting], lengths[waiting], tolerance)
            w[TARGET * LANES + lane] = times[0]
            orbit[lane] = waiting
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
            waiting = take(queue)
            if waiting < len(rows):
                load(w, LANES, lane, rows[waiting], lengths[waiting], tolerance)
                w[TARGET * LANES + lane] = times[0]
                orbit[lane], sample[lane], steps[lane] = waiting, 0, 0
            else:
                orbit[lane] = -1
                running -= 1


@compiled(f"Tuple((i8, f8))({STEP}, f8[::1], f8, f8[::1], f8, i8, f8[:, ::1])")
def follow(
    step: Any, row: Any, length: float, times: Any, tolerance: float, step_limit: int, states: Any
) -> tuple[int, float]:
    """States (m, size) of one orbit at m times, all after 0 and increasing.

    step: of FEW lanes. Returns the status and the time that it reached.
    Lane 0 marches; the others look for the outputs within the step that it took before.
    """
    size = states.shape[1]
    _, new, flag, total = places(size)
    w, old = np.zeros(total * FEW), np.zeros(new - STATE)
    for lane in range(FEW):
        load(w, FEW, lane, row, length, tolerance)
    sample, reached = 0, 0  # outputs found, and outputs that lane 0 has passed
    for _ in range(step_limit):
        helping = min(reached - sample, FEW - 1)
        for k in range(helping):
            w[LENGTH * FEW + 1 + k] = np.inf
            w[TARGET * FEW + 1 + k] = times[sample + k]
        # With more outputs than lanes, lane 0 waits: it looks at where it stands.
        waits = sample + helping < reached
        w[TARGET * FEW] = w[TIME * FEW] if waits else np.inf
        before = w[TIME * FEW]
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
