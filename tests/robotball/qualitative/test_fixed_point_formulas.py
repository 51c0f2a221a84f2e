"""The closed form of section 4.1 against the search that knows nothing of it."""

from dataclasses import replace

import numpy as np
import pytest

from robotball.errors import InputError
from robotball.parameters import Parameters, as_vector
from robotball.qualitative.equilibria import fixed_points
from robotball.qualitative.fixed_point_formulas import closed_form_points
from tests.figures import CLASSICAL, ball, from_rest


def farthest(some: Parameters) -> tuple[int, float]:
    """How many fixed points both ways find, and how far the farthest is from its counterpart."""
    searched = np.array([point.gamma for point in fixed_points(some)])
    formula = np.array(closed_form_points(some))
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
    """A classical ball; K off the axis or zero; two equal moments; Ω along an axis."""
    for some in (
        CLASSICAL,
        replace(from_rest(0.3), K=(0.1, 0.0, 0.3)),
        from_rest(0.0),
    ):
        with pytest.raises(InputError, match="rubber ball with K"):
            closed_form_points(some)
    for some in (
        ball((0.5, 0.5, 0.3), (4.0, 2.0, 1.0), (0.0, 0.0, 0.3)),
        ball((0.5, 0.4, 0.3), (4.0, 0.0, 0.0), (0.0, 0.0, 0.3)),
    ):
        with pytest.raises(InputError, match="three moments of inertia"):
            closed_form_points(some)
