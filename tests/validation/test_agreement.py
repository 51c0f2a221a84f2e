"""Measures of agreement are right, and a faulty run never agrees."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.motion import versions
from robotball.robot.variations import scaled
from robotball.rotations import multiply
from robotball.view.notebook import cell
from tests.messages import naming, unnamed
from tests.motions import as_contact
from validation import Agreement, compare
from validation.results import record

pytestmark = pytest.mark.core

ERRORS = ("path_error", "attitude_error", "gamma_error", "momentum_error")

SCENE = rb.load_scene("fig12")
THEORY = rb.integrate(SCENE)
SOUND = rb.simulate(SCENE, settings="balanced").report


def agreement_with(**changes: Any) -> Agreement:
    """Compare the equations' motion with itself after changing some fields."""
    return Agreement(THEORY, as_contact(THEORY, **{"report": SOUND, **changes}))


def test_a_motion_agrees_with_itself_exactly() -> None:
    """All errors are 0, and M is constant to rounding.

    A rotation of 1e-6 rad about X is an attitude error of 1e-6 rad, to 2.3e-16.
    """
    agreement = agreement_with()
    assert (agreement.path_error, agreement.attitude_error, agreement.gamma_error) == (0, 0, 0)
    assert agreement.momentum_error < 5e-15  # measured 1.4e-15: rounding of two changes of axes
    assert unnamed("agrees reference", agreement.verdict) == []
    assert agreement.realtime_factor == pytest.approx(SCENE.duration / SOUND.seconds)
    turn = np.array([np.cos(5e-7), np.sin(5e-7), 0.0, 0.0])
    agreement = agreement_with(attitude=multiply(turn, THEORY.attitude))
    assert agreement.gamma_error == pytest.approx(1e-6, abs=3e-15)
    assert agreement.attitude_error == pytest.approx(1e-6, abs=3e-15)


def test_a_record_has_the_versions_where_the_engine_ran_and_where_the_equations_did() -> None:
    elsewhere = {"python": "3.9.9", "mujoco": "3.1.0"}
    agreement = agreement_with(report=replace(SOUND, versions=elsewhere))
    found, engine = record(agreement), agreement.motion.engine
    assert found["versions"] == {**elsewhere, engine.name: engine.version}
    assert found["reference_versions"] == versions()


def test_a_ball_that_stays_in_place_has_a_path_error() -> None:
    """Without a path, errors are relative to the radius."""
    still = replace(THEORY, contact_point=np.zeros((501, 2)))
    off = as_contact(still, SOUND, contact_point=np.array([[0.0, 0.0]] * 500 + [[0.0, 3e-6]]))
    assert Agreement(still, off).path_error == pytest.approx(3e-6 / SCENE.ball.radius)


@pytest.mark.parametrize("name", ["spin_up_from_rest", "fig06"])
def test_the_verdict_does_not_depend_on_the_unit_of_mass(name: str) -> None:
    """Errors are the same in grams and kilograms, even if M = 0."""
    scene, times = rb.load_scene(name), np.linspace(0.0, 1.0, 51)
    of_kilograms, of_grams = (
        compare(scaled(scene, mass=mass, length=1.0), times, settings="accurate")
        for mass in (1.0, 1e3)
    )
    assert of_kilograms.agrees
    assert of_grams.agrees
    # The ratio is 1 within 0.03 of the error; with changing drives the error is rounding.
    assert of_grams.momentum_error == pytest.approx(of_kilograms.momentum_error, rel=0.2)


def test_agreement_needs_the_momentum_as_well_as_the_path() -> None:
    """Errors can cancel in the path, so M counts, unless a path accuracy was requested."""
    momentum = THEORY.momentum * np.linspace(1, 1 + 1e-5, 501)[:, None]
    agreement = agreement_with(momentum=momentum)
    assert agreement.path_error == 0
    assert not agreement.agrees
    assert unnamed("off 5e-06", agreement.verdict) == []
    requested = replace(SOUND, settings=replace(SOUND.settings, accuracy=1e-9))
    assert agreement_with(momentum=momentum, report=requested).agrees
    off = THEORY.contact_point + 2e-9 * THEORY.path_scale
    strict = agreement_with(contact_point=off, report=requested)
    assert unnamed("off 1e-09", strict.verdict) == []


