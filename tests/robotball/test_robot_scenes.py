"""The catalog's robots: what each shows, by the equations alone."""

from functools import cache

import numpy as np
import pytest

import robotball as rb

ROBOTS = [name for name in rb.catalog() if rb.load_scene(name).not_reduced]
ROBOTS.remove("servo_motors")  # a ball of the paper's numbers


@cache
def motion_of(name: str) -> rb.ReferenceMotion:
    return rb.integrate(rb.load_scene(name))


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_robots_move_and_stay_on_the_plane(name: str) -> None:
    """Their weight never leaves it, and rubber on wood holds them: friction below 0.2.

    Measured: the least normal force is 0.80 of the weight (swinging_frame), the largest friction
    0.18 (offset_routh_sphere).
    """
    scene, loads = rb.load_scene(name), motion_of(name).loads
    assert loads.normal_force.min() > 0.75 * scene.ball.mass * scene.gravity
    assert loads.sliding_friction.max() < 0.2
    assert motion_of(name).path_length > 5 * scene.ball.radius


def test_routh_sphere_off_centre_keeps_both_integrals() -> None:
    """Jellett's 0.308 and Routh's 3.49971427405, of the numbers that its source tells.

    Measured 1e-13 and 2e-12 off over 10 s: rounding and the tolerance of the integration.
    """
    motion = motion_of("offset_routh_sphere")
    ball = motion.scene.ball
    x = motion.gamma[:, 2]
    a, m, sigma = ball.radius, ball.mass, ball.centre_of_mass[2]
    central = ball.inertia - m * sigma**2 * np.diag([1.0, 1.0, 0.0])
    across, along = central[0, 0], central[2, 2]
    w = motion.angular_velocity
    spin = np.einsum("ni,ni->n", w, motion.gamma)
    jellett = a * across * spin + w[:, 2] * ((along - across) * a * x + along * sigma)
    D = across * along + m * (across * a**2 * (1 - x**2) + along * (sigma + a * x) ** 2)
    assert np.ptp(x) > 0.15  # it nods, measured 0.19
    np.testing.assert_allclose(jellett, 0.308, atol=1e-12)
    np.testing.assert_allclose(w[:, 2] * np.sqrt(D), 3.49971427405, atol=1e-10)


def test_momentum_on_a_slope_grows_evenly() -> None:
    """By m g a sin(slope) along Y, 0.0338428 kg m²/s in a second, and stays as it is across."""
    motion = motion_of("inclined_plane")
    growth = np.outer(motion.times, [0.0, 2.3 * 9.81 * 0.15 * np.sin(np.arctan(0.01)), 0.0])
    assert growth[-1, 1] == pytest.approx(0.338428, rel=1e-6)
    # Measured 4e-16: rounding.
    assert np.abs(motion.momentum - motion.momentum[0] - growth).max() < 2e-15
    assert abs(motion.contact_point[-1, 1]) > abs(motion.contact_point[-1, 0])  # turned aside


@pytest.mark.parametrize("name", ["pendulum_robot", "steered_pendulum_robot", "tilting_gyroscope"])
def test_servo_robots_roll_off_from_rest_within_their_torque(name: str) -> None:
    """ω and all rates are zero at the start; no motor reaches its limit."""
    motion, scene = motion_of(name), rb.load_scene(name)
    assert np.abs(motion.angular_velocity[0]).max() < 1e-15
    assert np.abs(motion.hinge_rates[0]).max() == 0
    for motor, torques in zip(scene.motors, motion.loads.motor_torques.T, strict=True):
        limit = getattr(motor, "torque_limit", None)
        assert limit is None or np.abs(torques).max() < 0.5 * limit


def test_beaver_ball_carries_its_weight_round() -> None:
    """Its centre of mass is off by a sixth of the radius; M is not constant, and the path turns."""
    motion = motion_of("beaver_ball")
    offset = float(np.linalg.norm(motion.scene.ball.centre_of_mass))
    assert offset == pytest.approx(0.163 * motion.scene.ball.radius, rel=5e-3)
    assert np.ptp(motion.momentum, axis=0).max() > 0.5 * np.abs(motion.momentum).max()


def test_free_frame_swings_out() -> None:
    """Its bearing takes energy and nothing gives any: the work is negative and only falls."""
    motion = motion_of("swinging_frame")
    assert motion.motor_work is not None
    work = motion.motor_work.sum(axis=1)
    assert np.diff(work).max() < 1e-12
    assert work[-1] < -0.1  # J
