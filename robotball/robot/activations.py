"""Activations: actuators with first-order dynamics between the command and the law.

A command is a function of time alone, so the activation state is one too, and is computed before
the run.
"""

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from robotball.errors import InputError
from robotball.robot.drives import Constant, Custom, Drive, Rate, as_drive
from robotball.robot.function_drives import polynomials_of

_LAGS = 5.0  # settling times per piece of the integral
_MOST_SETTLINGS = 1e5  # settling times in a run with a changing command: 30 s of work
_LOOKS = 1001  # samples in time of a check against a range
_ROOT = 1e-14  # s, tolerance of the time at which a limit is reached
_ROUNDING = 1e-9  # tolerance of a range, relative to its larger end


@dataclass(frozen=True)
class Activation:
    """Activation state w, which the law of an actuator takes in place of the command u.

    ẇ = (u - w)/settling, or ẇ = u if settling [s] is None; w starts at `initial` and is clipped to
    low and high.
    """

    initial: float
    settling: float | None = None
    low: float = -math.inf
    high: float = math.inf

    def of(self, u: Drive, end: float) -> Rate:
        """Return w over time, from 0 to `end` [s]; w is clipped if u is constant."""
        if isinstance(u, Constant) and u.value == (self.initial if self.settling else 0.0):
            return self.initial
        value = self._unlimited(u, end)
        last = value(end)
        limit = float(np.clip(last, self.low, self.high))
        if limit == last or not isinstance(u, Constant):
            return Custom(value, u.breakpoints)
        # w is monotone, and stays at its limit.
        reached = brentq(lambda t: value(t) - limit, 0.0, end, xtol=_ROOT)
        return Custom(lambda t: limit if t >= reached else value(t), (reached,))

    def _unlimited(self, u: Drive, end: float) -> Callable[[float], float]:
        settling, w = self.settling, self.initial
        if settling is None:
            return lambda t: w + float(u.angle(t))
        if isinstance(u, Constant):
            to = u.value
            return lambda t: to + (w - to) * math.exp(-t / settling)
        if end > _MOST_SETTLINGS * settling:
            raise InputError(
                f"a filter of {settling:g} s is too short for a run of {end:g} s, of at most "
                f"{_MOST_SETTLINGS * settling:g} s; leave it out, or give a constant control"
            )
        # w = exp(-(t - T)/τ)(w_T + ∫ u exp((s - T)/τ)/τ ds), with T shortly before t because the
        # exponential would overflow otherwise.
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

        return value


def filtered(
    name: str, command: Rate, within: tuple[float, float], activation: Activation | None, end: float
) -> Rate:
    """Return an actuator's command after its range and activation, in a run to `end` [s].

    A constant command is clipped to its range. Raises InputError if another command leaves its
    range, or drives the activation out of its range.
    """
    drive = as_drive(command, end)
    if isinstance(drive, Constant):
        drive = Constant(float(np.clip(drive.value, *within)))
    else:
        _check_within(f"{name}: its control", drive.rate, *within, end)
    if activation is None:
        return drive.value if isinstance(drive, Constant) else command
    state = activation.of(drive, end)
    if isinstance(state, Custom):
        low, high = activation.low, activation.high
        _check_within(f"{name}: its activation", state.function, low, high, end)
    return state


def _check_within(
    name: str, value: Callable[[float], float], low: float, high: float, end: float
) -> None:
    sizes = [abs(limit) for limit in (low, high) if math.isfinite(limit)]
    off = _ROUNDING * max(sizes, default=0.0)
    for t in np.linspace(0.0, end, _LOOKS).tolist():
        if not low - off <= value(t) <= high + off:
            raise InputError(
                f"{name} is {value(t):g} at t = {t:g} s, outside its range of {low:g} to {high:g}; "
                "a changing command cannot be clipped, so keep it within"
            )