def test_an_agreement_limited_by_the_reference_says_so() -> None:
    """A path error below three times the reference error may be the reference's error."""
    theory = rb.integrate(SCENE, rtol=1e-9)
    reference_error = theory.reference_error
    assert 6e-10 < reference_error < 3e-9  # measured 1.2e-9
    for error, verdict in ((2.9, "agrees, limited by the reference"), (3.1, "agrees")):
        contact_point = theory.contact_point.copy()
        contact_point[100, 0] += error * reference_error * theory.path_scale
        motion = as_contact(theory, SOUND, contact_point=contact_point)
        agreement = Agreement(theory, motion)
        assert agreement.reference_error == reference_error
        assert agreement.verdict == verdict
        assert agreement.agrees
    assert Agreement(motion, motion).reference_error is None  # this reference has no estimate


def test_a_faulty_run_never_agrees() -> None:
    """The verdict of a faulty run has the time and the cause."""
    faulty = replace(SOUND, faults=(rb.Fault(rb.FaultKind.CONTACT_LOST, 1.25),))
    agreement = agreement_with(report=faulty)
    assert agreement.path_error == 0
    assert not agreement.agrees
    assert agreement.verdict == "contact lost at t = 1.25 s"
    half = replace(
        THEORY,
        **{name: getattr(THEORY, name)[:9] for name in ("times", "momentum", "contact_point")},
    )
    broken_off = Agreement(THEORY, as_contact(half, faulty))
    assert not broken_off.finished
    errors = [getattr(broken_off, name) for name in ERRORS]
    assert np.isnan(errors).all()
    assert not broken_off.path_error <= np.inf  # so no tolerance is met
    assert broken_off.verdict == "contact lost at t = 1.25 s"
    assert broken_off.path_errors.shape == (9,)
    assert [record(broken_off)[name] for name in ERRORS] == [None] * 4
    assert "path error -" in repr(broken_off)


def test_engine_and_equations_refuse_times_alike() -> None:
    """Both messages are the same."""
    with pytest.raises(rb.InputError, match=naming("times 0 1")):
        rb.simulate(SCENE, np.array([1.0, 2.0]))
    with pytest.raises(rb.InputError, match=naming("slip")):
        compare(SCENE, settings=replace(rb.preset("fast"), sliding_friction=0.1), strict=True)


def test_the_bound_of_a_drift_of_momentum_grows_with_time() -> None:
    """The monitor and the agreement allow 1e-3 in ten seconds, and 0.6 % in a minute."""
    theory = rb.integrate(SCENE.until(60.0), np.arange(601) / 10)
    report = replace(SOUND, settings=replace(SOUND.settings, error_tolerance=1e-3))
    for drift, kept in ((5.9e-3, True), (6.1e-3, False)):
        momentum = theory.momentum * (1 + drift * theory.times / 60)[:, None]
        motion = as_contact(theory, report, momentum=momentum)
        assert Agreement(theory, motion).keeps_momentum == kept


def test_an_agreement_has_a_line_and_a_picture_and_compares_by_value() -> None:
    """The line has scene, engine, settings and verdict; the picture has both paths."""
    times = rb.sample_times(1.0)
    agreement = compare("fig12", times, settings="fast")
    assert repr(agreement).startswith("<Agreement of fig12 by MuJoCo, fast: agrees; path error ")
    assert "\n" not in repr(agreement)
    assert agreement._repr_html_() == cell(repr(agreement), [agreement.theory, agreement.motion])
    assert compare(SCENE, times, settings="fast", theory=agreement.theory) == agreement
