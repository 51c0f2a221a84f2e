"""K = 0: six isolated fixed points and a circle of them, section 4.1."""

from dataclasses import replace

import numpy as np
import pytest

from robotball import load_scene
from robotball.engines.ensembles.orbits import orbits
from robotball.equations import Parameters, Vector
from robotball.errors import InputError
from robotball.qualitative.equilibria import (
    FixedCircle,
    attitude_at,
    fixed_circle,
    fixed_points,
    flow,
    index_sum,
    jacobian,
    rate_scale,
)
from robotball.qualitative.portraits import spread_points
from robotball.rotations import Array, rotation_matrix
from tests.figures import CLASSICAL, ball, from_rest

A: Vector = (0.5, 0.4, 0.3)
NO_K: Vector = (0.0, 0.0, 0.0)


def circle_of(some: Parameters) -> FixedCircle:
    circle = fixed_circle(some)
    assert circle is not None
    return circle


@pytest.mark.parametrize(
    ("Omega", "isolated", "circle"),
    [
        ((4.0, 2.0, 1.0), 2, 0),
        ((4.0, 2.0, 0.01), 2, 0),
        ((4.0, 2.0, 0.0), 0, 2),  # Γ₅ and Γ₆, centres, lie on the circle
        ((4.0, 0.0, 1.0), 4, -2),  # Γ₃ and Γ₄, saddles, do
        ((0.0, 0.0, 2.0), 2, 0),
    ],
)
def test_points_and_circle_have_indices_that_add_up_to_2(
    Omega: Vector, isolated: int, circle: int
) -> None:
    """The circle's own is counted by how the flow turns beside it, and is not what is missing."""
    some = ball(A, Omega, NO_K)
    assert index_sum(fixed_points(some)) == isolated
    assert circle_of(some).index == circle
    assert isolated + circle == 2


def test_the_six_are_centres_and_saddles() -> None:
    """Proposition 1: Γ₃,₄ of the middle moment unstable, the others stable, but not attracting."""
    kinds = {
        int(np.argmax(np.abs(p.gamma))): p.kind
        for p in fixed_points(ball(A, (4.0, 2.0, 1.0), NO_K))
    }
    assert kinds == {0: "centre", 1: "saddle", 2: "centre"}


def test_every_point_of_the_circle_rests() -> None:
    """Rounding: measured 1.4e-17 of the rates; beside the circle the flow is not zero."""
    some = ball(A, (4.0, 2.0, 1.0), NO_K)
    circle = circle_of(some)
    gamma = circle.at(np.linspace(0, 2 * np.pi, 200))
    assert np.abs(flow(some, tuple(gamma.T))).max() < 1e-16 * rate_scale(some)
    beside = gamma + 0.01 * np.cross(*circle.axes)
    assert np.linalg.norm(flow(some, tuple(beside.T)), axis=0).max() > 1e-3 * rate_scale(some)


def test_the_rate_across_the_circle_is_the_flows_own() -> None:
    """The eigenvalues at its points are that rate and 0: measured 5.6e-16 1/s, rounding."""
    some = ball(A, (4.0, 2.0, 1.0), NO_K)
    circle = circle_of(some)
    gamma = circle.at(np.linspace(0.1, 6.2, 40))
    for point, rate in zip(gamma, circle.rate(gamma), strict=True):
        values = np.sort(np.linalg.eigvals(jacobian(some, point)).real)
        assert values == pytest.approx(np.sort([0.0, rate]), abs=2e-15)


def where_they_rest(some: Parameters, circle: FixedCircle) -> Array:
    """sin 2ψ on the circle, of those of 200 motions that come to rest there."""
    attitudes = attitude_at(spread_points(200))
    ends = orbits(some, attitudes, np.zeros((200, 3)), np.array([0.0, 400.0]))
    gamma = rotation_matrix(ends.attitudes[:, 1])[:, 2]
    x, y = circle.axes @ gamma[np.abs(gamma @ np.cross(*circle.axes)) < 1e-9].T
    return 2 * x * y


def test_motions_end_where_the_circle_attracts() -> None:
    """Σ_s, sin 2ψ > 0: all that stop; and on Σ_u all of those with Ω turned round, a control."""
    some = ball(A, (4.0, 2.0, 1.0), NO_K)
    circle, back = circle_of(some), replace(some, Omega=(-4.0, -2.0, -1.0))
    for each, sign in ((some, 1), (back, -1)):
        sines = where_they_rest(each, circle)
        assert len(sines) > 100  # measured 128 of 200: the others go round a centre
        assert (sign * sines > 0).all()


def test_scenes_of_fig_5_have_the_circle_in_spite_of_rounding() -> None:
    """Their K is computed from bodies: what is rounding counts as zero, and 1e-9 does not."""
    scene = load_scene("fig05b")
    assert len(fixed_points(scene.parameters)) == 6
    rounded = replace(scene.parameters, K=(3e-16, -1e-16, 4e-16))
    assert len(fixed_points(rounded)) == 6
    assert fixed_circle(rounded) is not None
    assert fixed_circle(replace(rounded, K=(0.0, 0.0, 1e-9))) is None


def test_other_balls_have_no_circle() -> None:
    """K ≠ 0, Ω = 0, classical; and with two equal moments no point is isolated."""
    for some in (from_rest(0.3), ball(A, NO_K, NO_K), CLASSICAL):
        assert fixed_circle(some) is None
    with pytest.raises(InputError, match="three different moments"):
        fixed_points(ball((0.5, 0.5, 0.3), (4.0, 2.0, 1.0), NO_K))
