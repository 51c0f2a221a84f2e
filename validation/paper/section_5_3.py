"""Section 5.3: the attractors of Fig. 11 and their exponents.

What is chaotic is measured over 1e5 s by 16 starts, to standard errors of 2.3e-4 (Λ₁), 2.7e-4 (Λ₆)
and 9.5e-4 (D). Bounds are 5 of them or more, and half of the last digit that is stated.
"""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from robotball import simulate
from robotball.parameters import Parameters
from robotball.qualitative.cycles import Cycle
from robotball.qualitative.lyapunov import Exponents, exponents
from robotball.qualitative.sections import fixed_point, section, section_starts
from robotball.rotations import Array, from_matrix, rotation_matrix
from robotball.start import Start
from validation.paper import formulas as f
from validation.paper.captions import CAPTIONS
from validation.paper.claim import Claim, Residual, Value
from validation.paper.engine import NAME
from validation.paper.scenes import paper_scene
from validation.paper.section_5_2 import F
from validation.paper.six_exponents import six_exponents

LONG = 1e5  # s


def regular() -> Parameters:
    """The ball of Figs 11a, 12 and 13."""
    return paper_scene("fig12").parameters


def chaotic() -> Parameters:
    """The ball of Figs 11b and 14."""
    return paper_scene("fig14").parameters


def starts(n: int, c: float = 0.0) -> tuple[Array, Array]:
    """Attitudes (n, 4) and momenta (n, 3) over the section g = 0."""
    random = np.random.default_rng(2)
    return section_starts(random.uniform(-4.5, 4.5, n), random.uniform(0, 2 * np.pi, n), F, c=c)


# Fig. 11a: one cycle, one torus ------------------------------------------------------------


@cache
def settled() -> tuple[Cycle, Array]:
    """The periodic motion that Fig. 12's settles on, and three crossings (3, 6) of it in a row.

    A crossing is M and γ.
    """
    runs = section(regular(), *section_starts(3.6, 0.6, F), count=200)
    cycle = fixed_point(regular(), runs.L[0, -1], runs.l[0, -1], F)
    through = section(regular(), cycle.attitude[None], cycle.momentum[None], count=3)
    axes = rotation_matrix(through.attitudes[0])
    return cycle, np.concatenate([cycle.momentum @ axes, axes[:, 2]], axis=1)


def flow(twist: float = 1.0) -> f.Field:
    """d/dt of (M, γ) of Fig. 11a's ball; twisted, back in time."""
    rate = f.reduced(f.rubber_velocity, f.numbers(regular()))
    return lambda x: twist * rate(x)


def one_periodic_motion(twist: float) -> Residual:
    """From one concentration (3.2) leads to the other, and after a period back to the first.

    Twisted, after half as long.
    """
    cycle, (one, other, again) = settled()
    times = np.linspace(0.0, cycle.period * (1.0 if twist == 1 else 0.5), 401)
    path = f.followed(flow(), one, times)
    reach = np.linalg.norm(path - other, axis=1).min()
    spacing = np.linalg.norm(np.diff(path, axis=0), axis=1).max()
    back = np.linalg.norm(path[-1] - one) + np.linalg.norm(again - one)
    missed = max(float(reach - spacing), 0.0)  # it passes the other between two samples
    return Residual(float(back) + missed, bound=1e-10)


def attracts(twist: float) -> Residual:
    """What is left of a neighbour's distance from that motion after ten periods of (3.2).

    Twisted, back in time.
    """
    cycle, (one, _, _) = settled()
    M, gamma = one[:3], one[3:]
    turn = f.turned_about(f.across(gamma)[0], 1e-4)  # of both, which keeps f and (M, γ)
    times = np.array([0.0, 10 * cycle.period])
    ends = [
        f.followed(flow(twist), np.concatenate([S @ M, S @ gamma]), times, 1e-9)[-1]
        for S in (f.E, turn)
    ]
    # Along the motion a neighbour stays as far ahead; that part does not count.
    direction = flow()(one) / np.linalg.norm(flow()(one))
    away = ends[1] - ends[0]
    aside = away - (away @ direction) * direction
    return Residual(float(np.linalg.norm(aside)) / (1e-4 * np.sqrt(F)), bound=0.8)


@cache
def torus_points(L: float, l: float) -> Array:
    """(l, L/√f) (n, 2) of 2000 crossings of g = 0 after as many, with 0 ≤ l < 2π."""
    found = section(regular(), *section_starts(L, l, F), count=4000)
    return np.stack([found.l[0, 2000:] % (2 * np.pi), found.L[0, 2000:] / np.sqrt(F)], axis=1)


def parts_of_the_curve(twist: float) -> Value:
    """How many pieces Fig. 13's crossings make, where those within 0.2 are joined.

    Twisted, with l to be counted from the middle of a piece.
    """
    points = torus_points(0.0, 1.96).copy()
    if twist != 1:
        points[:, 0] = (points[:, 0] - 1.05) % (2 * np.pi)
    tree = cKDTree(points)
    pieces, _ = connected_components(tree.sparse_distance_matrix(tree, 0.2))
    return Value(int(pieces), corrected=2, bound=0)


def limit_torus(twist: float) -> Residual:
    """How far from Fig. 13's crossings those of another start settle; twisted, of Fig. 12's."""
    other = torus_points(0.3, 1.8) if twist == 1 else torus_points(3.6, 0.6)
    return Residual(float(np.max(cKDTree(torus_points(0.0, 1.96)).query(other)[0])), bound=0.05)


