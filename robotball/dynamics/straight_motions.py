"""Straight-line motions, section 5.1: ω = 0, so γ and M are constant and the ball rolls straight.

Rubber: (Ω, γ) = 0 by (2.2), and M = γ×K: one motion for each γ orthogonal to Ω, the family Σ¹.
Classical: any γ, with M = K + d(Ω,γ)γ. The contact point moves at a|γ×Ω|.
"""

from dataclasses import dataclass

import numpy as np

from robotball.dynamics.equilibria import flow_near, linear_part
from robotball.errors import InputError
from robotball.robot import formulas as eq
from robotball.robot.ball import Value
from robotball.robot.formulas import Parameters, as_vector
from robotball.rotations import Array, ComplexArray

_ROUNDING = 1e-9  # relative: a smaller component counts as zero


@dataclass(frozen=True)
class StraightMotion(Value):
    """A motion with ω = 0, in frame axes.

    Attributes
    ----------
    gamma : (3,)
    momentum : (3,), kg m²/s
    speed : m/s, of the contact point
    eigenvalues : (3,), 1/s, of the linearization at constant M² and (M, γ), by real part
    polynomial : (4,), their characteristic polynomial, highest power first
    """

    gamma: Array
    momentum: Array
    speed: float
    eigenvalues: ComplexArray
    polynomial: Array

    @property
    def is_stable(self) -> bool:
        """True if all eigenvalues have negative real parts."""
        return bool(self.eigenvalues.real.max() < 0)


def straight_motion(parameters: Parameters, gamma: Array) -> StraightMotion:
    """Return the straight-line motion with the unit vertical γ (3,).

    Raises InputError in the rubber model unless γ is orthogonal to Ω.
    """
    p, vertical = parameters, as_vector(gamma)
    across = abs(eq.dot(p.Omega, vertical)) <= _ROUNDING * np.linalg.norm(p.Omega)
    if p.rolling == "rubber" and not across:
        raise InputError("a rubber ball rolls straight only if (Omega, gamma) = 0 (equation (2.2))")
    M = p.momentum((0.0, 0.0, 0.0), vertical)
    linear = linear_part(flow_near(p, np.array(vertical), np.array(M)), 3)
    return StraightMotion(
        gamma=np.asarray(gamma, dtype=float),
        momentum=np.array(M),
        speed=float(p.a * np.linalg.norm(np.cross(gamma, p.Omega))),
        eigenvalues=np.asarray(np.sort_complex(np.linalg.eigvals(linear))),
        polynomial=np.real(np.poly(linear)),
    )


def straight_motions(parameters: Parameters, f: float, c: float = 0.0) -> list[StraightMotion]:
    """Return all straight motions with M² = f [(kg m²/s)²] and (M, γ) = c [kg m²/s], at most four.

    Raises InputError if Ω = 0.
    """
    return [straight_motion(parameters, gamma) for gamma in straight_verticals(parameters, f, c)]


def straight_verticals(parameters: Parameters, f: float, c: float = 0.0) -> list[Array]:
    """Return γ (3,) of all straight motions with M² = f and (M, γ) = c.

    Rubber (c = 0): γ lies on the two planes (Ω, γ) = 0 and (K, γ) = ±√(K² - f). Classical: γ lies
    on the two planes d(Ω, γ) = c ± √(c² + K² - f) and (K, γ) = c - d(Ω, γ). At the ends of the
    range of f the solutions merge in pairs. If K is along Ω, the list is empty, because the
    solutions fill curves. Raises InputError if Ω = 0.
    """
    Omega, K, d = np.array(parameters.Omega), np.array(parameters.K), parameters.d
    if not Omega.any():
        raise InputError(
            "with Omega = 0 there is no straight motion: the ball with M = K rests; make Omega "
            "nonzero"
        )
    normal = np.cross(Omega, K)
    size = np.linalg.norm(normal)
    square = c * c + float(K @ K) - f
    if square < 0 or size <= _ROUNDING * np.linalg.norm(Omega) * np.linalg.norm(K):
        return []
    verticals: list[Array] = []
    for root in (np.sqrt(square), -np.sqrt(square)):
        levels = (0.0, root) if parameters.rolling == "rubber" else ((c + root) / d, -root)
        foot = np.linalg.lstsq(np.stack([Omega, K]), np.array(levels), rcond=None)[0]
        if (off := 1 - foot @ foot) >= 0:
            verticals += [foot + sign * np.sqrt(off) / size * normal for sign in (1, -1)]
    return verticals


def name_of_line(parameters: Parameters, gamma: Array) -> str:
    """Return the name in Proposition 3 of a rubber ball's straight motion with vertical γ (3,).

    σ₊, σ₋, δ₊ or δ₋: by (5.3) γ = c₁K + c₂K×Ω; σ has c₂ > 0, and the index is the sign of c₁. The
    name is "" for a classical ball, and unless K and Ω are nonzero and orthogonal.
    """
    Omega, K = np.array(parameters.Omega), np.array(parameters.K)
    size = np.linalg.norm(K) * np.linalg.norm(Omega)
    if parameters.rolling != "rubber" or size == 0 or abs(K @ Omega) > _ROUNDING * size:
        return ""
    return ("σ" if np.cross(K, Omega) @ gamma > 0 else "δ") + ("₊" if K @ gamma > 0 else "₋")


def stability_limit(parameters: Parameters) -> float | None:
    """Return the f [(kg m²/s)²] below which two of four rubber motions are stable, or 0.

    For Ω along a principal axis l and K orthogonal to it, Fig. 9: with j, k, l in cyclic order,
    p = (K, γ), m = M_l and N = (Aγ,γ) the characteristic polynomial λ³ + c₂λ² + c₁λ + c₀ has

        c₂ = Ω_l(a_j - a_k)γ_jγ_k/N,  c₁ = a_ja_ka_l p²/N,  c₀ = -Ω_l a_ja_ka_l pm/N,
        c₂c₁ - c₀ = Ω_l a_ja_ka_l p(a_jK_kγ_j - a_kK_jγ_k)/N².

    By Routh and Hurwitz c₂, c₀ and c₂c₁ - c₀ must be positive: a motion is stable iff

        Ω_l p m < 0,  Ω_l(a_j - a_k)K_jK_k > 0,  f < (a_j - a_k)²K_j²K_k²/(a_k²K_j² + a_j²K_k²).

    The magnitude of Ω cancels because K_l = 0. Returns None if the formula does not apply: for a
    classical ball, and unless Ω is along an axis and K orthogonal to it.
    """
    Omega, across = np.abs(parameters.Omega), np.abs(parameters.K)
    axes = np.flatnonzero(Omega > _ROUNDING * Omega.max())
    if parameters.rolling != "rubber" or len(axes) != 1:
        return None
    if across[axes[0]] > _ROUNDING * across.max():
        return None
    l = int(axes[0])
    j, k = (l + 1) % 3, (l + 2) % 3
    A, K = parameters.A, parameters.K
    product = (A[j] - A[k]) * K[j] * K[k]
    if not parameters.Omega[l] * product > 0:
        return 0.0
    return float(product**2 / ((A[k] * K[j]) ** 2 + (A[j] * K[k]) ** 2))
