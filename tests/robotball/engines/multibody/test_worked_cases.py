"""The worked cases of any robot, where two programs in 80-bit numbers agree to 2e-14."""

from dataclasses import replace

import numpy as np
import pytest

from robotball import Scene, integrate
from robotball.engines.multibody import March
from robotball.engines.multibody.system import System
from robotball.motors import Servo
from tests.robots import ENDINGS, energy, worked

pytestmark = pytest.mark.core

TIMES = np.linspace(0.0, 10.0, 201)
CASES = list(ENDINGS)


def off(scene: Scene, name: str, rtol: float = 1e-15) -> float:
    """How far the end at 10 s is from the worked one, in m and rad."""
    motion, end = integrate(scene, TIMES, rtol), ENDINGS[name]
    attitude = motion.attitude[-1] * np.sign(motion.attitude[-1] @ end.attitude)
    errors = [motion.contact_point[-1] - end.contact_point, attitude - end.attitude]
    if end.angles is not None:
        errors.append(motion.hinge_angles[-1] - end.angles)
    return float(np.abs(np.concatenate(errors)).max())


@pytest.mark.parametrize("name", CASES)
def test_worked_end_points_are_met(name: str) -> None:
    """Measured 3.4e-13 to 4.3e-13: half a unit of the last digit that is given."""
    assert off(worked(name), name) < 1e-12


def test_a_stronger_motor_ends_elsewhere() -> None:
    """The check sees a torque limit that is 1e-6 higher: measured 2e-6."""
    scene = worked("W4")
    servo = scene.motors[0]
    assert isinstance(servo, Servo)
    stronger = replace(servo, torque_limit=0.6 * (1 + 1e-6))
    assert off(replace(scene, motors=(stronger, scene.motors[1])), "W4") > 1e-7


@pytest.mark.parametrize("name", CASES)
def test_energy_less_work_is_constant(name: str) -> None:
    """T + V - Σ∫τφ̇dt over 10 s. Measured 2.4e-13 J for W1, of 30 J, and 1.2e-13 for the others.

    A scene whose motors' work is left out is no such thing: 0.5 J and more.
    """
    motion = integrate(worked(name), TIMES)
    assert motion.motor_work is not None
    kept = energy(motion) - motion.motor_work.sum(axis=1)
    assert np.ptp(kept) < 5e-13
    if name != "W1":
        assert np.ptp(energy(motion)) > 0.1


def test_switches_of_torque_limits_are_located() -> None:
    """W4 has 23, the first at .3078706 s; at 1e-9 a step they are the same within 1e-8 s."""
    seen: dict[float, list[float]] = {}
    for rtol in (1e-15, 1e-9):
        march = March(System(worked("W4")), rtol, 10.0, 10_000)
        march.run(TIMES)
        seen[rtol] = march.switches
    assert len(seen[1e-15]) == 23
    assert seen[1e-15][0] == pytest.approx(0.3078706, abs=5e-8)
    # Measured 6e-8 s.
    assert seen[1e-9] == pytest.approx(seen[1e-15], abs=2e-7)


def test_error_falls_with_the_tolerance() -> None:
    """W4, switches and all: two digits of the tolerance are two of the error, within half a digit.

    Measured 1.1e-8 at 1e-9 and 2e-10 at 1e-11.
    """
    errors = [off(worked("W4"), "W4", rtol) for rtol in (1e-9, 1e-11)]
    assert 30 < errors[0] / errors[1] < 300


@pytest.mark.parametrize("name", CASES)
def test_a_motion_tells_its_own_error(name: str) -> None:
    """The estimate at a loose tolerance is the path's true error within a factor of ten."""
    loose, fine = integrate(worked(name), TIMES, 1e-10), integrate(worked(name), TIMES)
    true = np.linalg.norm(loose.contact_point - fine.contact_point, axis=1).max()
    assert 0.1 < loose.reference_error / (true / fine.path_scale) < 10
