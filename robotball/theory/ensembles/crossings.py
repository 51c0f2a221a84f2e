"""The compiled loop that finds the crossings of orbits with a section, in lanes.

A lane marches until the section function changes its sign within a step. Then it looks back from
the end of the step, with Newton steps inside the bracket, until the function is zero. If the
function turns back near zero within a step, this step is also searched, because it may have two
crossings.
"""

import math
from typing import Any

import numpy as np

from robotball.theory.compiled import inlined
from robotball.theory.ensembles import orbits
from robotball.theory.ensembles.flatten import LANES
from robotball.theory.ensembles.steppers import ALLOWED, REJECTED, TARGET, TIME, places

_RESIDUAL = 1e-13  # of the section function, which is at most 1: about a hundred roundings
_ON_SECTION = 1e-12  # a start with a smaller value is on the section
# A turning point with a smaller estimate is searched; steps of a radian estimate it to 5e-3.
_NEAR_PLANE = 0.03
_BEHIND = -0.1  # if cos(g - g₀) is smaller at both ends of a step, it is negative within it
_TINY = 1e-300  # a value of which only the sign matters
# Bisection takes about 50 tries, the estimates usually take 4. A turning point needs fewer tries,
# because only a value of the other sign is searched.
_ROOT_TRIES, _TURN_TRIES = 60, 3
_STARTING, _MARCHING, _TO_ROOT, _AT_ROOT, _TO_TURN = 0, 1, 2, 3, 4  # modes of a lane
# Points on a lane's track with known values of the section function: the current state, the ends
# of the bracket, a turning point between two crossings, and the last try. Each is a time, a value
# and a rate. Times count from the current state, because a small residual needs all their digits.
# Then follow the time of the current state, and its side of the section.
_HERE, _LOW, _HIGH, _TURN, _SEEN, _CLOCK, _FACED, TRACK = 0, 3, 6, 9, 12, 15, 16, 17


@inlined
def _put(tracks: Any, lane: int, target: int, source: int) -> None:
    """Copy time, value and rate from one place of a lane's track to another."""
    for j in range(3):
        tracks[lane, target + j] = tracks[lane, source + j]


@inlined
def _root_estimate(tracks: Any, lane: int) -> float:
    """Return an estimate of the zero between _LOW and _HIGH, whose values have opposite signs.

    The estimate comes from the cubic of time as a function of the value, with the times and rates
    at both ends. If the cubic is not monotonic, the estimate is the middle. Newton's method without
    a bracket diverges here.
    """
    low, high = tracks[lane, _LOW], tracks[lane, _HIGH]
    span, rise = high - low, tracks[lane, _HIGH + 1] - tracks[lane, _LOW + 1]
    slope = rise / span
    from_low, from_high = slope / tracks[lane, _LOW + 2], slope / tracks[lane, _HIGH + 2]
    u = -tracks[lane, _LOW + 1] / rise
    part = u * u * (3 - 2 * u) + u * (1 - u) * ((1 - u) * from_low - u * from_high)
    monotonic = 0 <= from_low <= 3 and 0 <= from_high <= 3
    return low + span * (part if monotonic and 0 < part < 1 else 0.5)


@inlined
def _turning_part(tracks: Any, lane: int) -> float:
    """Return the part of the way from _LOW to _HIGH at which the rate may pass zero."""
    return tracks[lane, _LOW + 2] / (tracks[lane, _LOW + 2] - tracks[lane, _HIGH + 2])


@inlined
def _may_hide_two(tracks: Any, lane: int) -> bool:
    """Return whether a value with one sign at _LOW and _HIGH comes near zero between them."""
    low, low_rate = tracks[lane, _LOW + 1], tracks[lane, _LOW + 2]
    high, high_rate = tracks[lane, _HIGH + 1], tracks[lane, _HIGH + 2]
    if low * low_rate >= 0 or high * high_rate <= 0:
        return False
    u, span = _turning_part(tracks, lane), tracks[lane, _HIGH] - tracks[lane, _LOW]
    value = (
        low * (1 + 2 * u) * ((1 - u) * (1 - u))
        + high * u * u * (3 - 2 * u)
        + span * u * (1 - u) * (low_rate * (1 - u) - high_rate * u)
    )
    return abs(value) < _NEAR_PLANE or value * low < 0


