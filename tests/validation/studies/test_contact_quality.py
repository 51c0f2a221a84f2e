"""Contact quality: the energy equals the work of the motors, and a bad contact shows."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

import robotball as rb
from robotball.motion import ContactMotion
from tests.robotball.engines.test_adapters import ADAPTERS, skip_unless_there
from validation.studies.engine_runs import contact_quality, kinetic_energy, run, slip_quality

TIMES = rb.sample_times(2.0, 1e-3)
SLIDING = Path(__file__).parents[3] / "docs/coulomb/sliding_sphere.toml"


@pytest.mark.parametrize(
    ("name", "measured"),
    [("fig12", 7.7e-10), ("classical_regular", 4.1e-10), ("wobbling_drive", 3.6e-9)],
)
def test_the_kinetic_energy_equals_the_work_of_the_motors(name: str, measured: float) -> None:
    """It holds for the equations' motion [J], and not with 1.01 M."""
    theory = rb.integrate(rb.load_scene(name), TIMES)
    work = cumulative_simpson(theory.motor_powers.sum(axis=1), x=TIMES, initial=0)

    def off(motion: rb.Motion) -> tuple[float, float]:
        energy, slip = kinetic_energy(motion, 0.0 * TIMES)
        return float(np.abs(energy - energy[0] - work).max()), float(np.abs(slip).max())

    error, slip = off(theory)
    assert error < 3 * measured
    assert slip < 2e-14  # measured 5.4e-15 m/s
    error, slip = off(replace(theory, momentum=1.01 * theory.momentum))
    assert error > 0.01
    assert slip > 0.01


@cache
def quality(preset: str) -> tuple[rb.Motion, ContactMotion, dict[str, float | None]]:
    theory = rb.integrate(rb.load_scene("fig12"), rb.sample_times(2.0))
    settings = replace(rb.PRESETS[preset], stop_at_fault=False)
    motion = rb.simulate(theory.scene, theory.times, settings=settings)
    return theory, motion, contact_quality(motion, theory)


def test_the_recipes_contact_is_good() -> None:
    """Forces are right to rounding and energy to 1.2e-10. A planted force is found."""
    theory, motion, contact = quality("balanced")
    assert abs(contact["normal_force_error"] or 0.0) < 1e-14  # measured 1.2e-15
    assert contact["cone_violation"] == 0.0
    assert abs(contact["slip_work"] or 1.0) < 1e-10  # measured 2.1e-11
    assert abs(contact["energy_error"] or 1.0) < 5e-10  # measured 1.2e-10
    loads = replace(motion.loads, contact_force=1.5 * motion.loads.contact_force)
    used = motion.report.friction_used
    report = replace(motion.report, friction_used=used * (1.25 / used.max()))
    planted = contact_quality(replace(motion, loads=loads, report=report), theory)
    assert planted["normal_force_error"] == pytest.approx(0.5, rel=1e-9)
    assert planted["cone_violation"] == pytest.approx(0.25, rel=1e-9)
    assert planted["slip_work"] == pytest.approx(1.5 * (contact["slip_work"] or 0.0), rel=1e-9)


@pytest.mark.filterwarnings("ignore::robotball.SceneWarning")
def test_the_naive_contact_is_bad() -> None:
    """The ball is thrown up, and friction takes energy."""
    _, _, contact = quality("naive")
    bounds = {"normal_force_error": 1.0, "slip_work": 0.01, "energy_error": 0.01}
    # Measured 7.0, 0.016 and -0.028.
    assert {
        name: abs(contact[name] or 0.0) > least for name, least in bounds.items()
    } == dict.fromkeys(bounds, True)


