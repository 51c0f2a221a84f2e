"""Angular velocity, slip and momentum of a trajectory from its samples."""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.engines.recorded import sampled_rates
from robotball.files.trajectories import Trajectory
from robotball.motion import Motion, momentum_error
from robotball.rotations import multiply
from tests.messages import naming

FIG12 = rb.integrate(rb.load_scene("fig12"), np.linspace(0.0, 2.0, 101))


def trajectory_of(motion: Motion, digits: int | None = None) -> Trajectory:
    """Return times, path and attitudes alone, rounded to `digits` decimals."""
    position = np.column_stack([motion.contact_point, np.full(len(motion.times), np.nan)])
    attitude = motion.attitude
    if digits is not None:
        position, attitude = position.round(digits), attitude.round(digits)
        attitude /= np.linalg.norm(attitude, axis=1, keepdims=True)
    return Trajectory("run.csv", motion.times, position, attitude)


SAMPLED = [("fig12", 0.02), ("classical_regular", 0.005), ("wobbling_drive", 0.02)]


@pytest.mark.parametrize("digits", [None, 8, 5])
@pytest.mark.parametrize(("name", "interval"), SAMPLED)
def test_the_error_estimate_of_a_numerical_rate_is_an_upper_bound(
    name: str, interval: float, digits: int | None
) -> None:
    """For ω, M and slip of an exact trajectory, smooth or rounded.

    Measured: the error is at most 0.0005 to 0.02 of the estimate if truncation dominates, 0.4 to
    0.62 if rounding does.
    """
    exact = rb.integrate(rb.load_scene(name), np.arange(0, 2 + interval / 2, interval))
    motion = rb.recorded(exact.scene, trajectory_of(exact, digits))
    omega_error = np.linalg.norm(motion.angular_velocity - exact.angular_velocity, axis=1)
    M_error = np.linalg.norm(motion.momentum - exact.momentum, axis=1)
    assert np.all(omega_error <= motion.angular_velocity_error)
    assert np.all(motion.slip <= motion.slip_error)
    assert np.all(M_error <= motion.momentum_error)
    assert motion.angular_velocity_error.max() < 80 * 10.0 ** -(digits or 8) / interval + 5e-4


def test_slip_and_spin_are_measured_despite_the_numerical_error() -> None:
    """A stretch of 0.1 % gives a slip of 0.1 % of the speed, 5e-3 m/s here.

    Measured: 4.76e-3 with an error of 4.7e-4, and a rolling radius of 1.001. An extra rotation of
    the attitudes about the vertical at 0.1 rad/s is spin.
    """
    longer = replace(FIG12, contact_point=1.001 * FIG12.contact_point)
    motion = rb.recorded(FIG12.scene, trajectory_of(longer))
    speed = np.linalg.norm(sampled_rates(FIG12.times, FIG12.contact_point)[0], axis=1)
    assert motion.slip == pytest.approx(1e-3 * speed, abs=5e-6)
    assert motion.slip.max() > 10 * motion.slip_error.max()
    assert motion.rolling_radius == pytest.approx(1.001, abs=1e-6)
    half = 0.05 * FIG12.times
    turn = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
    spun = replace(FIG12, attitude=multiply(turn, FIG12.attitude))
    motion = rb.recorded(FIG12.scene, trajectory_of(spun))
    assert motion.spin == pytest.approx(0.1, abs=1e-4)  # measured error 3e-6


def test_quantities_in_the_file_have_no_numerical_error() -> None:
    """Momentum from the file is kept to the last bit.

    If attitudes are too far apart, the sense of rotation between two samples is unknown.
    """
    trajectory = replace(trajectory_of(FIG12), angular_velocity=FIG12.angular_velocity)
    motion = rb.recorded(FIG12.scene, trajectory)
    assert not motion.angular_velocity_error.any()
    assert momentum_error(motion, FIG12) < 1e-14  # measured 3e-15
    motion = rb.recorded(FIG12.scene, replace(trajectory, momentum=FIG12.momentum + 1))
    assert motion.momentum.tolist() == (FIG12.momentum + 1).tolist()
    apart = trajectory_of(rb.integrate(FIG12.scene, np.array([0.0, 1.0, 2.0, 3.0])))
    with pytest.raises(rb.InputError, match=naming("samples")):
        rb.recorded(FIG12.scene, apart)


def test_rates_of_uneven_samples_have_sixth_order() -> None:
    """At half the interval the error is 64 times smaller (measured 61 to 66).

    With two samples the rate is the slope of their line.
    """

    def error(n: int) -> float:
        even = np.linspace(0, 3, n)
        times = even + 0.05 * np.sin(6 * even)
        slopes, _ = sampled_rates(times, np.sin(2 * times)[:, None])
        return float(np.abs(slopes[8:-8, 0] - 2 * np.cos(2 * times[8:-8])).max())

    assert np.log2(error(100) / error(200)) == pytest.approx(6, abs=0.3)
    slopes, _ = sampled_rates(np.array([0.0, 2.0]), np.array([[1.0], [5.0]]))
    assert slopes.tolist() == [[2.0], [2.0]]
