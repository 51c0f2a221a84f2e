"""A regression test of a robot of one's own: copy it, and change the file and the numbers.

pytest examples/test_my_robot.py
"""

from pathlib import Path

import numpy as np
import pytest

import robotball as rb

ROBOT = Path(__file__).parent / "my_robot.toml"
SETTINGS = rb.preset("balanced")
DURATION = 2.0  # s


@pytest.fixture(scope="module")
def theory() -> rb.Motion:
    return rb.integrate(ROBOT, DURATION)


def test_the_engine_rolls_my_robot_as_the_equations_do(theory: rb.Motion) -> None:
    """No fault, and the path right to 5e-9; measured 1.5e-9."""
    agreement = rb.assert_agrees(ROBOT, settings=SETTINGS, theory=theory)
    assert agreement.path_error < 5e-9


def test_my_robot_needs_no_more_friction_than_its_floor_gives(theory: rb.Motion) -> None:
    """The floor gives 0.6; measured 0.09."""
    assert float(np.max(theory.loads.sliding_friction)) < 0.6


def test_my_robot_rolls_where_it_did_last_time(theory: rb.Motion) -> None:
    """Where the contact point is after two seconds [m]."""
    end = (0.276348, 0.027102)
    assert theory.contact_point[-1] == pytest.approx(end, abs=1e-6)