@inlined
def _marched(tracks: Any, lane: int, length: float) -> int:
    """Return the mode after a step of a length."""
    _put(tracks, lane, _LOW, _HERE)
    tracks[lane, _LOW] = -length
    _put(tracks, lane, _HERE, _SEEN)
    tracks[lane, _HERE] = 0.0
    if tracks[lane, _SEEN + 1] == 0:
        tracks[lane, _HERE + 1] = math.copysign(_TINY, tracks[lane, _LOW + 1])  # crosses next time
    _put(tracks, lane, _HIGH, _HERE)
    if tracks[lane, _LOW + 1] * tracks[lane, _HIGH + 1] < 0:
        return _TO_ROOT
    return _TO_TURN if _may_hide_two(tracks, lane) else _MARCHING


@inlined
def _turning_tried(tracks: Any, lane: int, tries: int) -> int:
    """Return the mode after a try at the turning point; set _TURN if the function crossed there."""
    value, rate = tracks[lane, _SEEN + 1], tracks[lane, _SEEN + 2]
    if value * tracks[lane, _LOW + 1] < 0:
        _put(tracks, lane, _HIGH, _SEEN)
        _put(tracks, lane, _TURN, _SEEN)
        return _TO_ROOT
    _put(tracks, lane, _LOW if value * rate < 0 else _HIGH, _SEEN)
    return _TO_TURN if tries < _TURN_TRIES and _may_hide_two(tracks, lane) else _MARCHING


@inlined
def _root_tried(tracks: Any, lane: int, tries: int) -> int:
    """Return the mode after a try at the zero."""
    value = tracks[lane, _SEEN + 1]
    if abs(value) <= _RESIDUAL or tries == _ROOT_TRIES:
        return _AT_ROOT
    _put(tracks, lane, _LOW if value * tracks[lane, _LOW + 1] > 0 else _HIGH, _SEEN)
    return _TO_ROOT


@inlined
def _aim(w: Any, lane: int, mode: int, tracks: Any, tolerance: float) -> None:
    """Set a lane's target. A look back into an accepted step is shorter and more accurate."""
    if mode == _MARCHING:
        w[TARGET * LANES + lane], w[ALLOWED * LANES + lane] = np.inf, tolerance
        return
    target = 0.0
    if mode == _TO_ROOT:
        target = _root_estimate(tracks, lane)
    elif mode == _TO_TURN:
        low, high = tracks[lane, _LOW], tracks[lane, _HIGH]
        target = low + (high - low) * _turning_part(tracks, lane)
    w[TARGET * LANES + lane], w[ALLOWED * LANES + lane] = target, np.inf


