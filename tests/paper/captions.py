"""The numbers printed by the paper's captions, and the motions that start from them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy import sqrt

from robotball.rotations import Array
from tests.paper import formulas as f
from tests.paper.claim import Errors, Section, by
from tests.paper.engine_ball import NAME, largest, seen
from tests.paper.formulas import Numbers, cross, paper_scene


@dataclass(frozen=True)
class _Caption:
    """A ball, α, β and γ (the rows of axes) and M at t = 0; a = 1, X = Y = 0."""

    n: Numbers
    axes: Array
    M: Array


def _from_rest(K3: float, *axes: tuple[float, ...]) -> _Caption:
    """Return the start of one of Figs 5 to 8."""
    n = f.with_A((0.5, 0.4, 0.3), np.array([4.0, 2.0, 1.0]), np.array([0.0, 0.0, K3]))
    return _Caption(n, np.array(axes), np.zeros(3))


def line_ball(f3: float = 1.0) -> Numbers:
    """Return the ball of Figs 9 and 10, with Ω₃ = f3 and K = (4, 5, 0)."""
    return f.with_A((0.5, 0.3, 0.6), np.array([0.0, 0.0, f3]), np.array([4.0, 5.0, 0.0]))


def near_sigma_plus(level: float) -> _Caption:
    """Return Fig. 10's start: 0.01 e₃ from σ₊, with OX against M."""
    n = line_ball()
    square = n.K @ n.K
    gamma = sqrt(square - level) / square * n.K + sqrt(level) / square * cross(n.K, n.Omega)
    # The caption starts beside σ₊, which is unstable; on it the ball would roll straight on.
    gamma = f.unit(gamma + 0.01 * f.E[2])
    M = f.level(f.E[2], gamma)
    M = M * sqrt(level / (M @ M))
    return _laid_against(n, M, gamma)


def _laid_against(n: Numbers, M: Array, gamma: Array) -> _Caption:
    """Return a start with α = -M/√f, as section 3.3 lays OX."""
    alpha = -f.unit(M)
    return _Caption(n, np.array([alpha, cross(gamma, alpha), gamma]), M)


def _on_the_section(
    A: tuple[float, float, float], K: tuple[float, ...], L: float, l: float
) -> _Caption:
    """Return the start of one of Figs 12 to 14: f = 25 and (L, l) at g = 0, by (5.5)."""
    # Typed here once more, not by section_state, whose numbers it is to check.
    n, root = f.with_A(A, np.array([0.0, 0.0, 2.0]), np.array(K)), sqrt(25 - L**2)
    M = np.array([root * np.sin(l), root * np.cos(l), L])
    gamma = np.array([L / 5 * np.sin(l), L / 5 * np.cos(l), -root / 5])
    return _laid_against(n, M, gamma)


# As printed, with the E17 and E18 that make the axes orthonormal.
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


def motion(caption: _Caption, times: Array, rtol: float = 1e-12) -> tuple[Array, Array]:
    """Integrate (2.6), (2.7) and (3.2) by scipy; γ (n, 3) and (X, Y) (n, 2)."""
    n = caption.n

    def rate(x: Array) -> Array:
        M, alpha, beta, gamma = x[:12].reshape(4, 3)
        omega = f.rubber_velocity(n, M, gamma)
        turning = [cross(v, omega) for v in (M, alpha, beta, gamma)]
        shell = omega - n.Omega
        return np.concatenate([*turning, [n.a * beta @ shell, -n.a * alpha @ shell]])

    start = np.concatenate([caption.M, caption.axes.ravel(), [0.0, 0.0]])
    found = f.followed(rate, start, times, rtol)
    return found[:, 9:12], found[:, 12:]


def _as_captioned(name: str, sampled: tuple[float, ...], twist: float = 1.0) -> Errors:
    """Compare MuJoCo's contact point, relative to the path, and γ with the caption's."""
    caption, ball = CAPTIONS[name], seen(name, *sampled)
    caption = replace(caption, n=replace(caption.n, Omega=twist * caption.n.Omega))
    gamma, path = motion(caption, ball.motion.times)
    # A caption's γ is in the frame's axes; the ball's principal axes may have another order.
    in_frame = ball.gamma @ paper_scene(name).principal_axes.T
    # Relative to the path, or to the radius where the path is shorter, as everywhere.
    yield largest(ball.motion.contact_point - path) / max(ball.motion.path_length, caption.n.a)
    yield largest(in_frame - gamma)


def orthonormal(
    name: str, twist: float = 1.0, printed: tuple[int, Sequence[float]] | None = None
) -> Errors:
    """Compute SSᵀ - E of a caption's axes; twisted, with another sign in γ.

    printed: a row of S, and what is printed for it.
    """
    axes = CAPTIONS[name].axes.copy()
    if printed:
        axes[printed[0]] = printed[1]
    axes[2] *= [twist, 1.0, 1.0] if name.startswith("fig05") else [1.0, twist, 1.0]
    yield axes @ axes.T - f.E


def place(name: str) -> str:
    """Return the paper's name of a figure: "Fig. 5b" for "fig05b"."""
    return "Fig. " + name.removeprefix("fig").lstrip("0")


def claim_motion(section: Section, name: str, bound: float, *sampled: float) -> None:
    """Add the claim that a figure's motion is that from its captioned start, over 10 s.

    sampled: another duration and interval of samples [s]. The bound is that of RK4's error, which
    the turning rate sets.
    """
    duration = sampled[0] if sampled else 10.0
    means = f"{NAME}; (3.2) by scipy"
    section.claim(place(name), f"{duration:g} s of the motion that starts as its caption says")(
        by(means, "the sign of Ω", bound=bound, name=name, sampled=sampled)(_as_captioned)
    )


def claim_axes(section: Section, name: str) -> None:
    """Add the claim that a caption's vectors are axes."""
    section.claim(place(name), "the caption's α, β, γ are orthonormal")(
        by("arithmetic", "the sign of γ₂", bound=1e-15, name=name)(orthonormal)
    )
