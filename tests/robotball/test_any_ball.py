"""Any ball, under any drives, rolls in MuJoCo as by the equations."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.equations import ROLLING_MODELS
from validation import compare
from validation.studies.random_runs import random_scene

pytestmark = pytest.mark.core

FIG12 = rb.load_scene("fig12")


@pytest.mark.parametrize("number", range(8))
def test_mujoco_follows_the_equations_for_any_ball(number: int) -> None:
    """Shells with I_s ≠ J_s, rates of both signs, both models; measured 1.5e-8 at most.

    The order is four: measured 3.91 to 4.35 over 50 balls, 3.996 in the median.
    """
    coarse, fine = (compare(random_scene(number), each) for each in ("fast", "balanced"))
    assert fine.faults == ()
    assert coarse.path_error is not None
    assert fine.path_error is not None
    assert fine.path_error < 5e-8
    assert 3.8 < np.log(coarse.path_error / fine.path_error) / np.log(4) < 4.5


UNSTEADY: dict[str, dict[str, Any]] = {
    "ramp across samples": {"frame_rate": rb.Ramp(initial=2.0, final=4.0, start=1.233, end=3.217)},
    "smooth ramps": {
        "frame_rate": rb.Ramp(initial=2.0, final=4.0, start=1.0, end=3.0, shape="smooth"),
        "rotor_rates": (rb.Ramp(initial=148.0, final=-148.0, start=0.5, end=8.0),),
    },
    "sines": {
        "frame_rate": rb.Sine(mean=2.0, amplitude=1.0, frequency=0.5),
        "rotor_rates": (rb.Sine(mean=148.0, amplitude=20.0, frequency=0.8),),
    },
    "a function": {"frame_rate": lambda t: 2 + np.sin(3 * t)},
    "samples": {
        "frame_rate": rb.Samples(
            times=tuple(np.linspace(0, 10, 41).tolist()),
            values=tuple((2 + np.sin(np.linspace(0, 10, 41))).tolist()),
        )
    },
    "a sum": {
        "frame_rate": rb.Sum(
            (2.0, rb.Ramp(final=1.0, start=1.1, end=2.0), rb.Sine(amplitude=0.5, frequency=0.6))
        )
    },
}


@pytest.mark.parametrize(("name", "rolling"), [*zip(UNSTEADY, 3 * ROLLING_MODELS, strict=True)])
def test_order_four_is_kept_under_drives_in_time(name: str, rolling: Any) -> None:
    """From 20 to 5 ms the error falls by four to the fourth, breakpoints or not.

    Measured orders 3.60 (samples) to 4.07; path errors at balanced 1.2e-9 to 2.9e-8.
    """
    scene = replace(FIG12, rolling=rolling, **UNSTEADY[name])
    coarse, fine = (compare(scene, settings).path_error for settings in ("fast", "balanced"))
    assert coarse is not None
    assert fine is not None
    assert fine < 9e-8
    assert 3.5 < np.log(coarse / fine) / np.log(4) < 4.3


def test_loads_and_powers_agree_under_drives_in_time() -> None:
    """λ₀, forces and torques of (2.4)-(2.5), with dΩ/dt and dk/dt, at MuJoCo's own states."""
    agreement = compare(replace(FIG12, **UNSTEADY["sines"]), "accurate", rb.sample_times(3.0))
    ours, theirs = agreement.motion.loads, agreement.theory.loads
    # Measured 2.2e-9 N m, 2.7e-9 N and 3.6e-9 N m, of 10 to 20: RK4's error, and the rounding of
    # the armature's torque.
    assert np.abs(ours.motor_torques - theirs.motor_torques).max() < 1.2e-8
    assert np.abs(ours.contact_force - theirs.contact_force).max() < 1.2e-8
    assert np.abs(ours.spin_torque - theirs.spin_torque).max() < 1.2e-8
    powers = agreement.theory.motor_powers
    assert np.abs(powers).max() > 10  # W
    # Measured 2.3e-6 W of 40: RK4's error.
    assert np.abs(agreement.motion.motor_powers - powers).max() < 1e-5
