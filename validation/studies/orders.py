"""Order of convergence of errors that fall with the step.

The order is the slope of a straight line through ln(error) over ln(step). Errors follow a power law
only over a range of steps: with longer steps the leading term does not dominate; with shorter steps
the error stalls at rounding or at an error that does not depend on the step. Both ends are left
out, and the stall is reported.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotball.rotations import Array

LEAST = 3  # points of a line
_STALLED = 0.5  # errors stall if they fall with less than this power of the step
_SOUND = 5.0  # the line uses errors above this multiple of the stalled error
_STRAIGHT = 0.04  # largest root mean square distance of the points from a line, in ln(step)


@dataclass(frozen=True)
class Order:
    """Power law error ~ stepᵒʳᵈᵉʳ.

    Attributes
    ----------
    order, stderr : float
        The order and its standard error.
    ln_step, ln_error : float
        The middle of the line.
    shortest, longest : float
        The range of the steps.
    points : int
        The number of points of the line.
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
    """Fit the order over the longest straight part of the errors. None without such a part.

    Parameters
    ----------
    steps : (n,)
        Positive steps in any order and unit.
    errors : (n,)
        The errors; None for a run that broke off.
    floor : float
        The uncertainty of the errors; smaller errors are ignored.
    """
    h, e = _sound(steps, errors)
    # Near the stall the errors fall more slowly than the power law.
    clear = e > max(floor, _SOUND * (stalled_at(steps, errors) or 0.0))
    x, y = np.log(h[clear]), np.log(e[clear])
    # The longest straight part, not the straightest: any two points are straight.
    for length in range(len(x), LEAST - 1, -1):
        # Try parts with short steps first, because there the leading term dominates.
        for begin in range(len(x) - length, -1, -1):
            part = slice(begin, begin + length)
            if (line := _fitted_line(x[part], y[part])) is not None:
                return line
    return None


def stalled_at(steps: Sequence[float], errors: Sequence[float | None]) -> float | None:
    """Return the smallest error at which the errors stop falling; None if they never stop."""
    h, e = _sound(steps, errors)
    for i in range(len(h) - 1):
        if np.all(e[i + 1 :] > e[i] * (h[i + 1 :] / h[i]) ** _STALLED):
            return float(e[i:].min())
    return None


def _sound(steps: Sequence[float], errors: Sequence[float | None]) -> tuple[Array, Array]:
    """Return steps, the longest first, and errors, of complete runs with a nonzero error."""
    pairs = sorted(
        ((h, e) for h, e in zip(steps, errors, strict=True) if e and np.isfinite(e)), reverse=True
    )
    h, e = np.array(pairs).reshape(-1, 2).T
    return h, e


def _fitted_line(x: Array, y: Array) -> Order | None:
    """Return the least-squares line if it rises and the points are near it."""
    if x[0] == x[-1]:  # a single step has no slope
        return None
    (slope, height), covariance = np.polyfit(x, y, 1, cov=True)
    off = np.sqrt(np.mean((y - slope * x - height) ** 2))
    # Dividing by the slope converts the distance to ln(step), so one bound serves all orders.
    if slope < _STALLED or off > _STRAIGHT * slope:
        return None
    stderr = float(np.sqrt(covariance[0, 0]))
    ends = float(np.exp(x.min())), float(np.exp(x.max()))
    return Order(float(slope), stderr, float(x.mean()), float(y.mean()), *ends, len(x))
