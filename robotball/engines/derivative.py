"""Rates of sampled quantities, with an estimate of how wrong they are."""

import numpy as np
from numpy.typing import NDArray

from robotball.motion import pieces
from robotball.rotations import Array, conjugate, multiply

POINTS = 7  # of the polynomial through a sample and its neighbours; 5 for the estimate
NOISE = 2.5  # times what the largest noise near a sample makes of a rate; it may lie worse


def rates(times: Array, values: Array) -> tuple[Array, Array]:
    """d/dt (n, k) of values (n, k) at increasing times (n,), and its estimated error (n,).

    It is the slope of the polynomial through seven neighbours. The error has two parts, each the
    largest near the sample: how far the polynomial through five is off, which is more than the
    truncation error; and what rounding or noise makes of a rate, as it is told by what no
    polynomial through six of the seven follows.
    """
    fine, noise = _slopes(times, values, POINTS)
    coarse, _ = _slopes(times, values, POINTS - 2)
    truncation = np.linalg.norm(fine - coarse, axis=1)
    return fine, _largest_near(truncation, POINTS) + NOISE * _largest_near(noise, 3 * POINTS)


def angular_velocity(times: Array, attitude: Array) -> tuple[Array, Array]:
    """ω (n, 3) in frame axes of attitudes (n, 4), and its estimated error (n,) [rad/s]."""
    q = continuous(attitude)
    rate, error = rates(times, q)
    # dq/dt = q∘(0, ω)/2; the polynomials leave a part along q, which is no turning.
    w, v = conjugate(q)[:, :1], conjugate(q)[:, 1:]
    turned = w * rate[:, 1:] + rate[:, :1] * v + np.cross(v, rate[:, 1:])
    return 2 * turned, 2 * error


def continuous(attitude: Array) -> Array:
    """The quaternions (n, 4), of which q and -q are one attitude, without jumps of the sign."""
    cosines = (attitude[1:] * attitude[:-1]).sum(axis=1)
    signs = np.cumprod(np.concatenate([[1.0], np.where(cosines < 0, -1.0, 1.0)]))
    return attitude * signs[:, None]


def turned_between(attitude: Array) -> Array:
    """(n - 1,) rad: how far each attitude is turned from the one before."""
    turn = multiply(conjugate(attitude[:-1]), attitude[1:])
    return np.asarray(2 * np.arctan2(np.linalg.norm(turn[:, 1:], axis=1), np.abs(turn[:, 0])))


def _slopes(times: Array, values: Array, points: int) -> tuple[Array, Array]:
    """The slopes (n, k) at the samples of polynomials through `points` of them each.

    The noise (n,) of the slopes, as well, if the highest differences are nothing but noise.
    """
    every = np.arange(len(times))
    parts = [_slopes_at(every[piece], times, values, points) for piece in pieces(len(times))]
    slopes, noise = zip(*parts, strict=True)
    return np.concatenate(slopes), np.concatenate(noise)


def _slopes_at(
    samples: NDArray[np.intp], times: Array, values: Array, points: int
) -> tuple[Array, Array]:
    """The same at some of the samples, by their places (m,)."""
    points = min(points, len(times))
    first = np.clip(samples - points // 2, 0, len(times) - points)
    near: NDArray[np.intp] = first[:, None] + np.arange(points)
    rows, own = np.arange(len(samples)), samples - first
    # The derivative of Lagrange's basis at one of its nodes; scaled, as products of short
    # intervals vanish.
    t = times[near]
    scale = (t[:, -1] - t[:, 0])[:, None]
    u = (t - times[samples, None]) / scale
    gaps = u[:, :, None] - u[:, None, :]
    gaps[:, range(points), range(points)] = 1.0
    difference = 1 / gaps.prod(axis=2)  # divided, of the highest order, but for its unit
    there = -u
    there[rows, own] = 1.0
    weights = difference / difference[rows, own][:, None] / there
    weights[rows, own] = 0.0
    weights[rows, own] = -weights.sum(axis=1)
    weights /= scale
    from_own = values[near] - values[samples, None]
    left = np.linalg.norm(np.einsum("np,npk->nk", difference, from_own), axis=1)
    noise = left * np.linalg.norm(weights, axis=1) / np.linalg.norm(difference, axis=1)
    return np.einsum("np,npk->nk", weights, from_own), noise


def _largest_near(error: Array, count: int) -> Array:
    """(n,): the largest of the errors of a sample and its neighbours; single ones may cancel."""
    padded = np.pad(error, count // 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, count // 2 * 2 + 1)
    return np.asarray(windows.max(axis=1))
