"""Section 3.2: the momentum and the integrals of the classical model.

Section 3.3: the axes of space and the contact point from M and γ, and bounded motions.
"""

from dataclasses import replace
from functools import cache, partial

import numpy as np
from scipy.optimize import minimize

from robotball.engines.ensembles.orbits import kernel_start, orbit
from robotball.rotations import Array, rotation_matrix
from robotball.scene import along_momentum, section_state
from validation.paper import formulas as f
from validation.paper.claim import Claim, Residual
from validation.paper.engine import (
    CLASSICAL,
    DRIVEN,
    INNER,
    MOTION,
    RUBBER,
    Seen,
    largest,
    seen,
    seen_of,
)
from validation.paper.formulas import Numbers, paper_scene
from validation.paper.section_3_1 import MOMENTUM, kept_integrals, three_dimensional


def momentum(n: Numbers, omega: Array, gamma: Array, sign: float = 1.0) -> Array:
    """Ĩω + K + d(Ω,γ)γ, or with another sign of its last term."""
    return f.contact_inertia(n, gamma) @ omega + n.K + sign * n.d * (n.Omega @ gamma) * gamma


@cache
def _driven() -> Seen:
    """The ball of Fig. 12 in the classical model, while its rates swing; (M, γ) = 3."""
    scene = paper_scene(DRIVEN)
    axes = scene.principal_axes
    gamma, M = section_state(3.6, 0.6, 0.0, 25.0, c=3.0)
    start = along_momentum(axes @ gamma, axes @ M)
    return seen_of(replace(scene, rolling="classical", start=start), 10.0)


def _kept_momentum(twist: float) -> Residual:
    """How far M moves in space, with the last term as corrected and as printed."""
    ball = seen(CLASSICAL)
    corrected = ball.of(lambda n, omega, gamma: momentum(n, omega, gamma, twist))
    printed = ball.of(lambda n, omega, gamma: momentum(n, omega, gamma, -1.0))
    return Residual(ball.drift(corrected), 4e-6, ball.drift(printed), MOMENTUM)


def _momentum_of_the_bodies(twist: float) -> Residual:
    """M beside that of MuJoCo's bodies, while Ω and K change."""
    formula = _driven().of(lambda n, w, gamma: momentum(replace(n, d=twist * n.d), w, gamma))
    return Residual(largest(formula - _driven().momentum), bound=4e-6, unit=MOMENTUM)


def _under_changing_rates(twist: float) -> Residual:
    """How far M moves in space while Ω and K change; twisted, with the K of the start."""
    first = _driven().numbers[0].K

    def formula(n: Numbers, omega: Array, gamma: Array) -> Array:
        return momentum(n if twist == 1 else replace(n, K=first), omega, gamma)

    return Residual(_driven().drift(_driven().of(formula)), bound=4e-6, unit=MOMENTUM)


def _inverse(twist: float) -> Residual:
    """ω of (3.3) beside the solution of M = Ĩω + K + d(Ω,γ)γ, linear in ω."""
    worst = 0.0
    for state in f.states(34):
        n, gamma = state.n, state.gamma
        given = state.M - n.K - n.d * (n.Omega @ gamma) * gamma
        omega = np.linalg.solve(f.contact_inertia(n, gamma), given)
        found = f.classical_velocity(replace(n, Omega=twist * n.Omega), state.M, gamma)
        worst = max(worst, float(np.abs(found - omega).max()))
    return Residual(worst, bound=3e-14, unit="rad/s")


def velocity(twist: float) -> Residual:
    """ω of (3.3), and of (3.2), with the M that the motion starts with, beside MuJoCo's ω."""
    ball = _driven()
    states = list(zip(ball.numbers, ball.carried(ball.momentum), ball.gamma, strict=True))
    corrected = [f.classical_velocity(n, twist * M, gamma) for n, M, gamma in states]
    printed = [f.rubber_velocity(n, M, gamma) for n, M, gamma in states]
    return Residual(
        largest(np.array(corrected) - ball.omega),
        bound=4e-6,
        printed=largest(np.array(printed) - ball.omega),
        unit="rad/s",
    )


def _classical_integrals(twist: float) -> Residual:
    """Those of Fig. 14's ball with (M, γ) = 3."""
    gamma, M = section_state(0.0, 0.6, 0.0, 25.0, c=3.0)
    n = f.numbers(paper_scene(CLASSICAL).parameters)
    return kept_integrals(f.classical_velocity, n, M, gamma, twist)


CLAIMS_3_2 = (
    Claim(
        "E2, 3.2",
        "M = Ĩω + K + d(Ω,γ)γ stays in space",
        _kept_momentum,
        MOTION,
        "the sign of the last term",
        printed="M = Ĩω + K - d(Ω,γ)γ",
    ),
    Claim(
        "3.2", "M is the momentum of the bodies", _momentum_of_the_bodies, MOTION, "the sign of d"
    ),
    Claim(
        "3.2",
        "M stays while Ω and K change in time",
        _under_changing_rates,
        MOTION,
        "K as it began",
    ),
    Claim("(3.3)", "ω(M, γ) solves M = Ĩω + …", _inverse, "linear equations", "the sign of Ω"),
    Claim(
        "E5, 3.2",
        "the reduced system is (3.3)",
        velocity,
        MOTION,
        "the sign of M",
        printed='"the autonomous system of equations (3.2)"',
    ),
    Claim(
        "3.2", "F₀, F₁ ≠ 0 and F₂ stay", _classical_integrals, "(3.3) by scipy", "the sign of dM/dt"
    ),
    Claim(
        "3.2",
        "the level of F₀, F₁, F₂ has three dimensions",
        partial(three_dimensional, True),
        "rank of the gradients",
        "M = 0",
    ),
)


LONG = 2000.0  # s


def horizontal(ball: Seen, twist: float = 1.0) -> tuple[Array, Array, Array]:
    """M, M - cγ (n, 3) and √(f - c²) (n,) of a motion."""
    M, gamma = ball.momentum, ball.gamma
    c = (M * gamma).sum(axis=1)
    return M, M - twist * c[:, None] * gamma, np.sqrt((M * M).sum(axis=1) - c * c)


def _space_axes(twist: float) -> Residual:
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


def _bounded(name: str, twist: float) -> Residual:
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


CLAIMS_3_3 = (
    Claim(
        "3.3", "α = -(M - cγ)/√(f - c²), β = M×γ/√(f - c²)", _space_axes, MOTION, "the sign of α"
    ),
    Claim("3.3", "Ẋ, Ẏ by M and γ; rubber", partial(path, RUBBER, 1.5e-6), MOTION, "the sign of Ẏ"),
    Claim(
        "3.3", "Ẋ, Ẏ by M and γ; classical", partial(path, CLASSICAL, 6e-6), MOTION, "the sign of Ẏ"
    ),
    Claim(
        "3.3",
        "the shell's speed is bounded by f; rubber",
        partial(_bounded, "fig14"),
        "maximum over the level",
        "the size of M",
        control=4.0,
    ),
    Claim(
        "3.3",
        "the shell's speed is bounded by f; classical",
        partial(_bounded, "classical_regular"),
        "maximum over the level",
        "the size of M",
        control=4.0,
    ),
)
