"""Chaos is told apart from error: by the engine's defects and by what the motion makes of them."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.mujoco_engine import MUJOCO
from tests.motions import as_contact
from tests.robots import worked
from validation import Agreement, compare
from validation.results import record
from validation.sensitivity import Sensitivity, _transfer, sensitivity

# Its tolerance is so wide that nothing stops it.
EULER = replace(rb.preset("balanced"), name="Euler", integrator="Euler", error_tolerance=2.0)


@cache
def agreement_of(name: str, settings: rb.Settings | str, seconds: float) -> Agreement:
    return compare(rb.load_scene(name), settings, rb.sample_times(seconds))


def measured(agreement: Agreement) -> Sensitivity:
    found = sensitivity(MUJOCO, agreement.motion, agreement.theory)
    assert found is not None
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "preset", "seconds", "exponent", "until"),
    [
        ("fig14", "accurate", 170.0, 0.099, 95.8),
        ("fig14", "fast", 100.0, 0.094, 70.6),
        ("classical_chaotic", "balanced", 60.0, 0.384, 38.0),
    ],
)
def test_a_chaotic_motion_is_called_sensitive(
    name: str, preset: str, seconds: float, exponent: float, until: float
) -> None:
    """The engine keeps its tolerance stretch by stretch, and the motion carries it away.

    It does not agree for that. The exponents are those of half of one motion; over long times they
    are 0.116/s and 0.34/s.
    """
    agreement = agreement_of(name, preset, seconds)
    assert not agreement.agrees
    assert agreement.sensitive
    found = agreement.sensitivity
    assert found is not None
    assert found.defect < agreement.settings.error_tolerance / 100
    assert found.exponent == pytest.approx(exponent, abs=0.005)
    assert found.agrees_until == pytest.approx(until, abs=1.0)
    assert agreement.verdict.startswith(f"sensitive: agrees until t = {found.agrees_until:.3g} s")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "preset", "seconds", "ratio"),
    [
        ("fig14", "accurate", 80.0, 1.04),
        ("fig12", "fast", 200.0, 1.04),
        ("fig12", EULER, 10.0, 1.04),
    ],
)
def test_defects_and_growth_make_the_error(
    name: str, preset: rb.Settings | str, seconds: float, ratio: float
) -> None:
    """Carried on by the equations, the defects add up to the error that was measured.

    To first order, in chaotic and regular motions, of a good integrator and of a bad one.
    """
    found = measured(agreement_of(name, preset, seconds))
    assert found.measured / found.expected == pytest.approx(ratio, abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seconds"), [("fig12", 10.0), ("fig14", 100.0)])
def test_a_bad_integrator_is_not_excused_by_chaos(name: str, seconds: float) -> None:
    """Euler at 5 ms misses 0.7 % and 1.2 % of the path in single stretches: an error, not chaos."""
    tolerance = rb.preset("balanced").error_tolerance
    found = replace(measured(agreement_of(name, EULER, seconds)), tolerance=tolerance)
    assert found.defect > 1000 * tolerance
    assert not found.explains
    stopped = agreement_of(name, replace(EULER, error_tolerance=tolerance), seconds)
    assert stopped.faults
    assert not stopped.sensitive


@pytest.mark.slow
def test_a_regular_motion_is_never_called_sensitive() -> None:
    """Its differences do not grow exponentially: twice the time makes 1.12 of them, not 4420."""
    strict = replace(rb.preset("fast"), error_tolerance=2e-6)
    agreement = agreement_of("fig12", "fast", 200.0)
    report = replace(agreement.report, settings=strict)
    found = measured(replace(agreement, motion=replace(agreement.motion, report=report)))
    assert found.defect < strict.error_tolerance < found.measured
    assert found.doubling == pytest.approx(1.12, abs=0.05)
    assert not found.explains


@pytest.mark.slow
def test_an_error_beyond_the_expected_one_stays_the_engines() -> None:
    """What defects and growth do not account for is not put down to chaos."""
    found = agreement_of("fig14", "fast", 100.0).sensitivity
    assert found is not None
    assert found.explains
    assert not replace(found, measured=100 * found.expected).explains
    assert not replace(found, defect=2 * found.tolerance).explains


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1.0])
def test_an_error_about_the_vertical_turns_the_motion(size: float) -> None:
    """A turn about γ stays one, M turns with it, and the path's end lies beside by turn times way.

    Measured 8.1e-7 of the turn: the second order of the 1e-6 rad that every error is scaled to.
    """
    right = rb.integrate(rb.load_scene("fig12"), np.array([0.0, 1.0, 2.0]))
    up, scale = np.array([0.0, 0.0, 1.0]), right.scene.momentum_scale
    turned = [size * np.cross(up, M) / scale for M in right.momentum]
    way = right.contact_point[2] - right.contact_point[1]
    error = np.concatenate([size * right.gamma[1], turned[1], [0.0, 0.0]])
    expected = np.concatenate(
        [size * right.gamma[2], turned[2], size * np.array([-way[1], way[0]])]
    )
    assert np.abs(_transfer(right, 1, error) - expected).max() < 2e-6 * size


def test_a_lost_momentum_is_no_sensitivity() -> None:
    """M is constant however chaotic the motion: an error beyond the tolerance is the engine's."""
    agreement = agreement_of("fig14", "fast", 100.0)
    momentum = agreement.motion.momentum * np.linspace(1, 1 + 1e-3, 5001)[:, None]
    lost = replace(agreement, motion=replace(agreement.motion, momentum=momentum))
    assert lost.sensitivity is None
    assert lost.verdict == "off by more than 0.0005"


def test_it_is_not_known_where_the_drives_change() -> None:
    """An engine can start anew anywhere only where the rates are constant."""
    agreement = compare(rb.load_scene("wobbling_drive"), "fast", np.array([0.0, 1.0]))
    assert sensitivity(MUJOCO, agreement.motion, agreement.theory) is None


@pytest.mark.slow
def test_records_carry_the_sensitivity() -> None:
    """In the JSON it is an object where it was asked, and null where the engines agree."""
    found = json.loads(json.dumps(record(agreement_of("fig14", "fast", 100.0)), allow_nan=False))
    assert found["sensitivity"]["explains"] is True
    assert found["sensitivity"]["agrees_until"] == pytest.approx(70.6, abs=1.0)
    assert found["agrees"] is False
    assert record(agreement_of("fig12", "fast", 200.0))["sensitivity"] is None


def test_a_ball_that_stays_in_place_has_a_path_error() -> None:
    """With no path to measure by, errors are in radii."""
    scene = rb.load_scene("fig12")
    theory = rb.integrate(scene, np.array([0.0, 1.0]))
    still = replace(theory, contact_point=np.zeros((2, 2)))
    report = rb.simulate(scene, theory.times, "fast").report
    off = as_contact(still, report, contact_point=np.array([[0.0, 0.0], [0.0, 3e-6]]))
    agreement = Agreement(still, off)
    assert agreement.path_error == pytest.approx(3e-6 / scene.ball.radius)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "share"), [("W1", 1.32), ("W5", 1.27)])
def test_defects_make_the_error_of_any_robot(name: str, share: float) -> None:
    """Off balance, with free hinges: the error is what the motion makes of the engine's defects."""
    found = measured(compare(replace(worked(name), duration=20.0), "fast"))
    assert found.measured / found.expected == pytest.approx(share, rel=0.5)
    assert found.doubling < 10
