"""The manifolds of the saddles of (4.1)."""

from collections import Counter

import numpy as np

from robotball.qualitative.equilibria import fixed_points, flow, name_of
from robotball.qualitative.portraits import Separatrix, separatrices
from tests.figures import from_rest


def ends(found: list[Separatrix], K3: float, stable: bool) -> Counter[tuple[str, str]]:
    """How many manifolds lead from which saddle to which point."""
    ball = from_rest(K3)
    return Counter(
        (name_of(ball, each.saddle.gamma), name_of(ball, each.end.gamma) if each.end else "")
        for each in found
        if each.stable == stable
    )


def test_fig6_has_a_closed_contour() -> None:
    """Back in time the stable manifolds of δ₃ and δ₄ end at both δ₁ and δ₂: four arcs of a loop."""
    ball = from_rest(0.3)
    found = separatrices(ball, fixed_points(ball), 400.0)
    back = ends(found, 0.3, stable=True)
    for saddle in ("δ₃", "δ₄"):
        assert [back[saddle, node] for node in ("δ₁", "δ₂")] == [1, 1]
    # A control: forwards no manifold of theirs ends there, for δ₁ and δ₂ repel.
    ahead = ends(found, 0.3, stable=False)
    assert not any(end in ("δ₁", "δ₂") for _, end in ahead)


def test_every_saddle_has_four_manifolds_along_the_flow() -> None:
    """They leave the saddle by 1e-4, and dγ/dt is along them, or against them where stable."""
    ball = from_rest(0.3)
    points = fixed_points(ball)
    found = separatrices(ball, points, 100.0)
    assert len(found) == 4 * sum(point.kind == "saddle" for point in points)
    for each in found:
        assert np.linalg.norm(each.path[0] - each.saddle.gamma) < 1.1e-4
        middle = len(each.path) // 2
        step = each.path[middle + 1] - each.path[middle - 1]
        rate = np.array(flow(ball, tuple(each.path[middle])))
        if np.linalg.norm(rate) > 1e-3:
            along = step @ rate / np.linalg.norm(step) / np.linalg.norm(rate)
            assert along * (-1 if each.stable else 1) > 0.99


def test_without_saddles_there_are_none() -> None:
    """Fig. 8: K₃ = 3."""
    ball = from_rest(3.0)
    assert separatrices(ball, fixed_points(ball), 10.0) == []
