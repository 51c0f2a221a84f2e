"""The closed form of section 4.1 against the search that knows nothing of it."""

from dataclasses import replace

import numpy as np
import pytest

from robotball.equations import Parameters, as_vector
from robotball.errors import InputError
from robotball.qualitative.equilibria import closed_form_points, fixed_points, flow, kappa, name_of
from tests.figures import CLASSICAL, ball, from_rest


def farthest(some: Parameters) -> tuple[int, float]:
    """How many fixed points both ways find, and how far the farthest is from its counterpart."""
    searched = np.array([point.gamma for point in fixed_points(some)])
    formula = np.array(list(closed_form_points(some).values()))
    assert len(searched) == len(formula)
    apart = np.linalg.norm(searched[:, None] - formula, axis=2)
    # Each is the nearest of its nearest: pairs.
    assert (apart.argmin(axis=0)[apart.argmin(axis=1)] == np.arange(len(searched))).all()
    return len(searched), float(apart.min(axis=1).max())


@pytest.mark.parametrize(("K3", "number"), [(0.3, 10), (0.52, 6), (3.0, 2)])
def test_figs_6_to_8(K3: float, number: int) -> None:
    """Rounding: measured 4e-16."""
    found, apart = farthest(from_rest(K3))
    assert found == number
    assert apart < 1e-13


@pytest.mark.slow
def test_random_balls() -> None:
    """Ω, A, K₃ of either sign, all three numbers of points; rounding: measured 2.5e-15.

    It is that of a rate over the smaller eigenvalue, which falls to 0 where points vanish.
    """
    rng = np.random.default_rng(6)
    numbers, worst = set(), 0.0
    for _ in range(200):
        A, Omega = as_vector(rng.uniform(0.2, 1.0, 3)), as_vector(rng.uniform(-4, 4, 3))
        some = ball(A, Omega, (0.0, 0.0, rng.uniform(-3, 3)), d=0.01)
        number, apart = farthest(some)
        numbers.add(number)
        worst = max(worst, apart)
    assert numbers == {2, 6, 10}
    assert worst < 1e-11


def test_what_has_no_closed_form_is_refused() -> None:
    """A classical ball; K off the axis; two equal moments; Ω along an axis."""
    for some in (CLASSICAL, replace(from_rest(0.3), K=(0.1, 0.0, 0.3))):
        with pytest.raises(InputError, match="rubber ball with K"):
            closed_form_points(some)
    for some in (
        ball((0.5, 0.5, 0.3), (4.0, 2.0, 1.0), (0.0, 0.0, 0.3)),
        ball((0.5, 0.4, 0.3), (4.0, 0.0, 0.0), (0.0, 0.0, 0.3)),
    ):
        with pytest.raises(InputError, match=r"three different moments|not zero"):
            closed_form_points(some)


TYPES = {
    "Γ₅": "slow stable focus",
    "Γ₆": "slow stable focus",
    "δ₁": "unstable node",
    "δ₂": "unstable node",
    "δ₃": "saddle",
    "δ₄": "saddle",
    "θ₁": "saddle",
    "θ₂": "saddle",
    "θ₃": "stable focus",
    "θ₄": "stable focus",
}


def test_fig6s_points_have_the_papers_names_and_types() -> None:
    """All ten as section 4.2 lists them; a pair is a point and its opposite."""
    some = from_rest(0.3)
    found = {name_of(some, point.gamma): point for point in fixed_points(some)}
    assert {name: point.kind for name, point in found.items()} == TYPES
    for first, second in (("δ₁", "δ₂"), ("δ₃", "δ₄"), ("θ₁", "θ₂"), ("θ₃", "θ₄"), ("Γ₅", "Γ₆")):
        assert found[first].gamma == pytest.approx(-found[second].gamma, abs=1e-14)


def test_the_formulas_as_printed_name_other_places() -> None:
    """A control, E10: with ν₁ = arcsin(Ω₃²/√…) and Ω₃ = 1.5 δ₁ is no fixed point."""
    some = replace(from_rest(0.3), Omega=(4.0, 2.0, 1.5))
    kappa_1, printed = kappa(some, 1), np.arcsin(1.5**2 / np.hypot(2.0, 1.5))
    angle = (np.arcsin(kappa_1) - printed) / 2
    as_printed = np.array([0.0, np.sin(angle), np.cos(angle)])
    assert np.abs(flow(some, as_vector(closed_form_points(some)["δ₁"]))).max() < 1e-14
    assert np.abs(flow(some, as_vector(as_printed))).max() > 0.01  # measured 0.033 1/s


def test_without_momentum_the_points_are_those_of_4_4() -> None:
    """K = 0: Γ₁ … Γ₆, and not those that lie on the circle across Ω."""
    assert "".join(closed_form_points(from_rest(0.0))) == "Γ₁Γ₂Γ₃Γ₄Γ₅Γ₆"
    sideways = ball((0.5, 0.4, 0.3), (4.0, 2.0, 0.0), (0.0, 0.0, 0.0))
    assert "".join(closed_form_points(sideways)) == "Γ₁Γ₂Γ₃Γ₄"
    assert name_of(from_rest(0.0), np.array([0.0, -1.0, 0.0])) == "Γ₄"


def test_points_that_the_paper_does_not_name_have_no_name() -> None:
    """Of a ball with K off the axes, and a γ that is no fixed point."""
    some = replace(from_rest(0.3), K=(0.1, 0.0, 0.3))
    assert [name_of(some, point.gamma) for point in fixed_points(some)].count("") > 0
    assert name_of(from_rest(0.3), np.array([0.6, 0.0, 0.8])) == ""
