"""Steps too long for a rotation or for the contact's dampers go wrong just where predicted."""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco import limits as step_limits
from robotball.engines.mujoco.limits import planned
from tests.robotball.engines.mujoco.limits import FAST, FIG12, error, run, the_limit

pytestmark = pytest.mark.core


def test_rk4_cannot_follow_a_rotation_of_over_2_8_rad_a_step() -> None:
    """Rotors at 30 times their rates: right at 0.5 rad a step, bounded at 2.2 and gone at 3.0."""
    fast = replace(FIG12, rotor_rates=(30 * 148.0,))
    rate = planned(fast, FAST, 1.0).rotation_rate
    errors = {}
    for angle in (0.5, 2.2, 3.0):
        step = angle / rate
        settings = replace(FAST, timestep=step, sliding_friction=1e3, torsional_friction=1e3)
        limit = the_limit(step_limits.rotation, fast, settings, 60 * step)
        assert limit.exceeded == (angle == 3.0)
        errors[angle] = error(run(fast, settings, 60 * step))
    assert errors[0.5] < 4e-3  # measured 1.3e-3
    assert 0.1 < errors[2.2] < 0.4  # measured 0.22: M is lost long before the limit
    assert errors[3.0] == np.inf


@pytest.mark.parametrize(
    ("integrator", "inside", "outside"), [("RK4", 2.75, 2.82), ("implicit", 1.95, 2.05)]
)
def test_friction_may_not_be_damped_too_hard(
    integrator: str, inside: float, outside: float
) -> None:
    """Slip dies out below b·dt = 2.785 or 2, and grows above."""
    slips = []
    for product in (inside, outside):
        settings = replace(
            FAST, timestep=5e-3, integrator=integrator, solreffriction=(-1.0, -product / 5e-3)
        )
        limit = the_limit(step_limits.friction_damping, FIG12, settings, 2.0)
        assert limit.exceeded == (product == outside)
        slips.append(run(FIG12, settings, 2.0).report.slip.max())
    # Measured 3.7e-3 and 0.52 m/s under RK4, 1.2e-3 and 10 under implicit.
    assert slips[0] < 6e-3
    assert slips[1] > 0.3


@pytest.mark.parametrize(("integrator", "products"), [("RK4", (2.7, 2.9)), ("Euler", (1.9, 2.1))])
def test_the_contacts_damper_may_not_be_too_stiff(
    integrator: str, products: tuple[float, float]
) -> None:
    """A damper in the direct format, left in the motion that a start just touching wakes."""
    errors = []
    for product in products:
        settings = replace(
            FAST, timestep=5e-3, integrator=integrator, solref=(-100.0, -product / 5e-3),
            start_in_equilibrium=False,
        )  # fmt: skip
        limit = the_limit(step_limits.contact_spring, FIG12, settings, 2.0)
        assert limit.exceeded == (product == products[1])
        errors.append(error(run(FIG12, settings, 2.0)))
    # Measured 0.033 and 0.18 under RK4, 0.068 and 1.2 under Euler.
    assert errors[0] < 0.1
    assert errors[1] > 0.15


def test_a_short_time_constant_is_raised_in_silence() -> None:
    """Below two steps it is as good as two steps, to the last bit; the limit says so."""
    short, raised = (replace(FAST, solref=(constant, 1.0)) for constant in (0.01, 0.04))
    assert the_limit(step_limits.raised_solref, FIG12, short, 1.0).exceeded
    assert not the_limit(step_limits.raised_solref, FIG12, raised, 1.0).exceeded
    paths = [
        rb.simulate(FIG12, np.linspace(0, 1, 11), replace(each, start_in_equilibrium=False))
        for each in (short, raised)
    ]
    assert np.array_equal(paths[0].contact_point, paths[1].contact_point)
