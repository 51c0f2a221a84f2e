"""Margins of a closed loop: how much more gain, and how much more delay, it stands.

A loop works if its rates stay bounded and a small disturbance of its start does not grow, by the
equations. Rates are the angular velocity and the rates of hinges: a path that is only turned or
shifted by the disturbance has not grown. A loop that tumbles or swings steadily is detected by its
rates and the size of the disturbance, each compared with the loop as it is.
"""

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from robotball import InputError, Motion, Reading, integrate
from robotball.errors import SceneWarning
from robotball.rotations import Array

from .comparing import shifted
from .output import Show
from .sensitivity import neighbour

# Growth from the second quarter of a run to its second half. A disturbance that persists has 1.
WORKS = 1.25
# Times the factor of the commands: the largest rates and disturbance over those of the loop as it
# is. Rates may also be those of a ball that rolls by its weight.
_LARGER = 3.0
_SWING = 0.1  # of the largest rate of the loop as it is; a loop whose rates end below has settled
_ROUNDING = 1e-6  # of the largest disturbance or such a rate; a smaller one has died out
_RATIO = math.sqrt(2)  # of the values tried in turn until the loop fails
_MOST_GAIN = 64.0
_LONGEST = 0.25  # of the run; longest delay that is added
_FINE = 0.02  # relative distance of the values between which a loop ceases to work
_RTOL = 1e-9  # gives the growth of disturbances of 1e-6 as exactly as 1e-15, in a third of the time
_TRIALS = 10.0  # typical number for a margin, for the progress


@dataclass(frozen=True)
class Margin:
    """How far a number of a closed loop can be raised.

    Attributes
    ----------
    what : str
        The unit and meaning of the number.
    works, fails : float
        The largest value found at which the loop works, NaN without one; and the next one tried, at
        which it does not, inf without one.
    tried : mapping of float to float
        The growth of a disturbance by the value tried, first as it is; inf if a run broke off.
    """

    what: str
    works: float
    fails: float
    tried: Mapping[float, float]

    def __str__(self) -> str:
        if math.isnan(self.works):
            grown = f"grows {self.tried[self.fails]:.2g}-fold in half the run"
            grown = grown if self.tried[self.fails] < math.inf else "ends the run early"
            return f"is unstable as it is: a small disturbance {grown}"
        more = "no more was tried" if self.fails == math.inf else f"{self.fails:.3g} is too much"
        return f"works with {self.works:.3g} {self.what} ({more})"


_Growth = Callable[[float], float]
Margins = Mapping[str, list[Margin]]  # of closed loops, by the names of their scenes


def margins_of(theory: Motion, show: Show = lambda *_: None) -> list[Margin]:
    """Return the margins of gain and delay of a closed loop, by bisection with the equations.

    `show` is called with the number of margins done, from 0 to 2.
    """
    scene, controller, times = theory.scene, theory.scene.controller, theory.times
    assert controller is not None
    half, rates = len(times) // 2, np.abs(_rates_of(theory))
    fastest, by_weight = float(rates.max()), math.sqrt(scene.gravity / scene.ball.radius)
    settled = max(_LARGER * rates[half:].max(), _SWING * fastest, _ROUNDING * by_weight)
    disturbances: list[float] = []  # the largest of each trial, first as the loop is

    def growth(factor: float, delay: float) -> float:
        bound = max(_LARGER * factor * fastest, by_weight)

        def function(reading: Reading) -> dict[str, float]:
            if max(map(abs, [*reading.gyro, *reading.rates.values()])) > bound:
                raise InputError("the rates are not bounded")  # steps would become ever shorter
            commands = controller.function(reading)
            return {name: factor * value for name, value in commands.items()}

        loop = replace(controller, function=function, delay=controller.delay + delay)
        try:
            motion = integrate(scene.with_controller(loop), times, rtol=_RTOL)
            near = integrate(neighbour(motion, hinges=True), times, rtol=_RTOL)
        except InputError:  # not bounded, or the ball lifts off
            return math.inf
        if motion.ended or near.ended:
            return math.inf
        apart = np.linalg.norm(_rates_of(near) - _rates_of(motion), axis=1)
        begin, end = apart[half // 2 : half].max(), apart[half:].max()
        disturbances.append(float(apart.max()))
        late_rate = np.abs(_rates_of(motion)[half:]).max()
        if end > _LARGER * factor * disturbances[0] or late_rate > factor * settled:
            return math.inf
        return float(end / max(begin, _ROUNDING * disturbances[-1]))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        gains = 1.0, _RATIO, _MOST_GAIN
        gain = _margin("times the commands", lambda x: growth(x, 0), gains, show)
        delays = 0.0, controller.period, _LONGEST * float(times[-1])
        return [gain, _margin("s more delay", lambda x: growth(1, x), delays, shifted(show, 1))]


def _margin(what: str, growth: _Growth, values: tuple[float, float, float], show: Show) -> Margin:
    """Raise a number while the loop works, then bisect; values: as it is, next, and the most."""
    low, first, most = values
    tried, high = {low: growth(low)}, math.inf
    if not tried[low] <= WORKS:
        return Margin(what, math.nan, low, tried)
    while low < most and high - low > _FINE * max(low, first):
        show(1 - math.exp(-len(tried) / _TRIALS), f"margin, {what}")
        value = (low + high) / 2 if high < math.inf else min(max(_RATIO * low, first), most)
        tried[value] = growth(value)
        low, high = (value, high) if tried[value] <= WORKS else (low, value)
    return Margin(what, low, high, tried)


def _rates_of(motion: Motion) -> Array:
    return np.hstack([motion.angular_velocity, motion.hinge_rates])