@orbits.compiled(
    f"void({orbits.STEP}, i8[::1], f8[:, ::1], f8[::1], f8, i8, f8, i8, f8[::1], "
    "UniTuple(i8[::1], 5), f8[:, ::1], f8[:, ::1], f8[:, :, ::1], i8[:, ::1], i8[::1], i8[::1])"
)
def cross(
    step: Any, queue: Any, rows: Any, lengths: Any, tolerance: float, step_limit: int,
    longest: float, direction: int, w: Any, counters: Any, tracks: Any, times: Any, states: Any,
    directions: Any, found: Any, status: Any,
) -> None:  # fmt: skip
    """Write the first m crossings of each of n orbits, after time 0.

    queue, rows, lengths: as in `march_lanes`; step_limit: largest number of steps without a
    crossing; longest: time at which the search ends [s]; direction: +1 or -1 for crossings in only
    that direction, 0 for both directions; w, counters: from `work`; tracks: (LANES, TRACK).
    Writes times (n, m), states (n, m, size), directions (n, m), found (n,) and status (n,).
    """
    size = states.shape[2]
    _, new, flag, _ = places(size)
    orbit, mode, tries, steps, hidden = counters
    running = 0
    for lane in range(LANES):
        # Idle lanes compute too, because the step has no branches.
        orbits.load(w, LANES, lane, rows[0], lengths[0], tolerance)
        running += orbits.load_next(w, orbit, lane, queue, rows, lengths, tolerance)
        _aim(w, lane, _STARTING, tracks, tolerance)
    while running > 0:
        step(w)
        for lane in range(LANES):
            i = orbit[lane]
            if i < 0:
                continue
            steps[lane] += 1
            tries[lane] += 1
            tracks[lane, _SEEN] = w[TARGET * LANES + lane]
            tracks[lane, _SEEN + 1] = w[(flag + 1) * LANES + lane]
            tracks[lane, _SEEN + 2] = w[(flag + 2) * LANES + lane]
            facing = w[(flag + 3) * LANES + lane]
            rejected = w[flag * LANES + lane] == REJECTED
            if mode[lane] == _TO_TURN:
                mode[lane] = _turning_tried(tracks, lane, tries[lane])
                if mode[lane] == _TO_ROOT:
                    hidden[lane], tries[lane] = 1, 0
            elif mode[lane] == _TO_ROOT:
                mode[lane] = _root_tried(tracks, lane, tries[lane])
            elif mode[lane] == _STARTING:
                _put(tracks, lane, _HERE, _SEEN)
                if abs(tracks[lane, _SEEN + 1]) <= _ON_SECTION:
                    # The start is not a crossing, so act as if the orbit had just crossed.
                    tracks[lane, _HERE + 1] = math.copysign(_TINY, tracks[lane, _SEEN + 2])
                tracks[lane, _FACED], mode[lane] = facing, _MARCHING
            elif not rejected:
                length = w[TIME * LANES + lane]
                w[TIME * LANES + lane] = 0.0
                tracks[lane, _CLOCK] += length
                mode[lane] = _marched(tracks, lane, length)
                if facing < _BEHIND and tracks[lane, _FACED] < _BEHIND:
                    mode[lane] = _MARCHING  # behind: the other half of the section's circle
                tracks[lane, _FACED], tries[lane] = facing, 0

            if mode[lane] == _AT_ROOT:
                crossed = 1 if tracks[lane, _SEEN + 2] > 0 else -1
                if facing > 0 and direction * crossed >= 0:
                    k = found[i]
                    times[i, k], directions[i, k] = (
                        tracks[lane, _CLOCK] + tracks[lane, _SEEN],
                        crossed,
                    )
                    for j in range(size):
                        states[i, k, j] = w[(new + j) * LANES + lane]
                    found[i] += 1
                    # The limit is of steps without a crossing.
                    steps[lane] = 0
                mode[lane] = _MARCHING
                if hidden[lane]:
                    # The second of two crossings in one step lies between the turning point and its
                    # end.
                    mode[lane], hidden[lane], tries[lane] = _TO_ROOT, 0, 0
                    _put(tracks, lane, _LOW, _TURN)
                    _put(tracks, lane, _HIGH, _HERE)
            # Also after a rejected step, whose lane tries again with the shorter length.
            _aim(w, lane, mode[lane], tracks, tolerance)

            if found[i] == times.shape[1]:
                status[i] = orbits.DONE
            elif steps[lane] >= step_limit or (
                mode[lane] == _MARCHING and tracks[lane, _CLOCK] > longest
            ):
                status[i] = orbits.TOO_MANY_STEPS
            elif rejected and orbits.collapsed(w, LANES, lane):
                status[i] = orbits.COLLAPSED
            else:
                continue
            if orbits.load_next(w, orbit, lane, queue, rows, lengths, tolerance):
                mode[lane], steps[lane] = _STARTING, 0
                tracks[lane, _CLOCK], hidden[lane] = 0.0, 0
                _aim(w, lane, _STARTING, tracks, tolerance)
            else:
                running -= 1
