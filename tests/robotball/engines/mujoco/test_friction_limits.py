"""Friction: what a ball needs in order not to slip, and what slips or is lost without it."""

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

import robotball as rb
from robotball.engines.mujoco import limits as contact_limits
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.planned_run import LimitCheck, PlannedRun
from robotball.engines.mujoco.settings import Chosen, Radii, settings_from
from tests.robotball.engines.mujoco.limits import FAST, FIG12, REGULAR, error, run, the_limit
from validation.studies.extreme_maps import scaled


@pytest.mark.parametrize(
    ("scene", "predict", "field"),
    [
        (FIG12, contact_limits.sliding_friction, "sliding_friction"),
        (REGULAR, contact_limits.sliding_friction, "sliding_friction"),
        (FIG12, contact_limits.torsional_friction, "torsional_friction"),
    ],
)
def test_the_friction_demand_at_the_start_is_the_mechanics(
    scene: rb.Scene, predict: Callable[[PlannedRun], LimitCheck | None], field: str
) -> None:
    """3 % above the demand nothing slips in the first 10 ms; 3 % below the cone is saturated."""
    demand = the_limit(predict, scene, FAST, 1.0).limit
    for factor in (0.97, 1.03):
        friction: dict[str, Any] = {field: factor * demand}
        settings = replace(FAST, timestep=2e-3, **friction)
        assert the_limit(predict, scene, settings, 1.0).exceeded == (factor < 1)
        faults = [fault.text for fault in run(scene, settings, 0.01).faults]
        assert ("friction cone saturated" in faults) == (factor < 1)


@pytest.mark.parametrize("length", [0.01, 1.0, 100.0])
def test_the_recipe_has_friction_for_a_ball_of_any_size(length: float) -> None:
    """The same motion, rates and times held: λ₀/N goes with the radius, and so does the friction.

    The smallest room that the recipe leaves is the same to rounding at any size.
    """
    scene = scaled(FIG12, mass=1.0, length=length)
    agreement = run(scene, FAST, 2.0)
    assert agreement.agrees  # at 100 m the cone was saturated while the friction was 20 m
    # Measured 2.1e-7: RK4's error.
    assert error(agreement) == pytest.approx(error(run(FIG12, FAST, 2.0)), rel=1e-3)
    limit = the_limit(contact_limits.torsional_friction, scene, FAST, 2.0)
    assert limit.value == 20.0 * length * FIG12.ball.radius
    here = the_limit(contact_limits.torsional_friction, FIG12, FAST, 2.0)
    assert limit.nearness == pytest.approx(here.nearness, rel=1e-12)
    friction = build(scene, FAST).compiled.pair_friction[0]
    assert friction[:3].tolist() == [20.0, 20.0, limit.value]


def test_friction_in_radii_comes_back_from_plain_data() -> None:
    """Radii are told from metres in a record, and checked as they are."""
    whole = Chosen(FIG12, FAST).settings
    assert whole.plain()["torsional_friction"] == {"radii": 20.0}
    for settings in (FAST, whole):
        assert settings_from(json.loads(json.dumps(settings.plain()))) == settings
    assert replace(FAST, torsional_friction=0.3).torsional_friction_of(100.0) == 0.3
    with pytest.raises(rb.InputError, match=r"radii must be finite and not neg.*, not -1\.0"):
        replace(FAST, torsional_friction=Radii(-1.0))


def test_rubber_without_its_torsional_row_is_another_ball() -> None:
    """Condim 3 lets the ball spin: off by most of its path, and the monitor sees the spin."""
    settings = replace(FAST, condim=3)
    assert the_limit(contact_limits.contact_dimension, FIG12, settings, 2.0).exceeded
    agreement = run(FIG12, settings, 2.0)
    assert error(agreement) > 0.3  # measured 0.79
    assert agreement.faults[0].text == "slipped over 0.0005 of the path"


@pytest.mark.slow
@pytest.mark.parametrize("friction", [1e-5, 1e-3])
def test_rolling_friction_eats_the_path_as_predicted(friction: float) -> None:
    """With condim 6, μ m g T/|M| of it; measured 1.2 and 1.9 times that in the path."""
    settings = replace(FAST, condim=6, rolling_friction=friction)
    limit = the_limit(contact_limits.drag, FIG12, settings, 2.0)
    assert limit.exceeded == (friction > 1e-4)
    assert 0.5 < error(run(FIG12, settings, 2.0)) / limit.value < 4


@pytest.mark.parametrize("damping", [50.0, 300.0])
def test_the_frame_as_root_slips_as_predicted(damping: float) -> None:
    """|a (ω×Ω)×γ|/(b v); measured 0.75 of it on fig12, 3.4 on classical_regular."""
    settings = replace(FAST, root="frame", timestep=5e-3, solreffriction=(-1.0, -damping))
    for scene, ratio in ((FIG12, 0.75), (REGULAR, 3.4)):
        limit = the_limit(contact_limits.frame_as_root, scene, settings, 2.0)
        agreement = run(scene, settings, 2.0)
        slipped = agreement.report.slip.mean() * 2.0 / agreement.theory.path_length
        assert limit.exceeded
        assert 0.7 < slipped / limit.value / ratio < 1.4


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
@pytest.mark.parametrize("impedance", [0.99, 0.9999])
def test_soft_friction_creeps_as_predicted(cone: str, impedance: float) -> None:
    """(1 - d)/d of the load, times μ² in a pyramidal cone; measured 0.84 to 0.99 of it."""
    settings = replace(
        FAST, timestep=2e-3, cone=cone, noslip_iterations=0, solver="Newton", iterations=50,
        solreffriction=None, solimp=(impedance, impedance, 0.001, 0.5, 1.0),
    )  # fmt: skip
    limit = the_limit(contact_limits.creep, FIG12, settings, 1.0)
    agreement = run(FIG12, settings, 1.0)
    slipped = agreement.report.slip.mean() / agreement.theory.path_length
    assert 0.75 < slipped / limit.value < 1.1
