"""Invariant curves of the section map, and the integral of the tori that two balls share.

A quasi-periodic orbit of the section map fills a closed curve, on which the map is a rotation by ρ.
With its points xₙ = Σ cₕ exp(2πi h ρ n), ordered by the phase ρn mod 1, they run along the curve
once. ρ is a strong line of the orbit's spectrum, refined as by Laskar's frequency analysis (Physica
D 67, 1993), with the window of Das, Saiki, Sander and Yorke (Nonlinearity 30, 2017).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from robotball.errors import InputError
from robotball.robot.formulas import Parameters
from robotball.rotations import Array

_LINES = 4  # looked at; the strongest need not be ρ's own
_CORRECTIONS = 4
_HARMONICS = 120  # enough for a smooth curve; with fewer points, an eighth of their number


@dataclass(frozen=True)
class InvariantCurve:
    """A closed curve through the m points of an orbit in k dimensions, in the points' units.

    rotation: ρ, turns an iterate, 0 < ρ < 1/2: the sense of the phase is chosen so; coefficients
    (2h + 1, k), complex, of the harmonics -h … h; residual: how far the curve passes from the
    farthest point that was held out from the fit of the coefficients (ρ is fitted to all points).
    An orbit that fills no such curve has a large one: a chaotic orbit, but also a torus that
    passes from one direction of crossing to the other, as Fig. 11a's does.
    """

    rotation: float
    coefficients: Array
    residual: float

    def at(self, phases: Array) -> Array:
        """Return points (n, k) at phases (n,) in turns; 0 is the orbit's first point."""
        return (_waves(phases, len(self.coefficients) // 2) @ self.coefficients).real


def invariant_curve(points: Array) -> InvariantCurve:
    """Return the curve that successive points (m, k) of an orbit of the section map fill.

    The points are to be of one direction of crossing, in coordinates without jumps. ρ is the one
    of the strongest spectral lines that fits best; every other point is held out. Raises
    InputError for fewer than 100 points, and where they are not finite or all the same.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or len(points) < 100 or not np.isfinite(points).all():
        raise InputError("an invariant curve needs 100 finite points (m, k) or more")
    if np.ptp(points, axis=0).max() < 1e-9 * np.abs(points).max():
        raise InputError("all points are equal: a fixed point has no invariant curve")
    fits = [_fitted(points, rotation) for rotation in _candidate_rotations(points)]
    return min(fits, key=lambda curve: curve.residual)


def _fitted(points: Array, rotation: float) -> InvariantCurve:
    """Return the curve by every other point, with ρ near the one given, by Gauss and Newton."""
    count, highest = np.arange(float(len(points))), min(_HARMONICS, len(points) // 8)
    orders = 2j * np.pi * np.arange(-highest, highest + 1)[:, None]
    # An error of ρ shifts late points along the curve more than early ones: from that it is found.
    for _ in range(_CORRECTIONS):
        table = _waves(rotation * count, highest)
        coefficients = np.linalg.lstsq(table[::2], points[::2].astype(complex), rcond=None)[0]
        off = points - (table @ coefficients).real
        # About the middle of the orbit, so that turning the whole curve does not count.
        by_rotation = (table @ (orders * coefficients)).real
        by_rotation *= (count - count.mean())[:, None]
        curve = InvariantCurve(
            rotation, coefficients, float(np.linalg.norm(off[1::2], axis=1).max())
        )
        rotation += float(np.sum(off * by_rotation) / np.sum(by_rotation**2))
    return curve


def _candidate_rotations(points: Array) -> list[float]:
    """Return the strongest spectral lines (up to _LINES) of an orbit (m, k), in turns.

    Each is refined on the spectrum of the points under a smooth window, whose lines are narrow.
    """
    m = len(points)
    # A bump that is flat to all orders at both ends: beside a line its spectrum falls faster than
    # any power, so that a strong line does not shift a weak one.
    times = np.arange(1, m + 1) / (m + 1)
    weights = np.exp(-1 / (times * (1 - times)))
    windowed = (points - weights @ points / weights.sum()) * weights[:, None]

    def weakness(turns: float) -> float:
        wave = np.exp(-2j * np.pi * turns * np.arange(m))
        return -float(np.sum(np.abs(wave @ windowed) ** 2))

    power = np.sum(np.abs(np.fft.rfft(windowed, axis=0)) ** 2, axis=1)
    peaks = [i for i in range(1, len(power) - 1) if power[i - 1] < power[i] >= power[i + 1]]
    strongest = sorted(peaks, key=lambda i: -power[i])[:_LINES]
    found = []
    for i in strongest:
        near = ((i - 1) / m, (i + 1) / m)
        best = minimize_scalar(weakness, bounds=near, method="bounded", options={"xatol": 1e-14})
        found.append(float(best.x))
    return found


def _waves(phases: Array, highest: int) -> Array:
    """Return exp(2πi h phase) (n, 2 highest + 1) at phases (n,) in turns."""
    return np.exp(2j * np.pi * np.outer(phases, np.arange(-highest, highest + 1)))


def shared_integral(parameters: Parameters, gamma: Array, level: Array) -> Array:
    """Return J (n,) at γ and ℓ (n, 3), in principal axes, with the A of the rubber ball [J].

    A rubber and a classical Chaplygin ball share tori where Ω = K = 0 and (M, γ) = 0. Of the rubber
    ball take ℓ = M×γ, the horizontal part of its angular momentum; of the classical one ℓ = M. Both
    are constant in space and across γ. The rubber ball's energy is half of

        J(γ, ℓ) = (Aℓ, ℓ) - (Aγ, ℓ)²/(Aγ, γ),

    and that of a classical ball with A' = E/d' - sA, s > 0, half of ℓ²/d' - sJ: each ball keeps the
    other's energy. So from the same (γ, ℓ) both motions wind round the same torus, each in its way.
    """
    A = np.array(parameters.A)
    weight, mixed = (A * gamma * gamma).sum(axis=1), (A * gamma * level).sum(axis=1)
    return np.asarray((A * level * level).sum(axis=1) - mixed**2 / weight)
