"""Numbers printed in the paper's captions, and the motions that start from them."""

from dataclasses import dataclass

import numpy as np
from numpy import sqrt

from robotball.rotations import Array
from tests.paper import formulas as f
from tests.paper.formulas import Numbers, cross

F = 25.0  # M² of Figs 11 to 14, (kg m²/s)²
PERIOD = 8.74326  # s, of the cycle of Fig. 11a; the paper does not print it


@dataclass(frozen=True)
class Caption:
    """A ball with α, β, γ (the rows of axes) and M at t = 0; a = 1 and X = Y = 0."""

    n: Numbers
    axes: Array
    M: Array


def _from_rest(K3: float, *axes: tuple[float, ...]) -> Caption:
    """Return the start of one of Figs 5 to 8."""
    n = f.with_A((0.5, 0.4, 0.3), np.array([4.0, 2.0, 1.0]), np.array([0.0, 0.0, K3]))
    return Caption(n, np.array(axes), np.zeros(3))


def line_ball(f3: float = 1.0) -> Numbers:
    """Return the ball of Figs 9 and 10, with Ω₃ = f3 and K = (4, 5, 0)."""
    return f.with_A((0.5, 0.3, 0.6), np.array([0.0, 0.0, f3]), np.array([4.0, 5.0, 0.0]))


def near_sigma_plus(level: float) -> Caption:
    """Return the start of Fig. 10: 0.01 e₃ from σ₊, with OX along -M."""
    n = line_ball()
    square = n.K @ n.K
    gamma = sqrt(square - level) / square * n.K + sqrt(level) / square * cross(n.K, n.Omega)
    gamma = f.unit(gamma + 0.01 * f.E[2])
    M = f.level(f.E[2], gamma)
    M = M * sqrt(level / (M @ M))
    return _laid_against(n, M, gamma)


def _laid_against(n: Numbers, M: Array, gamma: Array) -> Caption:
    """Return an initial state with α = -M/√f (section 3.3)."""
    alpha = -f.unit(M)
    return Caption(n, np.array([alpha, cross(gamma, alpha), gamma]), M)


def _on_the_section(
    A: tuple[float, float, float], K: tuple[float, ...], L: float, l: float
) -> Caption:
    """Return the start of one of Figs 12 to 14: f = 25 and (L, l) at g = 0, by (5.5)."""
    # Independent of robotball's section_state.
    n, root = f.with_A(A, np.array([0.0, 0.0, 2.0]), np.array(K)), sqrt(25 - L**2)
    M = np.array([root * np.sin(l), root * np.cos(l), L])
    gamma = np.array([L / 5 * np.sin(l), L / 5 * np.cos(l), -root / 5])
    return _laid_against(n, M, gamma)


# As printed, with E17 and E18 corrected.
CAPTIONS = {
    "fig05b": _from_rest(
        0.0,
        (sqrt(8949) / 95, -2 * sqrt(19) / 95, 0),
        (-9 * sqrt(19) / 475, -9 * sqrt(8949) / 950, -sqrt(19) / 10),
        (1 / 25, sqrt(471) / 50, -9 / 10),
    ),
    "fig05c": _from_rest(
        0.0, (0, -1, 0), (sqrt(39) / 20, 0, -19 / 20), (19 / 20, 0, sqrt(39) / 20)
    ),
    "fig05d": _from_rest(0.0, (0, -1, 0), (0, 0, -1), (1, 0, 0)),
    "fig06": _from_rest(
        0.3, (1, 0, 0), (0, 3 * sqrt(11) / 50, -49 / 50), (0, 49 / 50, 3 * sqrt(11) / 50)
    ),
    "fig07": _from_rest(0.52, (1, 0, 0), (0, sqrt(79) / 40, -39 / 40), (0, 39 / 40, sqrt(79) / 40)),
    "fig08": _from_rest(3.0, (1, 0, 0), (0, sqrt(79) / 40, -39 / 40), (0, 39 / 40, sqrt(79) / 40)),
    "fig10": near_sigma_plus(3.0),
    "fig12": _on_the_section((0.7, 0.6, 0.8), (2, 2, 0), 3.6, 0.6),
    "fig13": _on_the_section((0.7, 0.6, 0.8), (2, 2, 0), 0.0, 1.96),
    "fig14": _on_the_section((0.8, 0.6, 0.7), (2, 3, 0), 0.0, 0.6),
}


def motion(caption: Caption, times: Array, rtol: float = 1e-12) -> tuple[Array, Array]:
    """Integrate (2.6), (2.7) and (3.2) with scipy; γ (n, 3) and (X, Y) (n, 2)."""
    n = caption.n

    def rate(x: Array) -> Array:
        M, alpha, beta, gamma = x[:12].reshape(4, 3)
        omega = f.rubber_velocity(n, M, gamma)
        turning = [cross(v, omega) for v in (M, alpha, beta, gamma)]
        shell = omega - n.Omega
        return np.concatenate([*turning, [n.a * beta @ shell, -n.a * alpha @ shell]])

    start = np.concatenate([caption.M, caption.axes.ravel(), [0.0, 0.0]])
    states = f.followed(rate, start, times, rtol)
    return states[:, 9:12], states[:, 12:]
