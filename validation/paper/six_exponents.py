"""All six Lyapunov exponents of (3.2) in (M, γ), by six neighbours side by side, compiled.

robotball.qualitative.lyapunov knows one neighbour's small turn and the divergence; here nothing is
left out, and the four that the constants of the motion make zero have to come out so.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numba
import numpy as np

from robotball.rotations import Array
from validation.paper.formulas import Numbers

STEP = 0.01  # s, of Runge and Kutta's classical method
STEPS_PER_QR = 20


Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Numba's njit, with its type kept."""
    result: Function = numba.njit(cache=True)(function)
    return result


@compiled
def rate(x: Array, a: Array, Omega: Array, K: Array) -> Array:
    """d/dt of (M, γ) by (3.2); x (6,) may be complex."""
    M, gamma = x[:3], x[3:]
    along, Z = 0.0 * x[0], 0.0 * x[0]
    for i in range(3):
        along += a[i] * gamma[i] * gamma[i]
        Z += (Omega[i] + a[i] * K[i]) * gamma[i]
    omega = np.empty_like(M)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across = M[j] * a[k] * gamma[k] - M[k] * a[j] * gamma[j]
        omega[i] = a[i] * ((across + Z * gamma[i]) / along - K[i])
    found = np.empty_like(x)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        found[i] = M[j] * omega[k] - M[k] * omega[j]
        found[3 + i] = gamma[j] * omega[k] - gamma[k] * omega[j]
    return found


@compiled
def growths(start: Array, a: Array, Omega: Array, K: Array, rounds: int) -> Array:
    """Σ ln of the six neighbours' growths (6,) over rounds of STEPS_PER_QR steps."""
    tiny = 1e-30
    bundle = np.eye(6)
    state, total = start.copy(), np.zeros(6)
    for _ in range(rounds):
        for _ in range(STEPS_PER_QR):
            moved = np.empty((6, 6))
            end = state
            for i in range(6):
                x = state + 1j * tiny * np.ascontiguousarray(bundle[:, i])
                k1 = rate(x, a, Omega, K)
                k2 = rate(x + STEP / 2 * k1, a, Omega, K)
                k3 = rate(x + STEP / 2 * k2, a, Omega, K)
                k4 = rate(x + STEP * k3, a, Omega, K)
                new = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
                moved[:, i] = new.imag / tiny
                end = new.real
            bundle, state = moved, end
        bundle, R = np.linalg.qr(bundle)
        for i in range(6):
            total[i] += np.log(abs(R[i, i]))
    return total


def six_exponents(n: Numbers, M: Array, gamma: Array, duration: float) -> Array:
    """The exponents (6,) over a duration [s] after a tenth of it, largest first [1/s]."""
    rounds = int(duration / (STEP * STEPS_PER_QR))
    a, start = np.ascontiguousarray(n.moments), np.concatenate([M, gamma])
    early = growths(start, a, n.Omega, n.K, rounds // 10)
    whole = growths(start, a, n.Omega, n.K, rounds + rounds // 10)
    return np.sort((whole - early) / (rounds * STEP * STEPS_PER_QR))[::-1]
