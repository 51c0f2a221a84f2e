"""The compiled loop that finds where orbits cross a section, in lanes.

A lane marches until the section function changes sign over a step; then it looks back from the
step's end, by whole steps of Newton's kind, each kept inside the bracket, until the function is
zero. A step over which the function turns back near zero is looked into as well, for two
crossings may hide in it.
"""

import math
from typing import Any

import numpy as np

from robotball.engines.compiled import inlined
from robotball.engines.ensembles.flatten import LANES
from robotball.engines.ensembles.orbits import (
    COLLAPSED,
    DONE,
    STEP,
    TOO_MANY_STEPS,
    collapsed,
    compiled,
    load,
    load_next,
)
from robotball.engines.ensembles.steppers import ALLOWED, REJECTED, TARGET, TIME, places

RESIDUAL = 1e-13  # of the section function, which is at most 1
ON_SECTION = 1e-12  # a start that near counts as on the section, not as before or behind it
# How near to zero an estimated turning point is looked at: steps of a radian estimate it to 5e-3.
NEAR = 0.03
BEHIND = -0.1  # cos(g - g₀) below that at both ends of a step is below zero all along
TINY = 1e-300  # a value with a sign and nothing else
ROOT_TRIES, TURN_TRIES = 60, 3
STARTING, MARCHING, TO_ROOT, AT_ROOT, TO_TURN = 0, 1, 2, 3, 4  # what a lane is doing
# Where the section function is known, one after the other on a lane's track: where the orbit
# stands, at the ends of what is looked into, at a turning point between two crossings, and what
# was just seen. Each is a time, a value and a rate; times count from where the orbit stands,
# because a small residual needs all their digits.
HERE, LOW, HIGH, TURN, SEEN, TRACK = 0, 3, 6, 9, 12, 15


@inlined
def put(tracks: Any, lane: int, target: int, source: int) -> None:
    """Copy time, value and rate from one place of a lane's track to another."""
    for j in range(3):
        tracks[lane, target + j] = tracks[lane, source + j]


@inlined
def root_estimate(tracks: Any, lane: int) -> float:
    """The time between LOW and HIGH, of opposite values, where the value may be zero.

    By the cubic in the value that has both times and rates where it is monotonic, else the middle.
    """
    low, high = tracks[lane, LOW], tracks[lane, HIGH]
    span, rise = high - low, tracks[lane, HIGH + 1] - tracks[lane, LOW + 1]
    slope = rise / span
    from_low, from_high = slope / tracks[lane, LOW + 2], slope / tracks[lane, HIGH + 2]
    u = -tracks[lane, LOW + 1] / rise
    part = u * u * (3 - 2 * u) + u * (1 - u) * ((1 - u) * from_low - u * from_high)
    monotonic = 0 <= from_low <= 3 and 0 <= from_high <= 3
    return low + span * (part if monotonic and 0 < part < 1 else 0.5)


@inlined
def turning_part(tracks: Any, lane: int) -> float:
    """The part of the way from LOW to HIGH at which the rate may pass zero."""
    return tracks[lane, LOW + 2] / (tracks[lane, LOW + 2] - tracks[lane, HIGH + 2])


@inlined
def may_hide_two(tracks: Any, lane: int) -> bool:
    """Whether the value, of one sign at LOW and HIGH, goes near zero or past it between them."""
    low, low_rate = tracks[lane, LOW + 1], tracks[lane, LOW + 2]
    high, high_rate = tracks[lane, HIGH + 1], tracks[lane, HIGH + 2]
    if low * low_rate >= 0 or high * high_rate <= 0:
        return False
    u, span = turning_part(tracks, lane), tracks[lane, HIGH] - tracks[lane, LOW]
    value = (
        low * (1 + 2 * u) * (1 - u) ** 2
        + high * u * u * (3 - 2 * u)
        + span * u * (1 - u) * (low_rate * (1 - u) - high_rate * u)
    )
    return abs(value) < NEAR or value * low < 0


@inlined
def marched(tracks: Any, lane: int, length: float) -> int:
    """What to do after a step of a length."""
    put(tracks, lane, LOW, HERE)
    tracks[lane, LOW] = -length
    put(tracks, lane, HERE, SEEN)
    tracks[lane, HERE] = 0.0
    if tracks[lane, SEEN + 1] == 0:
        tracks[lane, HERE + 1] = math.copysign(TINY, tracks[lane, LOW + 1])  # crosses next time
    put(tracks, lane, HIGH, HERE)
    if tracks[lane, LOW + 1] * tracks[lane, HIGH + 1] < 0:
        return TO_ROOT
    return TO_TURN if may_hide_two(tracks, lane) else MARCHING


@inlined
def turning_tried(tracks: Any, lane: int, tries: int) -> int:
    """What to do after looking for the turning point; sets TURN if the function crossed there."""
    value, rate = tracks[lane, SEEN + 1], tracks[lane, SEEN + 2]
    if value * tracks[lane, LOW + 1] < 0:
        put(tracks, lane, HIGH, SEEN)
        put(tracks, lane, TURN, SEEN)
        return TO_ROOT
    put(tracks, lane, LOW if value * rate < 0 else HIGH, SEEN)
    return TO_TURN if tries < TURN_TRIES and may_hide_two(tracks, lane) else MARCHING


