"""Periodic motions of γ and M: closed by Newton's method, with period and multipliers.

Invariant curves of the section map: closed curves on which it is a rotation by ρ.

A quasi-periodic orbit x₀, x₁, … then is xₙ = Σ cₕ exp(2πi h ρ n), so that its points, ordered by
the phase ρn mod 1, run along the curve once.

The tori that a rubber and a classical Chaplygin ball share: Ω = K = 0 and (M, γ) = 0.

Of the rubber ball take ℓ = M×γ, the horizontal part of its angular momentum; of the classical one
ℓ = M. Both are constant in space and across γ. The rubber ball's energy is half of

    J(γ, ℓ) = (Aℓ, ℓ) - (Aγ, ℓ)²/(Aγ, γ),

and that of a classical ball with A' = E/d' - sA, s > 0, half of ℓ²/d' - sJ: each ball keeps the
other's energy. So from the same (γ, ℓ) both motions wind round the same torus, each in its way.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from robotball.engines.ensembles.orbits import STEP_TOLERANCE, Starts
from robotball.engines.ensembles.steppers import DEVIATION
from robotball.equations import Parameters, as_vector
from robotball.errors import InputError
from robotball.rotations import Array, multiply, rotation_matrix

ITERATIONS = 30
CLOSED = 1e-11  # of γ and M/|M|; what a tolerance of 1e-14 keeps over a period


@dataclass(frozen=True)
class Cycle:
    """A motion whose γ and M repeat.

    attitude (4,), frame to world, and momentum (3,) kg m²/s, world, at some moment of it; period
    s; multipliers, complex, largest first: two of them where M ≠ 0, one where M = 0.
    """

    attitude: Array
    momentum: Array
    period: float
    multipliers: Array

    @property
    def gamma(self) -> Array:
        """γ (3,) at that moment."""
        return rotation_matrix(self.attitude)[2]


def close(parameters: Parameters, attitude: Array, momentum: Array, period: float) -> Cycle:
    """The periodic motion near a start (4,), (3,), with a period near the one given [s].

    Newton's method on a small turn of the start and on the period; of all corrections the
    smallest is taken, for every moment of the motion is as good a start as another. Raises
    InputError where that does not converge.
    """
    for _ in range(ITERATIONS):
        end, monodromy, volume = monodromy_of(parameters, attitude, momentum, period)
        vectors = level_vectors(attitude, momentum), level_vectors(end, momentum)
        omega = angular_velocity(parameters, end, momentum)
        gap = (vectors[1] - vectors[0]).ravel()
        if np.abs(gap).max() < CLOSED:
            return Cycle(attitude, momentum, period, multipliers(monodromy, volume, momentum))
        by_turn = np.cross(vectors[1][:, None], monodromy.T) - np.cross(
            vectors[0][:, None], np.eye(3)
        )
        by_period = np.cross(vectors[1], omega)
        columns = np.concatenate([by_turn, by_period[:, None]], axis=1)
        # Turning along the motion itself changes nothing: singular, hence the least solution.
        jacobian = columns.transpose(0, 2, 1).reshape(-1, 4)
        correction = np.linalg.lstsq(jacobian, -gap, rcond=1e-9)[0]
        correction *= min(1.0, 0.3 / float(np.abs(correction[:3]).max()))
        turn = np.array([1.0, *(correction[:3] / 2)])
        attitude = multiply(attitude, turn / np.linalg.norm(turn))
        period += float(correction[3])
        if not period > 0:
            break
    raise InputError("no periodic motion found near the start: Newton's method does not converge")


def monodromy_of(
    parameters: Parameters, attitude: Array, momentum: Array, period: float
) -> tuple[Array, Array, float]:
    """The attitude (4,) after a period, its turns by the start's (3, 3), and ln of the determinant.

    The determinant is up to a factor that is 1 where the motion is periodic.
    """
    starts = Starts(parameters, np.tile(attitude, (3, 1)), np.tile(momentum, (3, 1)))
    rest = np.concatenate([np.eye(3), np.zeros((3, 2))], axis=1)
    states, status = starts.march(DEVIATION, rest, np.array([period]), STEP_TOLERANCE)
    if status.any():
        raise InputError("the motion could not be followed over the period")
    end = starts.to_world(states[:, :, :4])[0, 0]
    monodromy = (states[:, 0, 4:7] * np.exp(states[:, 0, 7:8])).T
    return end, monodromy, float(states[0, 0, 8])


def level_vectors(attitude: Array, momentum: Array) -> Array:
    """γ and M/|M| (2, 3) in frame axes, or γ alone (1, 3) where M = 0."""
    axes = rotation_matrix(attitude)
    size = np.linalg.norm(momentum)
    return np.stack([axes[2], momentum @ axes / size]) if size > 0 else axes[2:]


def angular_velocity(parameters: Parameters, attitude: Array, momentum: Array) -> Array:
    """ω (3,) in frame axes [rad/s]."""
    axes = rotation_matrix(attitude)
    return np.array(parameters.angular_velocity(as_vector(momentum @ axes), as_vector(axes[2])))


def multipliers(monodromy: Array, volume: float, momentum: Array) -> Array:
    """The multipliers without those that are 1, largest first.

    The motion's own is 1, and at M = 0 that of a turn about the vertical, so that there the
    determinant is all there is to know.
    """
    if not np.any(momentum):
        return np.array([np.exp(volume)], dtype=complex)
    values = np.linalg.eigvals(monodromy).astype(complex)
    values = values[np.argsort(np.abs(values - 1))][1:]
    return values[np.argsort(-np.abs(values))]


LINES = 4  # looked at; the strongest need not be ρ's own
CORRECTIONS = 4
HARMONICS = 120  # of a smooth curve; with fewer points, an eighth of their number


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
        """Points (n, k) along the curve at phases (n,) in turns; 0 is the orbit's first point."""
        return (waves(phases, len(self.coefficients) // 2) @ self.coefficients).real


def invariant_curve(points: Array) -> InvariantCurve:
    """The curve that the successive points (m, k) of one orbit of the section map fill.

    The points are to be of one direction of crossing, in coordinates without jumps. ρ is the one
    of the strongest spectral lines that fits best; every other point is held out. Raises
    InputError for fewer than 100 points, and where they are not finite or all the same.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or len(points) < 100 or not np.isfinite(points).all():
        raise InputError("an invariant curve needs 100 finite points (m, k) or more")
    if np.ptp(points, axis=0).max() < 1e-9 * np.abs(points).max():
        raise InputError("the points are all the same: a fixed point, no invariant curve")
    fits = [fitted(points, rotation) for rotation in candidate_rotations(points)]
    return min(fits, key=lambda curve: curve.residual)


def fitted(points: Array, rotation: float) -> InvariantCurve:
    """The curve by every other point, with ρ near the one given, by Gauss and Newton."""
    count, highest = np.arange(float(len(points))), min(HARMONICS, len(points) // 8)
    orders = 2j * np.pi * np.arange(-highest, highest + 1)[:, None]
    for _ in range(CORRECTIONS):
        table = waves(rotation * count, highest)
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


def candidate_rotations(points: Array) -> list[float]:
    """The strongest spectral lines (up to LINES) of an orbit (m, k), in turns: multiples of ρ.

    Each is refined on the spectrum of the points under a smooth window, whose lines are narrow.
    """
    m = len(points)
    times = np.arange(1, m + 1) / (m + 1)
    weights = np.exp(-1 / (times * (1 - times)))
    windowed = (points - weights @ points / weights.sum()) * weights[:, None]

    def weakness(turns: float) -> float:
        wave = np.exp(-2j * np.pi * turns * np.arange(m))
        return -float(np.sum(np.abs(wave @ windowed) ** 2))

    power = np.sum(np.abs(np.fft.rfft(windowed, axis=0)) ** 2, axis=1)
    peaks = [i for i in range(1, len(power) - 1) if power[i - 1] < power[i] >= power[i + 1]]
    strongest = sorted(peaks, key=lambda i: -power[i])[:LINES]
    found = []
    for i in strongest:
        near = ((i - 1) / m, (i + 1) / m)
        best = minimize_scalar(weakness, bounds=near, method="bounded", options={"xatol": 1e-14})
        found.append(float(best.x))
    return found


def waves(phases: Array, highest: int) -> Array:
    """exp(2πi h phase) (n, 2 highest + 1) at phases (n,) in turns."""
    return np.exp(2j * np.pi * np.outer(phases, np.arange(-highest, highest + 1)))


def shared_integral(parameters: Parameters, gamma: Array, level: Array) -> Array:
    """J (n,) at γ and ℓ (n, 3), in principal axes, with the A of the rubber ball [J]."""
    A = np.array(parameters.A)
    weight, mixed = (A * gamma * gamma).sum(axis=1), (A * gamma * level).sum(axis=1)
    return np.asarray((A * level * level).sum(axis=1) - mixed**2 / weight)
