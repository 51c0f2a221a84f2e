"""A regression test of a robot of one's own: copy it, and change the file and the numbers.

pytest examples/test_my_robot.py
"""

from pathlib import Path

import pytest

import robotball as rb

ROBOT = Path(__file__).parent / "my_robot.toml"
SETTINGS = rb.preset("balanced")


def test_the_engine_rolls_my_robot_as_the_equations_do() -> None:
    """No fault, and a path error below 5e-9; measured 1.5e-9."""
    agreement = rb.assert_agrees(ROBOT, 2.0, settings=SETTINGS)
    assert agreement.path_error < 5e-9


def test_my_robot_rolls_where_it_did_last_time() -> None:
    """After two seconds [m], with a friction of 0.09; the floor gives 0.6."""
    theory = rb.integrate(ROBOT, 2.0)
    assert theory.contact_point[-1] == pytest.approx((0.276348, 0.027102), abs=1e-6)
    assert float(theory.loads.sliding_friction.max()) < 0.6