@inlined
def root_tried(tracks: Any, lane: int, tries: int) -> int:
    """What to do after looking for the zero."""
    value = tracks[lane, SEEN + 1]
    if abs(value) <= RESIDUAL or tries == ROOT_TRIES:
        return AT_ROOT
    put(tracks, lane, LOW if value * tracks[lane, LOW + 1] > 0 else HIGH, SEEN)
    return TO_ROOT


@inlined
def aim(w: Any, lane: int, mode: int, tracks: Any, tolerance: float) -> None:
    """Set a lane's target; where it only looks, within a step taken before, errors are known."""
    if mode == MARCHING:
        w[TARGET * LANES + lane], w[ALLOWED * LANES + lane] = np.inf, tolerance
        return
    target = 0.0
    if mode == TO_ROOT:
        target = root_estimate(tracks, lane)
    elif mode == TO_TURN:
        low, high = tracks[lane, LOW], tracks[lane, HIGH]
        target = low + (high - low) * turning_part(tracks, lane)
    w[TARGET * LANES + lane], w[ALLOWED * LANES + lane] = target, np.inf


@compiled(
    f"void({STEP}, i8[::1], f8[:, ::1], f8[::1], f8, i8, f8, i8, f8[:, ::1], f8[:, :, ::1], "
    "i8[:, ::1], i8[::1], i8[::1])"
)
def cross(
    step: Any,
    queue: Any,
    rows: Any,
    lengths: Any,
    tolerance: float,
    step_limit: int,
    longest: float,
    direction: int,
    times: Any,
    states: Any,
    directions: Any,
    found: Any,
    status: Any,
) -> None:
    """The first m crossings of each of n orbits, after time 0.

    queue, rows, lengths: as in `march`; step_limit: of steps without a crossing; longest: how far
    to look [s]; direction: +1 or -1 for crossings of that direction only, 0 for both. Writes times
    (n, m), states (n, m, size), directions (n, m), found (n,) and status (n,).
    """
    size = states.shape[2]
    _, new, flag, total = places(size)
    w = np.zeros(total * LANES)
    orbit, mode, tries = np.full(LANES, -1), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    steps, hidden = np.zeros(LANES, np.int64), np.zeros(LANES, np.bool_)
    tracks, clock, faced = np.zeros((LANES, TRACK)), np.zeros(LANES), np.zeros(LANES)
    running = 0
    for lane in range(LANES):
        load(w, LANES, lane, rows[0], lengths[0], tolerance)  # idle lanes compute too, to no end
        running += load_next(w, orbit, lane, queue, rows, lengths, tolerance)
        aim(w, lane, STARTING, tracks, tolerance)
    while running > 0:
        step(w)
        for lane in range(LANES):
            i = orbit[lane]
            if i < 0:
                continue
            steps[lane] += 1
            tries[lane] += 1
            tracks[lane, SEEN] = w[TARGET * LANES + lane]
            tracks[lane, SEEN + 1] = w[(flag + 1) * LANES + lane]
            tracks[lane, SEEN + 2] = w[(flag + 2) * LANES + lane]
            facing = w[(flag + 3) * LANES + lane]
            rejected = w[flag * LANES + lane] == REJECTED
            if mode[lane] == TO_TURN:
                mode[lane] = turning_tried(tracks, lane, tries[lane])
                if mode[lane] == TO_ROOT:
                    hidden[lane], tries[lane] = True, 0
            elif mode[lane] == TO_ROOT:
                mode[lane] = root_tried(tracks, lane, tries[lane])
            elif mode[lane] == STARTING:
                put(tracks, lane, HERE, SEEN)
                if abs(tracks[lane, SEEN + 1]) <= ON_SECTION:
                    # As if it had crossed just now: no crossing itself, but the next one is.
                    tracks[lane, HERE + 1] = math.copysign(TINY, tracks[lane, SEEN + 2])
                faced[lane], mode[lane] = facing, MARCHING
            elif not rejected:
                length = w[TIME * LANES + lane]
                w[TIME * LANES + lane] = 0.0
                clock[lane] += length
                mode[lane] = marched(tracks, lane, length)
                if facing < BEHIND and faced[lane] < BEHIND:
                    mode[lane] = MARCHING  # behind: the other half of the section's circle
                faced[lane], tries[lane] = facing, 0

            if mode[lane] == AT_ROOT:
                crossed = 1 if tracks[lane, SEEN + 2] > 0 else -1
                if facing > 0 and direction * crossed >= 0:
                    k = found[i]
                    times[i, k], directions[i, k] = clock[lane] + tracks[lane, SEEN], crossed
                    for j in range(size):
                        states[i, k, j] = w[(new + j) * LANES + lane]
                    found[i] += 1
                    steps[lane] = 0
                mode[lane] = MARCHING
                if hidden[lane]:
                    mode[lane], hidden[lane], tries[lane] = TO_ROOT, False, 0
                    put(tracks, lane, LOW, TURN)
                    put(tracks, lane, HIGH, HERE)
            aim(w, lane, mode[lane], tracks, tolerance)

            if found[i] == times.shape[1]:
                status[i] = DONE
            elif steps[lane] >= step_limit or (mode[lane] == MARCHING and clock[lane] > longest):
                status[i] = TOO_MANY_STEPS
            elif rejected and collapsed(w, LANES, lane):
                status[i] = COLLAPSED
            else:
                continue
            if load_next(w, orbit, lane, queue, rows, lengths, tolerance):
                mode[lane], steps[lane] = STARTING, 0
                clock[lane], hidden[lane] = 0.0, False
                aim(w, lane, STARTING, tracks, tolerance)
            else:
                running -= 1
