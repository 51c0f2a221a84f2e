"""The compiled loops that drive a step: many orbits in lanes, or one orbit closely sampled.

Each lane has an orbit of its own, with its own step length and acceptance, and takes the next
orbit of the queue when it is done. A step has no memory: a state asked for within a step is
found by a shorter step from the same start, so no interpolant is needed and every output has
the full order.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import njit

from robotball.flatten import LANES
from robotball.steppers import BALL, LENGTH, STATE, TOLERANCE

Function = TypeVar("Function", bound=Callable[..., Any])

DONE, TOO_MANY_STEPS, COLLAPSED = 0, 1, 2
STEP = "FunctionType(void(f8[::1]))"
# Step-length control: of order 8, with the usual safety and limits of change.
SAFETY, LEAST_CHANGE, MOST_CHANGE = 0.9, 0.2, 6.0


def compiled(signature: str) -> Callable[[Function], Function]:
    """Numba's njit with what every loop here wants."""
    return njit(signature, cache=True, nogil=True, error_model="numpy")


@compiled("f8(f8, f8)")
def next_length(length: float, ratio: float) -> float:
    """The length to try after one whose (error/tolerance)^(1/8) was `ratio`."""
    if ratio * MOST_CHANGE < SAFETY:
        return length * MOST_CHANGE
    # NaN fails every comparison, and so shrinks the step.
    if ratio * LEAST_CHANGE < SAFETY:
        return length * SAFETY / ratio
    return length * LEAST_CHANGE


@compiled("void(f8[::1], i8, f8[::1], f8)")
def load(w: Any, lane: int, row: Any, tolerance: float) -> None:
    """Put an orbit into a lane; row: the rows BALL and after, up to the end of its state."""
    w[TOLERANCE * LANES + lane] = tolerance
    for j in range(len(row)):
        w[(BALL + j) * LANES + lane] = row[j]


@compiled(f"void({STEP}, f8[:, ::1], f8[::1], f8[::1], f8, i8, f8[:, :, ::1], i8[::1])")
def march(
    step: Any,
    rows: Any,
    lengths: Any,
    times: Any,
    tolerance: float,
    step_limit: int,
    states: Any,
    status: Any,
) -> None:
    """States (n, m, size) of n orbits at m times, all after 0 and increasing.

    rows: (n, k) as `load` takes them; lengths: (n,) s, of each orbit's first step. Writes states
    and status (n,); the states of an orbit that is given up stay as they were.
    """
    size = states.shape[2]
    w = np.zeros((STATE + 2 * size + 8) * LANES)
    new, ratio_row = STATE + size, STATE + 2 * size
    orbit = np.full(LANES, -1)
    sample, steps = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    t, h = np.zeros(LANES), np.zeros(LANES)
    waiting, running = 0, 0
    for lane in range(LANES):
        # Idle lanes compute too: give them something finite.
        load(w, lane, rows[0], tolerance)
    while True:
        for lane in range(LANES):
            if orbit[lane] < 0 and waiting < len(rows):
                load(w, lane, rows[waiting], tolerance)
                orbit[lane], t[lane], h[lane] = waiting, 0.0, lengths[waiting]
                sample[lane], steps[lane] = 0, 0
                waiting += 1
                running += 1
            if orbit[lane] >= 0:
                w[LENGTH * LANES + lane] = min(h[lane], times[sample[lane]] - t[lane])
        if running == 0:
            return
        step(w)
        for lane in range(LANES):
            i = orbit[lane]
            if i < 0:
                continue
            length, ratio = w[LENGTH * LANES + lane], w[ratio_row * LANES + lane]
            steps[lane] += 1
            if not ratio <= 1:
                h[lane] = next_length(length, ratio)
                if t[lane] + h[lane] == t[lane]:
                    status[i], orbit[lane] = COLLAPSED, -1
            elif t[lane] + length >= times[sample[lane]] or length < h[lane]:
                # An output: a look ahead from where the orbit stands.
                for j in range(size):
                    states[i, sample[lane], j] = w[(new + j) * LANES + lane]
                sample[lane] += 1
                if sample[lane] == len(times):
                    status[i], orbit[lane] = DONE, -1
            else:
                t[lane] += length
                h[lane] = next_length(length, ratio)
                for j in range(size):
                    w[(STATE + j) * LANES + lane] = w[(new + j) * LANES + lane]
            if orbit[lane] >= 0 and steps[lane] >= step_limit:
                status[i], orbit[lane] = TOO_MANY_STEPS, -1
            if orbit[lane] < 0:
                running -= 1


@compiled(f"i8({STEP}, f8[::1], f8, f8[::1], f8, i8, f8[:, ::1])")
def follow(
    step: Any, row: Any, length: float, times: Any, tolerance: float, step_limit: int, states: Any
) -> int:
    """States (m, size) of one orbit at m times, all after 0 and increasing; returns the status.

    Lane 0 marches; the others find the outputs within the step that it took before.
    """
    size = states.shape[1]
    w = np.zeros((STATE + 2 * size + 8) * LANES)
    new, ratio_row = STATE + size, STATE + 2 * size
    for lane in range(LANES):
        load(w, lane, row, tolerance)
    t, before = 0.0, 0.0  # where lane 0 stands, and where the step before started
    sample, reached = 0, 0  # outputs done, and outputs that `t` has passed
    for _ in range(step_limit):
        helping = min(reached - sample, LANES - 1)
        w[LENGTH * LANES] = length
        for k in range(helping):
            w[LENGTH * LANES + 1 + k] = times[sample + k] - before
        step(w)
        for k in range(helping):
            for j in range(size):
                states[sample + k, j] = w[(new + j) * LANES + 1 + k]
        sample += helping
        if sample == len(times):
            return DONE
        if sample < reached:
            continue  # more outputs than lanes: lane 0 waits for them
        ratio = w[ratio_row * LANES]
        if ratio <= 1:
            for j in range(size):
                for lane in range(1, LANES):
                    w[(STATE + j) * LANES + lane] = w[(STATE + j) * LANES]
                w[(STATE + j) * LANES] = w[(new + j) * LANES]
            before, t = t, t + length
            while reached < len(times) and times[reached] <= t:
                reached += 1
        length = next_length(length, ratio)
        if t + length == t:
            return COLLAPSED
    return TOO_MANY_STEPS
