"""The paper's formulas as they are typed a second time, against the package's own."""

import numpy as np

from robotball.equations import as_vector
from robotball.qualitative.equilibria import fixed_points, flow, rate_scale
from tests.paper import formulas as f
from tests.robotball.qualitative.test_equilibria import random_ball


def test_no_fixed_point_is_missed() -> None:
    """Newton's method from 60 points of the sphere finds no point that is not in the list.

    It solves the paper's formulas as they are typed a second time. Of 12 random balls.
    """
    rng = np.random.default_rng(4)
    numbers = set()
    for _ in range(12):
        some = random_ball(rng, as_vector(0.3 * rng.normal(size=3)))
        known = np.array([point.gamma for point in fixed_points(some)])
        numbers.add(len(known))
        assert max(np.abs(flow(some, as_vector(g))).max() for g in known) < 1e-13 * rate_scale(some)
        for gamma in f.zeros(f.from_rest(f.numbers(some)), 60):
            assert np.linalg.norm(known - gamma, axis=1).min() < 1e-6
    assert numbers == {2, 6, 10}