# Fig. 11b: exponents -------------------------------------------------------------------------


@cache
def six() -> Array:
    """Λ₁ to Λ₆ of Fig. 14's motion over 6000 s."""
    caption = CAPTIONS["fig14"]
    return six_exponents(caption.n, caption.M, caption.axes[2], 6000.0)


def four_zeros(twist: float) -> Residual:
    """Λ₂ to Λ₅; twisted, Λ₁ to Λ₄."""
    four = six()[1:5] if twist == 1 else six()[:4]
    return Residual(float(np.abs(four).max()), bound=4e-3, unit="1/s")


def outer_two(twist: float) -> Residual:
    """How far Λ₁ and Λ₆ are from 0.116 and -0.139; the bound is 5 standard errors at 6000 s."""
    off = six()[[0, 5]] - [0.116, -0.139 * twist]
    return Residual(float(np.abs(off).max()), bound=0.02, unit="1/s")


@cache
def ensemble() -> Exponents:
    """Those of Fig. 11b from 16 starts."""
    return exponents(chaotic(), *starts(16), duration=LONG)


def largest_exponent(twist: float) -> Value:
    """λ₁ of Fig. 11b; twisted, λ₆."""
    index = 0 if twist == 1 else 1
    return Value(ensemble().mean[index], corrected=0.116, bound=2e-3, printed=0.11, unit="1/s")


def smallest_exponent(twist: float) -> Value:
    """λ₆ of Fig. 11b; twisted, λ₁."""
    index = 1 if twist == 1 else 0
    return Value(ensemble().mean[index], corrected=-0.139, bound=2e-3, printed=-0.13, unit="1/s")


def dimension(twist: float) -> Value:
    """D = 1 + Λ₁/|Λ₆|."""
    first, last = ensemble().mean
    found = 1 + twist * first / abs(last)
    return Value(found, corrected=1.832, bound=5.5e-3, printed=1.84)


def strange(twist: float) -> Value:
    """The rate at which MuJoCo's neighbours part, twelve times 20 s on from Fig. 14's start.

    By ln of the distance's growth; that of a limit cycle's neighbours is 0 or less. Twisted, on
    from Fig. 12's.
    """
    scene, piece, apart = paper_scene("fig14" if twist == 1 else "fig12"), 20.0, 1e-5
    attitude, momentum = scene.start.attitude, scene.start.momentum
    turn, total = f.E[0], 0.0
    for _ in range(12):
        beside = from_matrix(rotation_matrix(attitude) @ f.turned_about(turn, apart))
        ends = [
            simulate(replace(scene, start=Start(q, momentum)), np.array([0.0, piece])).attitude[-1]
            for q in (attitude, beside)
        ]
        first, second = map(rotation_matrix, ends)
        away = first.T @ second
        vector = np.array(
            [away[2, 1] - away[1, 2], away[0, 2] - away[2, 0], away[1, 0] - away[0, 1]]
        )
        total += np.log(np.linalg.norm(vector) / 2 / apart)
        attitude, turn = ends[0], vector / np.linalg.norm(vector)
    # Over 240 s the exponent scatters by 0.02.
    return Value(total / (12 * piece), corrected=0.116, bound=0.08, printed=0.0, unit="1/s")


CLAIMS = (
    Claim(
        "E23, Fig. 11a",
        "the two concentrations are one periodic motion",
        one_periodic_motion,
        "(3.2) by scipy",
        "half the period",
    ),
    Claim(
        "Fig. 11a", "that periodic motion attracts", attracts, "(3.2) by scipy", "the sense of time"
    ),
    Claim(
        "Fig. 11a",
        "a limit torus: another start settles on it",
        limit_torus,
        "the section",
        "Fig. 12's start",
    ),
    Claim(
        "Fig. 11a",
        "the torus's curve: two parts on the involute",
        parts_of_the_curve,
        "the section",
        "another cut",
    ),
    Claim("5.3", "Λ₁ ≈ 0.11 and Λ₆ ≈ -0.13", outer_two, "six neighbours", "the sign of Λ₆"),
    Claim("5.3", "Λ₂ ≈ Λ₃ ≈ Λ₄ ≈ Λ₅ ≈ 0", four_zeros, "six neighbours", "Λ₁ to Λ₄"),
    Claim(
        "E26, 5.3",
        "the largest exponent Λ₁",
        largest_exponent,
        "16 runs of 1e5 s",
        "Λ₆ for Λ₁",
        printed="Λ₁ ≈ 0.11",
    ),
    Claim(
        "E26, 5.3",
        "the smallest exponent Λ₆",
        smallest_exponent,
        "16 runs of 1e5 s",
        "Λ₁ for Λ₆",
        printed="Λ₆ ≈ -0.13",
    ),
    Claim(
        "E26, 5.3",
        "D = 1 + Λ₁/|Λ₆|",
        dimension,
        "16 runs of 1e5 s",
        "the sign of Λ₁",
        printed="D ≈ 1.84",
    ),
    Claim(
        "E22, Fig. 14",
        "a strange attractor: neighbours part",
        strange,
        f"{NAME}'s neighbours",
        "Fig. 12's start",
        printed='"the stable limit cycle" in Fig. 11b',
    ),
)
