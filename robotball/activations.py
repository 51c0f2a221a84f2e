"""Activations: what an actuator with a state of its own makes of its command.

As the command is given over time and depends on nothing else, so is the state: first-order dynamics
turn one function of time into another.
"""

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robotball.drives import Constant, Custom, Drive, Rate, as_drive
from robotball.errors import InputError
from robotball.function_drives import polynomials_of

_LAGS = 5.0  # of a settling time, over which an integral is taken in one piece
_LOOKS = 1001  # at a function of time, for where it leaves a range
_ROUNDING = 1e-9  # of a range's larger end: what leaves it by less is within it


@dataclass(frozen=True)
class Activation:
    """A state w of an actuator's own, which its law takes in place of the command u.

    ẇ = (u - w)/settling, or ẇ = u where settling [s] is None; w starts at `initial` and stays
    between low and high.
    """

    initial: float
    settling: float | None = None
    low: float = -math.inf
    high: float = math.inf

    def of_constant(self, u: float) -> Rate:
        """Return w over time for a constant command."""
        w, settling = self.initial, self.settling
        ahead = u if settling is None else u - w
        if not ahead:
            return w
        limit = self.high if ahead > 0 else self.low
        if settling is None:
            reached = (limit - w) / u
        else:
            left = (u - limit) / ahead  # of the way to u, where w reaches the limit
            reached = -settling * math.log(left) if left > 0 else math.inf

        def value(t: float) -> float:
            if t >= reached:
                return limit
            return w + u * t if settling is None else u - ahead * math.exp(-t / settling)

        return Custom(value, (reached,) if 0 < reached < math.inf else ())

    def of_drive(self, u: Drive, end: float) -> Custom:
        """Return w over time, from 0 to `end` [s], for a command that never takes it to a limit."""
        settling, w = self.settling, self.initial
        if settling is None:
            return Custom(lambda t: w + float(u.angle(t)), u.breakpoints)
        # w = exp(-(t - T)/τ)(w_T + ∫ u exp((s - T)/τ)/τ ds) from a time T not long before t, as the
        # exponential would overflow.
        begins = np.arange(0.0, end, _LAGS * settling).tolist()
        pieces = []
        for begin, stop in pairwise([*begins, end]):
            inside = [t for t in u.breakpoints if begin < t < stop]

            def grown(s: float, begin: float = begin) -> float:
                return float(u.rate(s)) * math.exp((s - begin) / settling) / settling

            area = polynomials_of(grown, [begin, *inside, stop]).area
            pieces.append((begin, w, area))
            w = (w + area(stop)) * math.exp((begin - stop) / settling)

        def value(t: float) -> float:
            begin, before, area = pieces[max(bisect_right(begins, t) - 1, 0)]
            return (before + area(t)) * math.exp((begin - t) / settling)

        return Custom(value, u.breakpoints)


def passed(
    name: str,
    command: Rate,
    within: tuple[float, float],
    activation: Activation | None,
    end: float,
) -> Rate:
    """Return what is left of an actuator's command behind its range and its activation.

    end: of the run [s]. A constant command is clipped to its range. Raises InputError where another
    one leaves it, or takes the activation out of its own.
    """
    drive = as_drive(command, end)
    if isinstance(drive, Constant):
        value = float(np.clip(drive.value, *within))
        return value if activation is None else activation.of_constant(value)
    _check_within(f"{name}: its control", drive.rate, *within, end)
    if activation is None:
        return command
    state = activation.of_drive(drive, end)
    _check_within(f"{name}: its activation", state.function, activation.low, activation.high, end)
    return state


def _check_within(
    what: str, value: Callable[[float], float], low: float, high: float, end: float
) -> None:
    sizes = [abs(limit) for limit in (low, high) if math.isfinite(limit)]
    off = _ROUNDING * max(sizes, default=0.0)
    for t in np.linspace(0.0, end, _LOOKS).tolist():
        if not low - off <= value(t) <= high + off:
            raise InputError(
                f"{what} is {value(t):g} at t = {t:g} s, where it would be clipped to its range of "
                f"{low:g} to {high:g}; keep it within"
            )
