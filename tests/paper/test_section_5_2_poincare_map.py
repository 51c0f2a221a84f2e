"""Section 5.2: the variables (L, l, g) of (5.5) and the Poincaré map."""

import numpy as np
from numpy import cos, sin, sqrt
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from robotball.dynamics.sections import crossings_of_motion, sections_of
from robotball.robot.scene import section_state
from robotball.rotations import Array
from robotball.theory.ensembles.orbits import kernel_start
from tests.paper import formulas as f
from tests.paper.captions import CAPTIONS, F
from tests.paper.engine_ball import RUBBER, mujoco_ball
from tests.paper.formulas import Errors, cross, paper_scene, worst
from tests.paper.test_section_5_3_attractors import chaotic, starts


def andoyer(L: float, l: float, g: float) -> tuple[Array, Array]:
    """Return M and γ (3,) of (5.5) at f = 25."""
    root, share = sqrt(F - L**2), L / sqrt(F)
    M = np.array([root * sin(l), root * cos(l), L])
    gamma = np.array(
        [
            share * cos(g) * sin(l) + sin(g) * cos(l),
            share * cos(g) * cos(l) - sin(g) * sin(l),
            -sqrt(1 - share**2) * cos(g),
        ]
    )
    return M, gamma


def random_variables(seed: int) -> list[tuple[float, float, float]]:
    """Return 100 random L, l, g."""
    random = np.random.default_rng(seed)
    return [(random.uniform(-5, 5), *random.uniform(0, 2 * np.pi, 2)) for _ in range(100)]


def test_there_is_no_straight_line_at_the_momentum_of_the_section() -> None:
    """Section 5.2: f > K² in Figs 11a and 11b, so f > (γ×K)² on all of Σ¹."""

    def least(level: float) -> float:
        excess = []
        for n in (CAPTIONS[name].n for name in ("fig12", "fig14")):
            M = np.cross(f.sigma(n, np.linspace(0.0, 2 * np.pi, 721)), n.K)
            excess.append(level - float((M * M).sum(axis=1).max()))
        return min(excess)

    assert least(F) >= 1.0  # (kg m²/s)²; measured 12
    assert least(5.0) < 0  # control: f < K², -8


def test_the_variables_of_the_section_lie_on_the_level_of_the_integrals() -> None:
    """(5.5): γ² = 1, (M, γ) = 0 and M² = f; robotball's section_state too."""

    def errors(sign: float) -> Errors:
        for variables in random_variables(71):
            M, gamma = andoyer(*variables)
            gamma = gamma * [1.0, sign, 1.0]
            yield [gamma @ gamma - 1, M @ gamma, M @ M / F - 1]

    assert worst(errors(+1)) <= 1e-14  # measured 3.0e-15: rounding
    assert worst(errors(-1)) > 1.0  # control: the sign of γ₂, 4.9
    for variables in random_variables(71):
        (M, gamma), (gamma_ours, M_ours) = andoyer(*variables), section_state(*variables, F)
        assert worst([gamma - gamma_ours, M - M_ours]) <= 1e-14


def test_the_section_has_a_form_without_angles() -> None:
    """Not in the paper: (M×γ)₃ = -√(f - L²) sin g."""

    def errors(sign: float) -> Errors:
        for L, l, g in random_variables(94):
            yield cross(*andoyer(L, l, g))[2] + sign * sqrt(F - L**2) * sin(g)

    assert worst(errors(+1)) <= 1e-14  # kg m²/s; measured 8.9e-16: rounding
    assert worst(errors(-1)) > 1.0  # control: the sign, 9.8


def angle_g(M: Array, gamma: Array) -> float:
    """Return g by (5.5): sin g = γ₁cos l - γ₂sin l, cos g = -γ₃/√(1 - L²/f)."""
    across = np.hypot(M[0], M[1])
    sine = (gamma[0] * M[1] - gamma[1] * M[0]) / across
    return float(np.arctan2(sine, -gamma[2] * np.linalg.norm(M) / across))


def test_robotballs_sections_are_the_crossings_of_g_zero() -> None:
    """(5.6): (l, L) of MuJoCo's ball of Fig. 12, and of the equations, where g = 0 by (5.5)."""
    scene, ball = paper_scene(RUBBER), mujoco_ball(RUBBER)
    times = ball.motion.times
    M, gamma = CubicSpline(times, ball.momentum), CubicSpline(times, ball.gamma)
    g = np.array([angle_g(*state) for state in zip(ball.momentum, ball.gamma, strict=True)])

    def errors(g0: float) -> Errors:
        # From -π to π about the section, so that the jump of the angle is far from it.
        angles = np.mod(g + g0 + np.pi, 2 * np.pi) - np.pi
        passing = np.flatnonzero((angles[1:] * angles[:-1] < 0) & (np.abs(np.diff(angles)) < 1.0))
        at = [
            brentq(lambda t: sin(angle_g(M(t), gamma(t))), times[i], times[i + 1], xtol=1e-12)
            for i in passing
        ]
        l, L = np.arctan2(M(at)[:, 0], M(at)[:, 1]), M(at)[:, 2]
        of_equations = sections_of(*kernel_start(scene), count=len(at))
        of_motion = crossings_of_motion(ball.motion, scene)[: len(at)]
        ours = ((of_equations.l[0], of_equations.L[0]), (of_motion.l, of_motion.L))
        for l_ours, L_ours in ours:
            turn = np.abs(l - l_ours)
            yield np.minimum(turn, 2 * np.pi - turn) + np.abs(L - L_ours)

    assert worst(errors(0.0)) <= 4e-7  # measured 4.0e-8: MuJoCo's contact
    assert worst(errors(np.pi)) > 0.5  # control: g₀ = π, 2.2


def test_each_orbit_crosses_the_section_in_both_directions() -> None:
    """Not in the paper: 64 orbits of Fig. 11b, 1000 crossings."""

    def one_way(number: int) -> int:
        directions = sections_of(chaotic(), *starts(64), count=number, tolerance=1e-9).directions
        return int(np.count_nonzero((directions == directions[:, :1]).all(axis=1)))

    assert one_way(1000) == 0
    assert one_way(5) > 0  # control: 5 crossings; 6 orbits cross in one direction only


def test_the_section_is_an_annulus() -> None:
    """Section 5.2, E25: at L = √f γ depends on l. The paper prints a point of the sphere S²."""

    def distance(l: float) -> float:
        return float(np.linalg.norm(andoyer(5.0, l, 0.0)[1] - andoyer(5.0, 0.0, 0.0)[1]))

    assert abs(distance(np.pi) - 2.0) <= 1e-12  # measured 2; printed: 0, a pole
    assert distance(0.0) == 0.0  # control: the same l
