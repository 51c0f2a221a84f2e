"""What MuJoCo's solvers and numbers cannot take is predicted: contact or friction is lost there."""

from dataclasses import replace

import pytest

import robotball as rb
from robotball.engines.mujoco import limits as contact_limits
from robotball.engines.mujoco.limits import planned
from tests.robotball.engines.mujoco.limits import FAST, FIG12, REGULAR, error, run, the_limit
from validation.studies.random_runs import rescaled


@pytest.mark.parametrize(
    ("scene", "inside", "outside"), [(FIG12, 1e6, 3e6), (REGULAR, 1e8, 2e8)], ids=lambda v: str(v)
)
def test_a_heavy_ball_loses_the_noslip_solver(
    scene: rb.Scene, inside: float, outside: float
) -> None:
    """det(D A D) = 1e-10 is where it stops, in silence: 4.5e-7 off before, all of it after."""
    for mass in (inside, outside):
        heavy = rescaled(scene, mass=mass)
        assert the_limit(contact_limits.friction_block, heavy, FAST, 1.0).exceeded == (
            mass == outside
        )
        agreement = run(heavy, FAST, 1.0)
        if mass == inside:
            assert error(agreement) < 2e-6  # measured 1.6e-7 and 4.5e-7
        else:
            assert error(agreement) > 0.2  # measured 1.1 and 0.35
            assert agreement.faults[0].text == "slipped over 0.0005 of the path"


# Without noslip; the mass of fig12 [kg] at which the block of PGS is predicted to be 1e-10.
PGS = replace(FAST, noslip_iterations=0)
SLIPPERY = replace(PGS, sliding_friction=1.4, torsional_friction=1.4)
ROLLING = replace(PGS, condim=6)
HARDER = replace(ROLLING, solimp=(1 - 1e-9, 1 - 1e-9, 0.001, 0.5, 1.0))


@pytest.mark.parametrize(
    ("settings", "mass"),
    [(PGS, 2.05e6), (SLIPPERY, 1.005e4), (ROLLING, 4.0e8), (HARDER, 4.0e8)],
    ids=["friction 20", "friction 1.4", "condim 6", "condim 6, impedance above .9999"],
)
def test_a_heavy_ball_loses_all_friction_of_pgs(settings: rb.Settings, mass: float) -> None:
    """At the predicted mass, to 5 %: then the ball goes straight on. Newton rolls it all the same.

    condim 6 has Cholesky's pivots instead of the determinant, which the rows' softness holds up:
    MuJoCo takes no impedance above .9999.
    """
    for of_it, slides in ((0.95, False), (1.05, True)):
        heavy = rescaled(FIG12, mass=of_it * mass / FIG12.ball.mass)
        limit = the_limit(contact_limits.friction_block, heavy, settings, 1.0)
        assert limit.exceeded == slides
        assert (run(heavy, settings, 1.0).report.slip.max() > 9.0) == slides  # 9.3, else < 1.2
        newton = replace(settings, solver="Newton", iterations=50)
        assert contact_limits.friction_block(planned(heavy, newton, 1.0)) is None
        assert run(heavy, newton, 1.0).report.slip.max() < 1.2
    assert "MuJoCo's PGS solver takes it for singular" in str(limit)
    assert "must be at least 1e-10" in str(limit)


@pytest.mark.parametrize(
    ("solver", "fails", "works"), [("Newton", 1e-8, 1e-10), ("CG", 1e-10, 1e-13)]
)
def test_a_tolerance_stops_the_solver_before_it_begins(
    solver: str, fails: float, works: float
) -> None:
    """Beside armatures of 1e14 a tolerance of MuJoCo's own size leaves the ball without contact."""
    for tolerance in (fails, works):
        settings = replace(
            FAST, solver=solver, iterations=50, tolerance=tolerance, start_in_equilibrium=False
        )
        limit = the_limit(contact_limits.solver_tolerance, FIG12, settings, 1.0)
        assert limit.exceeded == (tolerance == fails)
        causes = [fault.text for fault in run(FIG12, settings, 1.0).faults]
        assert ("contact lost" in causes) == (tolerance == fails)
    assert (
        contact_limits.solver_tolerance(planned(FIG12, replace(FAST, tolerance=1e-8), 1.0)) is None
    )  # PGS


def test_numbers_beyond_mujocos_largest_are_told() -> None:
    """A ball of 1e9 m rolls beyond 1e10 m within seconds."""
    assert the_limit(
        contact_limits.largest_number, rescaled(FIG12, length=1e9), FAST, 10.0
    ).exceeded
    assert not the_limit(contact_limits.largest_number, FIG12, FAST, 10.0).exceeded
