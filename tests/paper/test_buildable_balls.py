"""Which A, d and K a ball of rigid bodies can have, beside the formulas of Appendix A."""

from dataclasses import replace

import numpy as np
import pytest

from robotball import InputError
from robotball.design.designing import masses_allowed
from robotball.robot.ball import _check_inertia, beyond_the_shell
from robotball.rotations import Array, tangents
from tests.paper import formulas as f
from tests.paper.captions import CAPTIONS
from tests.paper.formulas import Errors, count, paper_scene, worst
from tests.paper.point_masses import Body, moments


def is_an_inertia(tensor: Array) -> bool:
    """Return whether a rigid body can have the inertia (3, 3)."""
    try:
        _check_inertia("body", tensor)
    except InputError:
        return False
    return True


def test_a_body_has_the_inertia_if_d_satisfies_the_triangle_inequality() -> None:
    """Not in the paper: with b = 1/a, if and only if d ≤ Σb - 2 max b; of random b and d."""

    def wrong(sign: float) -> Errors:
        random = np.random.default_rng(5)
        for _ in range(1000):
            b = random.uniform(1.0, 3.0, 3)
            d = random.uniform(0.0, b.min())
            yield (d <= b.sum() - 2 * sign * b.max()) != is_an_inertia(np.diag(b - d))

    assert count(wrong(+1)) == 0  # of 1000
    assert count(wrong(-1)) > 100  # control: the sign of max b, 339


def test_mass_within_the_shell_needs_a_d_above_a_fifth_of_the_sum() -> None:
    """Not in the paper: d ≥ Σb/5 and max b ≤ (2/5)Σb, of random clouds of points."""

    def wrong(factor: float) -> Errors:
        random = np.random.default_rng(6)
        for _ in range(1000):
            masses, r = random.uniform(size=20), random.normal(size=(20, 3))
            r *= random.uniform(0.3, 1.0) / np.linalg.norm(r, axis=1, keepdims=True)
            r *= [1.0, 1.0, random.uniform()]
            d = masses.sum()  # a = 1
            I = np.eye(3) * (masses @ (r * r).sum(axis=1)) - np.einsum("n,ni,nj->ij", masses, r, r)
            b = np.linalg.eigvalsh(I) + d
            yield not (b.sum() / 5 <= factor * d and b.max() <= 0.4 * b.sum())

    assert count(wrong(1.0)) == 0  # of 1000
    assert count(wrong(0.5)) == 1000  # control: 2/5 for 1/5


@pytest.mark.parametrize(
    ("name", "share", "least", "most"),
    [
        ("fig06", 0.42553, 1.56667, 7 / 6),
        ("fig10", 0.47619, 1.4, 1 / 3),
        ("fig14", 0.38356, 0.86905, 1.0119),
    ],
)
def test_the_masses_that_a_figures_A_allows(
    name: str, share: float, least: float, most: float
) -> None:
    """Not in the paper: max b/Σb, Σb/5 and Σb - 2 max b. Figs 5 to 10 allow no mass."""
    b = 1 / np.array(paper_scene(name).parameters.A)
    numbers = np.array([b.max() / b.sum(), *masses_allowed(np.diag(b), 1.0)])
    assert worst(numbers / [share, least, most] - 1) <= 3e-5  # measured 4.7e-6: their last digits
    assert (least < most) == (name == "fig14")


@pytest.mark.parametrize("name", [*CAPTIONS, "fig10_stable"])
def test_only_the_balls_of_figs_11_to_14_can_be_built(name: str) -> None:
    """Not in the paper: the catalog's other balls have mass beyond the shell."""
    impossible = bool(beyond_the_shell(paper_scene(name).ball))
    assert impossible != (name in ("fig12", "fig13", "fig14"))


def test_one_rotor_gives_any_K() -> None:
    """Not in the paper: along K + (J_s + d)Ω, at |K + (J_s + d)Ω|/j; of point masses."""

    def errors(sign: float) -> Errors:
        random = np.random.default_rng(7)
        for moment in moments(93, rotors=0):
            bare, K = moment.ball, random.normal(size=3)
            d = (bare.mass + 0.04) * bare.a**2
            needed = K + (bare.shell.moment(bare.shell.axis) + sign * d) * bare.Omega
            axis = f.unit(needed)
            points = 0.2 * np.concatenate([tangents(axis), -tangents(axis)])
            speed = float(np.linalg.norm(needed)) / (0.04 * 0.2**2)
            rotor = Body(np.full(4, 0.01), points, np.zeros(3), axis, speed)
            k = replace(bare, rotors=(rotor,)).momenta(np.zeros(3), np.zeros(3))[1]
            yield k - d * bare.Omega - K

    assert worst(errors(+1)) <= 1e-14  # kg m²/s; measured 1.2e-15: rounding
    assert worst(errors(-1)) > 0.5  # control: the sign of d, 2.7