def test_unknown_residuals_are_none() -> None:
    """Examples: an engine without forces, and the energies of an unbalanced ball."""
    theory, motion, _ = quality("balanced")
    loads: Any = motion.loads.unknown(len(motion.times), 2)
    report = replace(motion.report, friction_used=np.full(len(motion.times), np.nan))
    contact = contact_quality(replace(motion, loads=loads, report=report), theory)
    assert [name for name, value in contact.items() if value is not None] == ["energy_error"]
    beaver = rb.integrate(rb.load_scene("beaver_ball"), rb.sample_times(0.1))
    contact = contact_quality(rb.simulate(beaver.scene, beaver.times), beaver)
    assert [name for name, value in contact.items() if value is None] == [
        "slip_work",
        "energy_error",
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "preset", "timestep", "measured"),
    [
        ("newton", "best", 20e-3, 3.0e-7),  # single precision
        ("pinocchio", "contact", 1e-3, 2.0e-3),
        ("exudyn", "contact", 5e-3, 5.7e-3),  # its force oscillates from step to step
        ("genesis", "best", 1e-3, 7.1e-3),
        ("rapier", "best", 1e-3, 2.2e-2),
        ("physx", "best", 1e-3, 1.0e-4),
    ],
)
def test_an_engine_reports_its_contact_force(
    name: str, preset: str, timestep: float, measured: float
) -> None:
    """The normal force equals the weight, and friction is inside its cone."""
    engine = ADAPTERS[name]
    skip_unless_there(name)
    theory = rb.integrate(rb.load_scene("fig12"), rb.sample_times(0.3))
    settings = replace(engine.presets[preset], timestep=timestep, stop_at_fault=False)
    motion = rb.simulate(theory.scene, theory.times, settings=settings, engine=engine)
    contact = contact_quality(motion, theory)
    assert abs(contact["normal_force_error"] or 1.0) < 3 * measured
    assert abs(1.0 if contact["cone_violation"] is None else contact["cone_violation"]) < 1e-9


def slip_of_run(preset: str) -> dict[str, Any]:
    """Return the record of MuJoCo's run of a sliding sphere in steps of 1 ms."""
    cell = {"scene": str(SLIDING), "duration": 1.0, "engine": "mujoco", "preset": preset}
    return run({**cell, "field": "timestep", "value": 1e-3, "rounds": 1, "stretches": False})


def test_a_pyramid_pulls_a_sliding_ball_askew_and_the_recipe_does_not() -> None:
    """Of an exact case: a solid sphere whose slip has a constant direction and ends at 0.175 s."""
    naive, recipe = slip_of_run("naive"), slip_of_run("balanced")
    page = (SLIDING.parents[1] / "coulomb.md").read_text()
    for name, printed in (("default", naive), ("*balanced*", recipe)):
        late, askew, hop = (
            "0" if abs(value) < 0.01 else f"{value:.2g}"
            for value in (100 * printed["late"], printed["askew"], 1e3 * printed["hop"])
        )
        force = f"{printed['most_force']:.3g}"
        row = (
            f"| MuJoCo, {name} | {printed['path_error']:.1e} | {late} | {askew} | {force} | {hop} |"
        )
        assert row in page
    assert naive["late"] == pytest.approx(0.389, abs=0.02)  # √2 - 1 but for the hops
    assert naive["askew"] == pytest.approx(10.0, abs=0.3)
    assert naive["most_force"] == pytest.approx(4.5, abs=0.2)
    assert naive["hop"] == pytest.approx(1.33e-4, rel=0.1)
    assert abs(recipe["late"]) < 3e-6  # measured 1.4e-6, the error of the step
    assert recipe["askew"] < 2e-4  # measured 7.3e-5
    assert recipe["most_force"] == pytest.approx(1.0, abs=1e-4)  # measured 1.00005
    assert recipe["hop"] == 0.0


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_the_end_of_a_slip_is_found_between_samples(factor: float) -> None:
    """With the friction of another ball the slip ends at 0.175 s over the factor."""
    scene = rb.load_scene(SLIDING)
    limits = replace(scene.friction, sliding=0.3 * factor)
    times = rb.sample_times(0.4, 5e-3)
    theory, other = (rb.integrate(s, times) for s in (scene, replace(scene, friction=limits)))
    motion = rb.simulate(other.scene, times)
    late = slip_quality(motion, theory)["late"]
    assert late == pytest.approx(1 / factor - 1, abs=1e-3)  # measured 3e-5
