"""The phase portrait on the sphere and unrolled."""

import pytest

from robotball.dynamics.cycles import limit_cycles
from robotball.dynamics.equilibria import fixed_circle, fixed_points
from tests.figures import from_rest
from validation.studies.equilibria import portrait


@pytest.mark.parametrize(
    ("K3", "lines"),
    [
        (0.0, {"saddle", "Σ_s, attracts", "Σ_u, repels"}),
        (0.3, {"saddle", "stable manifolds of the saddles", "slow stable focus"}),
        (3.0, {"unstable limit cycle"}),
    ],
)
def test_the_picture_has_points_manifolds_circle_and_cycles_in_its_legend(
    K3: float, lines: set[str]
) -> None:
    ball = from_rest(K3)
    points, cycles = fixed_points(ball), limit_cycles(ball) if K3 == 3 else []
    figure = portrait("Fig. 6", ball, points, fixed_circle(ball), cycles)
    (legend,) = figure.legends
    shown = [text.get_text() for text in legend.get_texts()]
    assert lines <= {*shown}
    assert len(shown) == len({*shown})
    names = [text.get_text().strip() for text in figure.axes[1].texts]
    assert len([name for name in names if name]) == len(points)
