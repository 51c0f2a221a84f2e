"""The inertia of a ball shared among shell, frame and the fewest rotors: a small convex problem.

Of a body only the second moments of mass count, Σ = ∫ r rᵀ dm = ½ tr(I) E - I. There is such a
body iff Σ is positive (for I: the triangle inequality), and its mass m can lie within r of the
centre iff tr Σ <= m r², by six points at least. With s = d + J_s, a shell of equal moments and
rotors as flat as rings leave the frame

    2 Σ_frame = P - Σ j (E - n nᵀ),    P = tr(A⁻¹) E - 2 A⁻¹ - s E,

and must make h = K + sΩ = Σ j φ̇ n. Let no rate exceed w, g = h/w, T = Σ j. What the rotors give
back, N = Σ j n nᵀ, has the trace T and N >= g gᵀ/T, so the best that they can do is to pour
τ = T - |g|²/T on where Z = P - T E + g gᵀ/T is least. One rotor has T = |g|, τ = 0; two pour it
all on one direction e. A third is of no use: where Z has two negative eigenvalues, their sum and τ
together grow as T falls. All bounds are concave in (s, T), and very nearly so along T = |g(s)|: the
search goes uphill on s, and for each s on T.

Units here: the trace of A⁻¹ is 1 [kg m²], the shell's radius 1 m.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from robotball.rotations import Array

MOST_ROTORS = 2
# A share that keeps its bounds by less, of the trace of A⁻¹, is refused: rounding would decide.
LEAST_MARGIN = 1e-9
ROTOR_SHARE = 0.5  # of the margin, spent on a slower rotor
STILL = 1e-14  # of the size of K, below which K + sΩ is zero


@dataclass(frozen=True)
class DesignRequest:
    """The numbers of the equations and the bounds on the bodies, in this file's units.

    B (3, 3) is A⁻¹; d is None where the mass is free; shell_factor is J_s/(m_s a²); speed is the
    rotors' largest rate; shell, frame and rotor are the least masses of each.
    """

    B: Array
    K: Array
    Omega: Array
    d: float | None
    shell_factor: float
    speed: float
    shell: float
    frame: float
    rotor: float
    frame_radius: float
    rotor_radius: float

    @property
    def largest_s(self) -> float:
        """Where P ceases to be positive: tr(A⁻¹) - 2 max b."""
        return float(1 - 2 * np.linalg.eigvalsh(self.B)[-1])

    @property
    def smallest_s(self) -> float:
        """d + J_s of the lightest shell, alone where the mass is free."""
        J_s = self.shell_factor * self.shell
        return J_s + (self.shell if self.d is None else self.d)

    def momentum(self, s: Array) -> Array:
        """h = K + sΩ (..., 3) of the rotors, for s (...)."""
        return self.K + s[..., None] * self.Omega

    @property
    def s_without_rotors(self) -> tuple[float, float] | None:
        """Between which s the momentum h is zero, if it is anywhere."""
        if not np.any(self.Omega):
            return None if np.any(self.K) else (self.smallest_s, self.largest_s)
        s = float(-self.K @ self.Omega / (self.Omega @ self.Omega))
        size = float(np.linalg.norm(self.K)) + s * float(np.linalg.norm(self.Omega))
        still = np.linalg.norm(self.momentum(np.array(s))) <= STILL * size
        return (s, s) if still and self.smallest_s <= s <= self.largest_s else None


@dataclass(frozen=True)
class Share:
    """Masses, and the rings' axial inertias (n,) and axes (n, 3).

    margin is how far every bound is kept, of the trace of A⁻¹.
    """

    margin: float
    shell_mass: float
    frame_mass: float
    rotor_masses: Array
    axial_inertias: Array
    axes: Array


def share(request: DesignRequest, frame_radius: float) -> Share | None:
    """The share with the fewest rotors whose frame lies within `frame_radius`, if there is one.

    Among those of as many rotors it is the one that keeps all bounds by the largest margin.
    """
    for n in _rotor_counts(request):
        s, T, margin = _best(request, n, frame_radius)
        if margin > LEAST_MARGIN:
            return _bodies(request, n, s, T, margin)
    return None


def largest_margin(request: DesignRequest, frame_radius: float) -> float:
    """How far a share can keep all bounds, of the trace of A⁻¹; negative where it misses some."""
    return max(_best(request, n, frame_radius)[2] for n in _rotor_counts(request))


def least_speed(request: DesignRequest, frame_radius: float) -> float:
    """The least bound on the rotors' rates with which there is a share; one must exist at some.

    To four digits; `request` has a smaller bound, with which there is none.
    """

    def margin(per_speed: float) -> float:
        speed = 1 / per_speed if per_speed else np.inf
        return largest_margin(replace(request, speed=speed), frame_radius) - LEAST_MARGIN

    return float(1 / brentq(margin, 0.0, 1 / request.speed, rtol=1e-4, xtol=1e-4 / request.speed))


def least_frame_radius(request: DesignRequest) -> float:
    """The least radius within which the frame of some share can lie; there must be a share.

    To four digits; there is none within `request.frame_radius`.
    """

    def margin(per_radius: float) -> float:
        return largest_margin(request, 1 / per_radius if per_radius else np.inf) - LEAST_MARGIN

    largest = 1 / request.frame_radius
    return float(1 / brentq(margin, 0.0, largest, rtol=1e-4, xtol=1e-4 * largest))


def _rotor_counts(request: DesignRequest) -> range:
    # Rates without a bound make any rotor light enough: a second one could not help.
    return range(2 if np.isinf(request.speed) else 1 + MOST_ROTORS)


def _best(request: DesignRequest, n: int, frame_radius: float) -> tuple[float, float, float]:
    """s, T and the margin of the best share with n rotors."""
    ends = (request.smallest_s, request.largest_s) if n else request.s_without_rotors
    if ends is None or ends[0] > ends[1]:
        return 0.0, 0.0, -np.inf

    def best_T(s: Array) -> Array:
        g = np.linalg.norm(request.momentum(s), axis=-1) / request.speed
        if n < 2:
            return n * g
        most = np.maximum((1 - 3 * s) / 2, g)  # then the frame is nothing: tr(2 Σ) = tr P - 2T
        return _peak(lambda T: _margin(request, n, frame_radius, s[..., None], T), g, most, 9, 7)

    def margin(s: Array) -> Array:
        return _margin(request, n, frame_radius, s, best_T(s))

    s = _peak(margin, np.array(ends[0]), np.array(ends[1]), 25, 6)
    return float(s), float(best_T(s)), float(margin(s))


def _peak(f: Callable[[Array], Array], low: Array, high: Array, points: int, rounds: int) -> Array:
    """Where the concave f is largest between low and high (...); f maps (..., points) to itself."""
    u = np.linspace(0.0, 1.0, points)
    for _ in range(rounds):
        at = low[..., None] + (high - low)[..., None] * u
        best = f(at).argmax(axis=-1)[..., None]
        low, peak, high = (
            np.take_along_axis(at, np.clip(best + step, 0, points - 1), axis=-1)[..., 0]
            for step in (-1, 0, 1)
        )
    return peak


def _margin(request: DesignRequest, n: int, frame_radius: float, s: Array, T: Array) -> Array:
    """By how much all bounds are kept (...) at s and T (...), positive iff they are.

    The largest t with 2 Σ_frame >= t E, m_frame >= least + t, m_frame r² - tr Σ_frame >= t,
    m_shell >= least + t, and a single rotor's inertia larger by t ROTOR_SHARE than it must be.
    Each of `bounds` is one of these, linear in t, solved for t.
    """
    c, slower = request.shell_factor, ROTOR_SHARE if n == 1 else 0.0
    Z, tau = _Z(request, *np.broadcast_arrays(s, T))
    z = np.linalg.eigvalsh(Z)
    flattest = z[..., 0] if n < 2 else np.minimum(z[..., 0] + tau, z[..., 1])
    bounds = [flattest / (1 + slower)]
    if request.d is None:
        # The shell has its least mass and t.
        others, others_per_t = s - (1 + c) * request.shell, 1 + c
    else:
        shell = (s - request.d) / c
        others, others_per_t = request.d - shell, 0.0
        bounds.append(shell - request.shell)
    trace = (1 - 3 * s) / 2 - T
    for rotors, per_t in _rotor_masses(request, n, T, slower):
        frame, frame_per_t = others - rotors, others_per_t + per_t
        bounds.append((frame - request.frame) / (1 + frame_per_t))
        if np.isfinite(frame_radius):
            room = frame_radius**2 * frame - trace
            bounds.append(room / (1 + frame_radius**2 * frame_per_t - slower))
    return np.min(np.broadcast_arrays(*bounds), axis=0)


def _rotor_masses(
    request: DesignRequest, n: int, T: Array, slower: float
) -> list[tuple[Array, float]]:
    """What the rotors' mass must reach, and each line's growth with t: inertia, least masses.

    For two the first is an upper bound, too large by no more than one's least mass.
    """
    if n == 0:
        return [(np.zeros_like(T), 0.0)]
    inertia = T / request.rotor_radius**2 + (n - 1) * request.rotor
    least = np.full_like(T, n * request.rotor)
    return [(inertia, slower / request.rotor_radius**2), (least, 0.0)]


def _Z(request: DesignRequest, s: Array, T: Array) -> tuple[Array, Array]:
    """Z = P - T E + g gᵀ/T (..., 3, 3) and τ = T - |g|²/T (...)."""
    g = request.momentum(s) / request.speed
    per_T = 1 / np.maximum(T, 1e-300)
    given_back = per_T[..., None, None] * g[..., :, None] * g[..., None, :]
    P_less_T = (1 - s - T)[..., None, None] * np.eye(3) - 2 * request.B
    return P_less_T + given_back, T - per_T * (g * g).sum(axis=-1)


def _bodies(request: DesignRequest, n: int, s: float, T: float, margin: float) -> Share:
    if request.d is None:
        shell = request.shell + margin
        d = s - request.shell_factor * shell
    else:
        d = request.d
        shell = (s - d) / request.shell_factor
    inertias, axes = _rings(request, n, s, T, margin)
    masses = np.maximum(inertias / request.rotor_radius**2, request.rotor)
    return Share(margin, shell, float(d - shell - masses.sum()), masses, inertias, axes)


def _rings(
    request: DesignRequest, n: int, s: float, T: float, margin: float
) -> tuple[Array, Array]:
    """Axial inertias (n,) and axes (n, 3) of the rotors."""
    if n == 0:
        return np.empty(0), np.empty((0, 3))
    h = request.momentum(np.array(s))
    if n == 1:
        return np.array([T + ROTOR_SHARE * margin]), h[None] / np.linalg.norm(h)
    Z, tau = _Z(request, np.array(s), np.array(T))
    j_n = two_rings(T, h / request.speed, np.linalg.eigh(Z)[1][:, 0], float(tau))
    inertias = np.linalg.norm(j_n, axis=1)
    return inertias, j_n / inertias[:, None]


def two_rings(T: float, g: Array, e: Array, tau: float) -> Array:
    """j n (2, 3) of two rotors with Σ j = T, Σ j n = g, Σ j n nᵀ = g gᵀ/T + τ e eᵀ.

    g (3,) and a unit vector e (3,), with τ = T - |g|²/T > 0. The rows (√T, g/√T) and (0, √τ e)
    have the right moments of (1, n), and any rotation of the two rows into each other keeps them;
    this one makes them (√j, √j n) with unit vectors n.
    """
    e = np.copysign(1.0, g @ e) * e
    tangent = g @ e / np.sqrt(T * tau)
    x = 1 / (tangent + np.hypot(tangent, 1.0))
    across = x * np.sqrt(T * tau) * e
    return np.array([g + across, x * x * g - across]) / (1 + x * x)
