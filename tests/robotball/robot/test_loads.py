"""Quantities derived from loads; test_catalog.py compares the loads with MuJoCo."""

import numpy as np

from robotball.robot.loads import Loads


def test_friction_needed_is_a_load_over_the_normal_force() -> None:
    """It is zero if the normal force is not positive."""
    force = np.array([[3.0, 4.0, 10.0], [3.0, 4.0, 0.0], [1.0, 0.0, -2.0]])
    loads = Loads(force, np.array([-2.0, 1.0, 1.0]), np.zeros((3, 1)))
    assert loads.sliding_friction.tolist() == [0.5, 0.0, 0.0]
    assert loads.torsional_friction.tolist() == [0.2, 0.0, 0.0]
