"""The worked cases of any robot, where two programs in 80-bit numbers agree to 2e-14."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from robotball import ReferenceMotion, integrate
from robotball.robot.motors import Servo
from tests.robots import ENDINGS, energy, worked

pytestmark = pytest.mark.core

TIMES = np.linspace(0.0, 10.0, 201)
CASES = list(ENDINGS)


@cache
def motion_of(name: str, rtol: float = 1e-15) -> ReferenceMotion:
    return integrate(worked(name), TIMES, rtol)


def off(motion: ReferenceMotion, name: str) -> float:
    """How far the end at 10 s is from the worked one, in m and rad."""
    end = ENDINGS[name]
    attitude = motion.attitude[-1] * np.sign(motion.attitude[-1] @ end.attitude)
    errors = [motion.contact_point[-1] - end.contact_point, attitude - end.attitude]
    if end.angles is not None:
        errors.append(motion.hinge_angles[-1] - end.angles)
    return float(np.abs(np.concatenate(errors)).max())


@pytest.mark.parametrize("name", CASES)
def test_worked_end_points_are_met(name: str) -> None:
    """Measured 3.4e-13 to 4.3e-13: half a unit of the last digit that is given.

    W4 has 23 switches of torque limits, each located.
    """
    assert off(motion_of(name), name) < 1e-12


def test_a_stronger_motor_ends_elsewhere() -> None:
    """The check sees a torque limit that is 1e-6 higher: measured 2e-6."""
    scene = worked("W4")
    servo = scene.hinges[0].motor
    assert isinstance(servo, Servo)
    stronger = replace(servo, torque_limit=0.6 * (1 + 1e-6))
    assert off(integrate(scene.with_hinges(motor={"frame": stronger}), TIMES[::200]), "W4") > 1e-7


@pytest.mark.parametrize("name", CASES)
def test_energy_less_work_is_constant(name: str) -> None:
    """T + V - Σ∫τφ̇dt over 10 s. Measured 2.4e-13 J for W1, of 30 J, and 1.2e-13 for the others.

    Without the work of the motors the energy changes by 0.5 J and more.
    """
    motion = motion_of(name)
    assert motion.motor_work is not None
    assert np.ptp(energy(motion) - motion.motor_work.sum(axis=1)) < 5e-13
    assert name == "W1" or np.ptp(energy(motion)) > 0.1


@pytest.mark.parametrize("name", CASES)
def test_a_motion_estimates_its_error(name: str) -> None:
    """The estimate at a loose tolerance is the path's true error within a factor of ten.

    W4's falls with the tolerance, switches and all: measured 1.1e-8 at 1e-9 and 2e-10 at 1e-11.
    """
    loose, fine = motion_of(name, 1e-9), motion_of(name)
    true = np.linalg.norm(loose.contact_point - fine.contact_point, axis=1).max()
    assert 0.1 < loose.reference_error / (true / fine.path_scale) < 10
    if name == "W4":
        assert 30 < off(loose, name) / off(motion_of(name, 1e-11), name) < 300
