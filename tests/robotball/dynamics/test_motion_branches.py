"""Families of balls: their flow preserves the level, and vanishes at the solutions."""

from collections.abc import Iterator

import numpy as np
import pytest

from robotball.dynamics.continuation import Watch
from robotball.dynamics.equilibria import fixed_points, linear_part
from robotball.dynamics.motion_branches import Family, resting, sought, vectors_of
from robotball.dynamics.straight_motions import straight_motions
from robotball.errors import InputError
from robotball.rotations import Array
from tests.figures import CLASSICAL, ball, from_rest

pytestmark = pytest.mark.core

REST = Family(from_rest(0.3), np.zeros(3), "K3", 0.2, 0.4)
MOVING = Family(CLASSICAL, np.array([-4.0, 0.0, 3.0]), "K2", 2.0, 3.0)

FIG10 = ball((0.5, 0.3, 0.6), (0.0, 0.0, 1.0), (4.0, 5.0, 0.0), d=0.1)
STRAIGHT = Family(FIG10, np.array([-1.0, 0.0, 0.0]), "f", 1.9, 2.0)


def level_point(family: Family, seed: int) -> Array:
    """Return a random γ, or γ and μ, on the family's level at s = 0.5."""
    rng = np.random.default_rng(seed)
    gamma, across = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    _, size, c = family.at(0.5)
    return np.array([*gamma, *(c * gamma + np.sqrt(1 - c * c) * across)] if size else gamma)


@pytest.mark.parametrize("family", [REST, MOVING], ids=["from rest", "classical"])
def test_the_flow_preserves_the_constants_of_its_level(family: Family) -> None:
    """They vanish on the level, and do not change along the rate, up to the error of differences.

    Off the level they equal the deviation.
    """
    for seed in range(5):
        u = level_point(family, seed)
        assert np.abs(family.constants(u, 0.5)).max() < 1e-15
        rate = family.rate(u, 0.5)
        ahead, behind = (family.constants(u + h * rate, 0.5) for h in (1e-5, -1e-5))
        assert np.abs((ahead - behind) / 2e-5).max() < 1e-9
        assert np.abs(rate).max() > 0.05
        (longer, *_) = family.constants(1.1 * u, 0.5)
        assert longer == pytest.approx(0.21)


def test_the_number_of_a_family_runs_from_low_to_high() -> None:
    """Nothing else of the ball or of its momentum changes."""
    for s, value in ((0.0, 2.0), (0.25, 2.25), (1.0, 3.0)):
        parameters, size, c = MOVING.at(s)
        assert (MOVING.value(s), parameters.K) == (value, (2.0, value, 0.0))
        assert (size, c) == pytest.approx((5.0, 0.6))
        assert parameters.I == CLASSICAL.I


def test_solutions_found_before_an_error_are_kept() -> None:
    """At each value; the watch receives the error. It is raised if nothing is found anywhere."""
    told: list[tuple[float, str]] = []

    class Kept(Watch):
        def lost(self, s: float, reason: str) -> None:
            told.append((s, reason))

    def found(*ball: object) -> Iterator[int]:
        yield from range(count)
        raise InputError("it lifts off")

    count = 2
    places = [s for some, s in sought(REST, 0, found, Kept()) if some == [0, 1]]
    assert places == pytest.approx([0.0, 1.0, 0.5])
    assert told == [(s, "it lifts off") for s in places]
    count = 0
    with pytest.raises(InputError, match="it lifts off"):
        [*sought(REST, 0, found)]


@pytest.mark.parametrize("family", [REST, STRAIGHT], ids=["from rest", "straight"])
def test_branches_contain_all_equilibria_at_both_ends(family: Family) -> None:
    """The fixed points from rest or the straight lines, with their eigenvalues."""
    branches = [*resting(family)]
    for s in (0.0, 1.0):
        parameters, size, c = family.at(s)
        points = [p.x[:-1] for branch in branches for p in branch.points if p.x[-1] == s]
        if size:
            lines = straight_motions(parameters, size**2, c * size)
            known = [np.array([*line.gamma, *line.momentum / size]) for line in lines]
            values = [line.eigenvalues for line in lines]
        else:
            known = [point.gamma for point in fixed_points(parameters)]
            values = [point.eigenvalues for point in fixed_points(parameters)]
        assert len(points) == len(known) > 1
        for u in points:
            assert np.abs(family.rate(u, s)).max() < 1e-9
            away = [float(np.abs(u - solution).max()) for solution in known]
            i = int(np.argmin(away))
            assert away[i] < 1e-8
            found = np.linalg.eigvals(linear_part(*family.flow(u, s)))
            assert np.sort_complex(found) == pytest.approx(np.sort_complex(values[i]), abs=1e-6)
        assert vectors_of(points[0]).shape == (2 if size else 1, 3)
