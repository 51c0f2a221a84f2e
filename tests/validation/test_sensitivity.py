"""Chaos is distinguished from errors of the engine by the defects and their growth."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.mujoco_engine import MUJOCO
from tests.robots import worked
from validation import Agreement, compare
from validation.results import record
from validation.sensitivity import Sensitivity, _transfer, chaotic, sensitivity

# A wide tolerance, so that no fault stops the run.
EULER = replace(rb.preset("balanced"), name="Euler", integrator="Euler", error_tolerance=2.0)


CHAOTIC = ("classical_chaotic", "balanced", 45.0)


@cache
def agreement_of(name: str, settings: rb.Settings | str, seconds: float) -> Agreement:
    scene = worked(name) if name.startswith("W") else rb.load_scene(name)
    return compare(scene, rb.sample_times(seconds), settings=settings)


@cache
def measured(name: str, settings: rb.Settings | str, seconds: float) -> Sensitivity:
    agreement = agreement_of(name, settings, seconds)
    estimate = sensitivity(MUJOCO, agreement.motion, agreement.theory)
    assert estimate is not None
    return estimate


def test_a_chaotic_motion_is_called_sensitive() -> None:
    """The engine keeps its tolerance in each stretch, and the motion magnifies the errors.

    The motion still does not agree. The exponent is measured over half of the motion; over long
    times it is 0.34/s. M is constant even in chaos, so an error of M is an error of the engine.
    """
    agreement = agreement_of(*CHAOTIC)
    assert not agreement.agrees
    assert agreement.sensitive
    estimate = agreement.sensitivity
    assert estimate is not None
    assert estimate.defect < agreement.settings.error_tolerance / 100
    assert estimate.exponent == pytest.approx(0.320, abs=0.005)
    assert estimate.agrees_until == pytest.approx(37.6, abs=1.0)
    until = f"{estimate.agrees_until:.3g} s"
    assert agreement.verdict.startswith(f"sensitive: agrees until t = {until}")
    kept = json.loads(json.dumps(record(agreement), allow_nan=False))
    assert kept["agrees"] is False
    assert kept["sensitivity"]["explains"] is True
    assert kept["sensitivity"]["agrees_until"] == estimate.agrees_until
    momentum = agreement.motion.momentum * np.linspace(1, 1 + 1e-3, 2251)[:, None]
    lost = replace(agreement, motion=replace(agreement.motion, momentum=momentum))
    assert lost.sensitivity is None
    assert lost.verdict == "off by more than 5e-06"


@pytest.mark.parametrize(
    ("name", "settings", "seconds", "ratio"),
    [
        ("fig14", "balanced", 40.0, pytest.approx(1.10, abs=0.03)),
        ("fig12", EULER, 10.0, pytest.approx(1.04, abs=0.03)),
        # An unbalanced robot with free hinges.
        ("W5", "fast", 20.0, pytest.approx(1.27, rel=0.5)),
    ],
)
def test_defects_and_growth_explain_the_error(
    name: str, settings: rb.Settings | str, seconds: float, ratio: object
) -> None:
    """The defects, propagated with the equations, add up to the measured error.

    It holds to first order, in chaotic and regular motions and with two integrators.
    """
    estimate, agreement = measured(name, settings, seconds), agreement_of(name, settings, seconds)
    assert estimate.measured / estimate.expected == ratio
    assert estimate.measured == agreement.path_error
    assert agreement.sensitivity is None  # they agree
    assert estimate.doubling < 10 or name == "fig14"


@pytest.mark.parametrize(("name", "seconds"), [("fig12", 10.0), ("classical_chaotic", 20.0)])
def test_a_bad_integrator_is_not_excused_by_chaos(name: str, seconds: float) -> None:
    """Euler at 5 ms has errors of 0.7 % and 9.5 % in single stretches."""
    tolerance = rb.preset("balanced").error_tolerance
    estimate = replace(measured(name, EULER, seconds), tolerance=tolerance)
    assert estimate.defect > 1000 * tolerance
    assert not estimate.explains
    stopped = agreement_of(name, replace(EULER, error_tolerance=tolerance), seconds)
    assert stopped.faults
    assert not stopped.sensitive


SENSITIVE = Sensitivity(
    exponent=0.1, doubling=4420.0, defect=1e-6, expected=0.01, measured=0.1, tolerance=5e-4,
    agrees_until=70.6,
)  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "explains"),
    [
        ({}, True),
        ({"defect": 5e-4}, True),
        ({"defect": 5.1e-4}, False),
        ({"doubling": 10.0}, False),
        ({"doubling": 11.0}, True),
        ({"measured": 0.2}, True),
        ({"measured": 0.21}, False),
    ],
)
def test_an_error_beyond_the_growth_is_the_engines(
    changes: dict[str, float], explains: bool
) -> None:
    """Cases: large defects, a regular motion, and 20 times the expected error."""
    assert replace(SENSITIVE, **changes).explains is explains


def test_chaos_shows_in_the_growth_of_a_rotation() -> None:
    """In twice the time it grows by 74 in a chaotic motion and by 1.4 in a regular one.

    It is unknown if drives change in time.
    """
    assert chaotic(rb.load_scene("classical_chaotic"), 20.0)
    assert not chaotic(rb.load_scene("fig12"), 10.0)
    assert not chaotic(rb.load_scene("wobbling_drive"))
    agreement = agreement_of("wobbling_drive", "fast", 0.1)
    assert sensitivity(MUJOCO, agreement.motion, agreement.theory) is None


@pytest.mark.parametrize("size", [1e-9, 1.0])
def test_an_error_about_the_vertical_turns_the_motion(size: float) -> None:
    """The rotation about γ stays, M rotates, and the end of the path moves sideways.

    Measured 8.1e-7 of the rotation: the second order of the 1e-6 rad to which errors are scaled.
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
