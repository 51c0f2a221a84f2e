"""The measures of agreement measure what they say, and a faulty run never agrees."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.rotations import multiply
from tests.motions import as_contact
from validation import Agreement, compare
from validation.studies.extreme_maps import scaled

pytestmark = pytest.mark.core

SCENE = rb.load_scene("fig12")
BALANCED = rb.preset("balanced")
SOUND = rb.simulate(SCENE, settings=BALANCED).report


def agreement_with(**changes: Any) -> Agreement:
    """The equations' motion against itself with some fields changed."""
    theory = rb.integrate(SCENE)
    return Agreement(theory, as_contact(theory, **{"report": SOUND, **changes}))


def test_a_motion_agrees_with_itself_exactly() -> None:
    """No difference is no error; M of the equations is constant to rounding."""
    agreement = agreement_with()
    assert agreement.path_error == 0
    assert agreement.gamma_error == 0
    assert agreement.momentum_error is not None
    assert agreement.momentum_error < 5e-15  # measured 1.4e-15: rounding of two changes of axes
    assert agreement.agrees


def test_path_error_is_the_largest_distance_over_the_paths_length() -> None:
    """A point 3 mm and 4 mm off at one time is 5 mm off, of 37.16 m."""
    contact_point = rb.integrate(SCENE).contact_point.copy()
    contact_point[100] += [0.003, 0.004]
    agreement = agreement_with(contact_point=contact_point)
    assert agreement.path_error == pytest.approx(0.005 / agreement.theory.path_length, rel=1e-9)
    assert agreement.path_errors.argmax() == 100
    assert agreement.theory.path_length == pytest.approx(37.156, abs=1e-3)


def test_gamma_error_is_an_angle() -> None:
    """An attitude turned by 1e-6 rad about X is off by that angle."""
    turn = np.array([np.cos(5e-7), np.sin(5e-7), 0.0, 0.0])
    turned = multiply(turn, rb.integrate(SCENE).attitude)
    # Measured 2.3e-16 rad off: the angle is from a cross product, which loses nothing when small.
    assert agreement_with(attitude=turned).gamma_error == pytest.approx(1e-6, abs=3e-15)


def test_momentum_error_is_relative_to_the_start() -> None:
    """A millionth of |M| is 1e-6."""
    momentum = rb.integrate(SCENE).momentum.copy()
    momentum[-1] *= 1 + 1e-6
    assert agreement_with(momentum=momentum).momentum_error == pytest.approx(1e-6, rel=1e-6)


@pytest.mark.parametrize("name", ["fig12", "spin_up_from_rest", "fig06"])
def test_the_verdict_does_not_depend_on_the_unit_of_mass(name: str) -> None:
    """Grams for kilograms change no error, for a ball with M = 0 as well."""
    scene = rb.load_scene(name)
    times = np.linspace(0.0, 1.0, 51)
    of_kilograms, of_grams = (
        compare(scaled(scene, mass=mass, length=1.0), "accurate", times) for mass in (1.0, 1e3)
    )
    assert of_kilograms.agrees
    assert of_grams.agrees
    assert of_kilograms.momentum_error is not None
    # The ratio is 1 within 0.03 of the error, which is rounding where drives change.
    assert of_grams.momentum_error == pytest.approx(of_kilograms.momentum_error, rel=0.2)


def test_agreement_needs_the_momentum_as_well_as_the_path() -> None:
    """Errors can cancel in the path; an error of M alone is no agreement."""
    momentum = rb.integrate(SCENE).momentum * np.linspace(1, 1 + 1e-5, 501)[:, None]
    agreement = agreement_with(momentum=momentum)
    assert agreement.path_error == 0
    assert not agreement.agrees
    assert agreement.verdict == "off by more than 5e-06"


def test_an_agreement_as_good_as_the_reference_says_so() -> None:
    """A path error below three times the reference's own tells no more of the engine."""
    theory = rb.integrate(SCENE, rtol=1e-9)
    own = theory.reference_error
    assert 6e-10 < own < 3e-9  # measured 1.2e-9
    for error, verdict in ((2.9, "agrees, limited by the reference"), (3.1, "agrees")):
        contact_point = theory.contact_point.copy()
        contact_point[100, 0] += error * own * theory.path_scale
        motion = as_contact(theory, SOUND, contact_point=contact_point)
        agreement = Agreement(theory, motion)
        assert agreement.reference_error == own
        assert agreement.verdict == verdict
        assert agreement.agrees
    assert Agreement(motion, motion).reference_error is None  # of a reference that has none


def test_a_fault_forbids_agreement_whatever_the_numbers() -> None:
    """A run with a fault is no result, and its verdict says the time and the cause."""
    faulty = replace(SOUND, faults=(rb.Fault(rb.FaultKind.CONTACT_LOST, 1.25),))
    agreement = agreement_with(report=faulty)
    assert agreement.path_error == 0
    assert not agreement.agrees
    assert agreement.verdict == "contact lost at t = 1.25 s"


def test_times_that_cannot_be_used_are_refused() -> None:
    """Both engines refuse the same times with the same words."""
    bad = {
        "times must increase: 1 follows 1": [0, 1, 1, 2],
        "times must start at 0, not at 1": [1, 2],
        "times must be finite": [0, np.nan],
        "times must be a list of at least two": [0],
    }
    for words, times in bad.items():
        for engine in (rb.integrate, rb.simulate):
            with pytest.raises(rb.InputError, match=words):
                engine(SCENE, np.array(times))


def test_default_times_end_at_the_duration() -> None:
    """A scene's own times are even and end exactly at its duration, whatever that is."""
    for duration in (10.0, 0.013, 1.0 / 3.0):
        times = rb.sample_times(duration)
        assert times[-1] == duration
        assert max(b - a for a, b in pairwise(times)) <= 0.02 * (1 + 1e-9)
