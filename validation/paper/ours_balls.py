"""What is ours and not the paper's: which balls exist."""

from functools import partial

import numpy as np

from robotball import InputError
from robotball.bodies import beyond_the_shell, check_inertia
from robotball.designing.feasibility import masses_allowed
from robotball.rotations import Array
from validation.paper import formulas as f
from validation.paper.claim import Claim, Residual
from validation.paper.point_masses import Ball, Body, moments
from validation.paper.scenes import paper_scene
from validation.paper.section_3_1 import MOMENTUM

BUILDABLE = ("fig12", "fig13", "fig14")
UNBUILDABLE = ("fig05b", "fig05c", "fig05d", "fig06", "fig07", "fig08", "fig10", "fig10_stable")


def triangle_inequality(twist: float) -> Residual:
    """d ≤ Σb - 2 max b, b = 1/a, says for how many of 1000 I = b - d wrongly if a body has it."""
    random = np.random.default_rng(5)
    wrong = 0
    for _ in range(1000):
        b = random.uniform(1.0, 3.0, 3)
        d = random.uniform(0.0, b.min())
        wrong += (d <= b.sum() - 2 * twist * b.max()) != is_an_inertia(np.diag(b - d))
    return Residual(wrong, bound=0, unit="of 1000 wrong")


def is_an_inertia(tensor: Array) -> bool:
    """Whether a rigid body can have the inertia (3, 3)."""
    try:
        check_inertia("body", tensor)
    except InputError:
        return False
    return True


def mass_inside(twist: float) -> Residual:
    """d ≥ Σb/5 and max b ≤ (2/5) Σb: for how many of 1000 clouds of masses within a not so."""
    random = np.random.default_rng(6)
    wrong = 0
    for _ in range(1000):
        masses, r = random.uniform(size=20), random.normal(size=(20, 3))
        r *= random.uniform(0.3, 1.0) / np.linalg.norm(r, axis=1, keepdims=True)
        r *= [1.0, 1.0, random.uniform()]
        d = masses.sum()  # a = 1
        I = np.eye(3) * (masses @ (r * r).sum(axis=1)) - np.einsum("n,ni,nj->ij", masses, r, r)
        b = np.linalg.eigvalsh(I) + d
        wrong += not (b.sum() / 5 <= twist * d and b.max() <= 0.4 * b.sum())
    return Residual(wrong, bound=0, unit="of 1000 wrong")


def limits(name: str, share: float, least: float, most: float, twist: float) -> Residual:
    """max b/Σb, Σb/5 and Σb - 2 max b of a figure's A, beside what is stated; relative."""
    b = 1 / np.array(paper_scene(name).parameters.A)
    found = np.array([b.max() / b.sum(), *masses_allowed(np.diag(b), 1.0)])
    stated = np.array([share, least, twist * most])
    return Residual(float(np.abs(found / stated - 1).max()), bound=3e-5)


def buildable(twist: float) -> Residual:
    """Of how many of the catalog's balls it is wrong which can be built."""
    inside, outside = (BUILDABLE, UNBUILDABLE) if twist == 1 else (UNBUILDABLE, BUILDABLE)
    wrong = sum(bool(beyond_the_shell(paper_scene(name).ball)) for name in inside)
    wrong += sum(not beyond_the_shell(paper_scene(name).ball) for name in outside)
    return Residual(wrong, bound=0, unit="of 11 wrong")


def one_rotor(twist: float) -> Residual:
    """K by Σ r×mu of balls with one rotor along K + (J_s + d)Ω at |K + (J_s + d)Ω|/j, beside K."""
    random, worst = np.random.default_rng(7), 0.0
    for moment in moments(93, rotors=0):
        bare, wanted = moment.ball, random.normal(size=3)
        rotor = Body(np.full(4, 0.01), np.zeros((4, 3)), np.zeros(3), f.E[2])
        d = (bare.mass + rotor.mass) * bare.a**2
        needed = wanted + (bare.shell.moment(bare.shell.axis) + twist * d) * bare.Omega
        axis = needed / np.linalg.norm(needed)
        points = 0.2 * np.concatenate([f.across(axis), -f.across(axis)])
        rate = float(np.linalg.norm(needed)) / (rotor.mass * 0.2**2)
        ball = Ball(
            bare.shell, bare.frame, (Body(rotor.masses, points, np.zeros(3), axis, rate),), bare.a
        )
        k = ball.momenta(np.zeros(3), np.zeros(3))[1]
        worst = max(worst, float(np.abs(k - d * ball.Omega - wanted).max()))
    return Residual(worst, bound=1e-14, unit=MOMENTUM)


def limited(name: str, place: str, statement: str, *numbers: float) -> Claim:
    """A row of a figure's limits."""
    return Claim(
        place,
        statement,
        partial(limits, name, *numbers),
        "I and d",
        "the largest d, by a hundredth",
        control=1.01,
    )


CLAIMS = (
    Claim(
        "App. A",
        "b = 1/a: a body has I iff d ≤ Σb - 2 max b",
        triangle_inequality,
        "random bodies",
        "the sign of max b",
    ),
    Claim(
        "App. A",
        "mass inside needs d ≥ Σb/5, max b ≤ (2/5)Σb",
        mass_inside,
        "random clouds",
        "1/5, to 2/5",
        control=0.5,
    ),
    limited(
        "fig14", "Figs 11-14", "max b = 0.3836 Σb; 0.869 ≤ m ≤ 1.012", 0.38356, 0.86905, 1.0119
    ),
    limited("fig06", "Figs 5-8", "max b = 0.4255 Σb; m ≤ 7/6, below Σb/5", 0.42553, 1.56667, 7 / 6),
    limited("fig10", "Figs 9-10", "max b = 0.4762 Σb; m ≤ 1/3, below Σb/5", 0.47619, 1.4, 1 / 3),
    Claim(
        "Figs 5-14",
        "only the balls of 11 to 14 can be built",
        buildable,
        "their bodies",
        "the other ones",
    ),
    Claim(
        "(A.3)",
        "one rotor along K + (J_s + d)Ω gives any K",
        one_rotor,
        "point masses",
        "the sign of d",
    ),
)
