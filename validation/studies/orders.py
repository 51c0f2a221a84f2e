"""The order of convergence of errors that fall with the step.

An order is a straight line through logarithms, where there is one. Errors fall as a power of the
step in the middle only: above, the steps are too long for the leading term to rule; below, the
error stops falling, at rounding or at an error of another kind that no step makes smaller. Both
ends are left out, and the lower one is reported.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotball.rotations import Array

LEAST = 3  # points that make an order
_STALLED = 0.5  # a fall with less than this power of the step is none
_SOUND = 5.0  # times the error at which they stall, from where on errors are taken for the line
_STRAIGHT = 0.04  # distance from a line that passes for one, in ln(step), root mean square


@dataclass(frozen=True)
class Order:
    """error ~ stepᵒʳᵈᵉʳ, over the steps from `shortest` to `longest`.

    stderr: the standard error of the order; ln_step, ln_error: the line's middle; points: how many
    it comes from.
    """

    order: float
    stderr: float
    ln_step: float
    ln_error: float
    shortest: float
    longest: float
    points: int

    def error_at(self, step: Array) -> Array:
        """Return the error on the line at steps (n,), of shape (n,)."""
        return np.exp(self.ln_error + self.order * (np.log(step) - self.ln_step))


def fit_order(
    steps: Sequence[float], errors: Sequence[float | None], floor: float = 0.0
) -> Order | None:
    """Fit the order over the longest straight part of the errors; None where there is none.

    steps: (n,) > 0 in any order and unit; errors: (n,), None where a run broke off; floor: what the
    errors are known to, at least. Among parts of one length the one at shorter steps is taken.
    """
    h, e = _sound(steps, errors)
    # Near the error at which they stall the fall is already slower than its power.
    clear = e > max(floor, _SOUND * (stalled_at(steps, errors) or 0.0))
    x, y = np.log(h[clear]), np.log(e[clear])
    # The longest straight part, not the straightest: any two points are straight.
    for length in range(len(x), LEAST - 1, -1):
        # Among parts of one length the shortest steps come first, where the leading term rules.
        for begin in range(len(x) - length, -1, -1):
            part = slice(begin, begin + length)
            if (found := _fitted_line(x[part], y[part])) is not None:
                return found
    return None


def stalled_at(steps: Sequence[float], errors: Sequence[float | None]) -> float | None:
    """Return the least error where errors fall no more with the step; None if all fall."""
    h, e = _sound(steps, errors)
    for i in range(len(h) - 1):
        if np.all(e[i + 1 :] > e[i] * (h[i + 1 :] / h[i]) ** _STALLED):
            return float(e[i:].min())
    return None


def _sound(steps: Sequence[float], errors: Sequence[float | None]) -> tuple[Array, Array]:
    """Return steps, the longest first, and errors of the runs that ended and were off."""
    pairs = sorted(
        ((h, e) for h, e in zip(steps, errors, strict=True) if e and np.isfinite(e)), reverse=True
    )
    h, e = np.array(pairs).reshape(-1, 2).T
    return h, e


def _fitted_line(x: Array, y: Array) -> Order | None:
    """Return the least-squares line, if the points are near it and it rises."""
    if x[0] == x[-1]:  # one step alone has no order
        return None
    (slope, height), covariance = np.polyfit(x, y, 1, cov=True)
    off = np.sqrt(np.mean((y - slope * x - height) ** 2))
    # The distance is that in ln(error) over the slope, so that a bound in ln(step) holds for any
    # order.
    if slope < _STALLED or off > _STRAIGHT * slope:
        return None
    stderr = float(np.sqrt(covariance[0, 0]))
    ends = float(np.exp(x.min())), float(np.exp(x.max()))
    return Order(float(slope), stderr, float(x.mean()), float(y.mean()), *ends, len(x))
