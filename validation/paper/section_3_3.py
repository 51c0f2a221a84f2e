"""Section 3.3: the axes of space and the contact point from M and γ, and bounded motions."""

from functools import partial

import numpy as np
from scipy.optimize import minimize

from robotball.engines.reduced.compiled.kernels import kernel_start, orbit
from robotball.rotations import Array, rotation_matrix
from robotball.start import section_state
from validation.paper import formulas as f
from validation.paper.claim import Claim, Residual
from validation.paper.engine import (
    CLASSICAL,
    INNER,
    MOTION,
    RUBBER,
    Seen,
    largest,
    seen,
)
from validation.paper.scenes import paper_scene

LONG = 2000.0  # s


def horizontal(ball: Seen, twist: float = 1.0) -> tuple[Array, Array, Array]:
    """M, M - cγ (n, 3) and √(f - c²) (n,) of a motion."""
    M, gamma = ball.momentum, ball.gamma
    c = (M * gamma).sum(axis=1)
    return M, M - twist * c[:, None] * gamma, np.sqrt((M * M).sum(axis=1) - c * c)


def space_axes(twist: float) -> Residual:
    """α = -(M - cγ)/√(f - c²) and β = M×γ/√(f - c²), beside MuJoCo's, where OX is laid so."""
    ball = seen(CLASSICAL)
    M, level, size = horizontal(ball)
    alpha, beta = -twist * level / size[:, None], np.cross(M, ball.gamma) / size[:, None]
    return Residual(
        max(largest(alpha - ball.axes[:, 0]), largest(beta - ball.axes[:, 1])), bound=2e-7
    )


def path(name: str, bound: float, twist: float) -> Residual:
    """Ẋ = a(M×γ, ω - Ω)/√(f - c²) and Ẏ = a(M - cγ, ω - Ω)/√(f - c²), beside MuJoCo's."""
    ball = seen(name)
    M, level, size = horizontal(ball)
    shell = ball.of(lambda n, omega, _: n.a * (omega - n.Omega))
    X = (np.cross(M, ball.gamma) * shell).sum(axis=1) / size
    Y = twist * (level * shell).sum(axis=1) / size
    found = ball.path_velocity[:, :2]
    return Residual(largest(np.stack([X, Y], axis=1)[INNER] - found), bound, unit="m/s")


def bounded(name: str, twist: float) -> Residual:
    """|ω - Ω| over 2000 s, relative to its maximum over all γ, M with the same f.

    c is 0; twisted, of a motion with more M.
    """
    scene = paper_scene(name)
    classical = scene.rolling == "classical"
    n, velocity = (
        f.numbers(scene.parameters),
        f.classical_velocity if classical else f.rubber_velocity,
    )
    size = np.sqrt(25.0)

    def slowness(x: Array) -> float:
        gamma, M = section_state(size * np.sin(x[0]), x[1], x[2], size**2)
        return -float(np.linalg.norm(velocity(n, M, gamma) - n.Omega))

    random = np.random.default_rng(35)
    starts = random.uniform(0.0, 2 * np.pi, (6, 3))
    most = max(-float(minimize(slowness, x).fun) for x in starts)
    parameters, attitude, momentum = kernel_start(scene)
    momentum = twist * momentum
    attitudes, _ = orbit(parameters, attitude[0], momentum[0], np.arange(0.0, LONG, 0.1), 1e-9)
    axes = rotation_matrix(attitudes)
    reached = max(float(np.linalg.norm(velocity(n, momentum[0] @ S, S[2]) - n.Omega)) for S in axes)
    return Residual(reached / most, bound=1.0)


CLAIMS = (
    Claim("3.3", "α = -(M - cγ)/√(f - c²), β = M×γ/√(f - c²)", space_axes, MOTION, "the sign of α"),
    Claim("3.3", "Ẋ, Ẏ by M and γ; rubber", partial(path, RUBBER, 1.5e-6), MOTION, "the sign of Ẏ"),
    Claim(
        "3.3", "Ẋ, Ẏ by M and γ; classical", partial(path, CLASSICAL, 6e-6), MOTION, "the sign of Ẏ"
    ),
    Claim(
        "3.3",
        "the shell's speed is bounded by f; rubber",
        partial(bounded, "fig14"),
        "maximum over the level",
        "the size of M",
        control=4.0,
    ),
    Claim(
        "3.3",
        "the shell's speed is bounded by f; classical",
        partial(bounded, "classical_regular"),
        "maximum over the level",
        "the size of M",
        control=4.0,
    ),
)
