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

GRID = np.linspace(0, 10, 41)
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
    "samples": {"frame_rate": rb.Samples(times=tuple(GRID), values=tuple(2 + np.sin(GRID)))},
    "a sum": {
        "frame_rate": rb.Sum(
            (2.0, rb.Ramp(final=1.0, start=1.1, end=2.0), rb.Sine(amplitude=0.5, frequency=0.6))
        )
    },
}
CASES = [*range(8), *zip(UNSTEADY, 3 * ROLLING_MODELS, strict=True)]


def scene_of(case: Any) -> rb.Scene:
    """A random ball, or Fig. 12's under drives in time, in one of the models."""
    if isinstance(case, int):
        return random_scene(case)
    name, rolling = case
    return replace(rb.load_scene("fig12"), rolling=rolling, **UNSTEADY[name])


@pytest.mark.parametrize("case", CASES, ids=str)
def test_mujoco_follows_the_equations_with_order_four(case: Any) -> None:
    """Shells with I_s ≠ J_s, rates of both signs, both models, breakpoints or not.

    Measured at balanced 1.5e-8 at most, under drives 2.9e-8; orders from 20 to 5 ms 3.60 (samples)
    to 4.35.
    """
    scene = scene_of(case)
    theory = rb.integrate(scene)
    coarse, fine = (compare(scene, each, theory=theory) for each in ("fast", "balanced"))
    assert fine.faults == ()
    assert coarse.path_error is not None
    assert fine.path_error is not None
    assert fine.path_error < (5e-8 if isinstance(case, int) else 9e-8)
    assert 3.5 < np.log(coarse.path_error / fine.path_error) / np.log(4) < 4.5


def test_loads_and_powers_agree_under_drives_in_time() -> None:
    """λ₀, forces and torques of (2.4)-(2.5), with dΩ/dt and dk/dt, at MuJoCo's own states."""
    agreement = compare(scene_of(("sines", "rubber")), "accurate", rb.sample_times(3.0))
    motion, theory = agreement.motion, agreement.theory
    for kind in ("motor_torques", "contact_force", "spin_torque"):
        # Measured 8.3e-10 N m and 7.1e-10 N at most, of 10 to 20: RK4's error, and the rounding of
        # the armature's torque.
        assert np.abs(getattr(motion.loads, kind) - getattr(theory.loads, kind)).max() < 2.5e-9
    # Measured 4.4e-9 W of 370.
    assert np.abs(motion.motor_powers - theory.motor_powers).max() < 1.3e-8
