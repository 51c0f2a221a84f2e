"""A ball that starts just touching falls and slips as predicted; one in equilibrium rolls right."""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco import limits as contact_limits
from robotball.engines.mujoco.limits import planned
from tests.robotball.engines.mujoco.limits import FAST, FIG12, error, run, the_limit
from validation import compare


def test_a_ball_that_starts_just_touching_falls_as_deep_as_predicted() -> None:
    """p = g (1 - d)/(d² k), measured to rounding of its last vibrations."""
    settings = replace(
        FAST, timestep=2e-3, start_in_equilibrium=False, solref=(0.1, 1.0),
        solimp=(0.9, 0.9, 0.001, 0.5, 1.0),
    )  # fmt: skip
    depth = run(FIG12, settings, 2.0).report.depth[-1]
    plan = planned(FIG12, settings, 2.0)
    assert depth == pytest.approx(plan.equilibrium_depth, rel=1e-3)
    soft = replace(settings, solref=(1.0, 1.0))
    assert the_limit(contact_limits.start_depth, FIG12, soft, 2.0).exceeded


@pytest.mark.parametrize("name", ["fig12", "classical_regular", "fig14"])
def test_a_start_just_touching_slips_from_its_first_step_on(name: str) -> None:
    """By about half of what the contact point's free acceleration makes of it."""
    scene, dt = rb.load_scene(name), 5e-3
    settings = replace(
        rb.preset("balanced"), timestep=dt, start_in_equilibrium=False, stop_at_fault=False
    )
    limit = the_limit(contact_limits.first_step, scene, settings, dt)
    slip = compare(scene, settings, np.array([0.0, dt])).report.slip[-1]
    speed = scene.momentum_scale * scene.ball.radius / scene.ball.d
    assert 0.35 < slip / (limit.value * speed) < 0.6  # measured 0.38 to 0.55
    assert limit.exceeded


def test_a_start_in_equilibrium_holds_at_any_gravity() -> None:
    """The margin's depth has no end of its own: the path is right at 1e-3 and 1e9 of gravity."""
    for gravity in (1e-3, 1e9):
        scene = replace(FIG12, gravity=9.81 * gravity)
        settings = replace(FAST, sliding_friction=1e4, torsional_friction=1e4)
        assert error(run(scene, settings, 2.0)) < 7e-7  # measured 2.2e-7, RK4's
