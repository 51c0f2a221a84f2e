"""Every scene of the catalog runs in both engines and agrees as far as it should."""

from functools import cache

import numpy as np
import pytest

import robotball as rb
from robotball import equations as eq
from robotball.files.scene_file import entries
from robotball.rotations import Array
from validation import Agreement, compare

pytestmark = pytest.mark.core

# Path errors over 10 s; RK4's error dominates, with the fourth power of the fastest rate. The
# frames of Figs 5-8 turn at |Ω| = 4.6 rad/s, so theirs are the largest.
MEASURED = {  # balanced, accurate
    "beaver_ball": (1.3e-8, 3.0e-11),
    "chaplygin_ball": (1.7e-9, 2.8e-12),
    "chaplygin_ball_same_tori": (2.4e-11, 2.3e-13),
    "chaplygin_gyrostat": (1.0e-9, 1.6e-12),
    "classical_chaotic": (2.4e-8, 3.1e-11),
    "classical_regular": (2.2e-9, 3.8e-12),
    "fig05b": (1.7e-7, 2.7e-10),
    "fig05c": (4.8e-9, 7.9e-12),
    "fig05d": (3.5e-9, 5.3e-12),
    "fig06": (9.6e-8, 1.5e-10),
    "fig07": (7.4e-8, 1.2e-10),
    "fig08": (2.0e-8, 3.1e-11),
    "fig10": (2.8e-12, 1.1e-13),
    "fig10_stable": (2.5e-12, 2.7e-13),
    "fig12": (1.7e-9, 2.5e-12),
    "fig13": (9.9e-10, 2.1e-12),
    "fig14": (5.5e-9, 9.4e-12),
    "routh_sphere": (1.1e-8, 1.9e-11),
    "inclined_plane": (1.9e-9, 3.0e-12),
    "offset_routh_sphere": (9.3e-9, 1.3e-11),
    "pendulum_robot": (2.3e-10, 1.1e-12),
    "rubber_chaplygin_ball": (2.4e-11, 2.1e-13),
    "rubber_chaplygin_gyrostat": (2.4e-9, 4.1e-12),
    "rubber_routh_sphere": (4.6e-9, 8.0e-12),
    "spin_up_from_rest": (6.2e-8, 9.8e-11),
    "steered_pendulum_robot": (6.6e-10, 1.1e-12),
    "swinging_frame": (8.2e-9, 1.8e-11),
    "three_rotors": (1.7e-9, 2.5e-12),
    "tilting_gyroscope": (3.4e-9, 6.5e-12),
    "wobbling_drive": (2.5e-9, 1.7e-11),
    "zero_rotor": (3.9e-11, 8.2e-14),
}
SERVO = "servo_motors"
INTEGRABLE = [n for n in MEASURED if "chaplygin" in n or n.endswith("routh_sphere")]
INTEGRABLE.remove("offset_routh_sphere")  # its energy is another
AT_REST = [
    name
    for name in rb.catalog()
    if (scene := rb.load_scene(name)).keeps_momentum and not np.any(scene.start.momentum)
]


@cache
def agreement_of(name: str, settings: str) -> Agreement:
    return compare(rb.load_scene(name), settings)


def test_no_scene_is_left_out() -> None:
    """Every scene has its bound below, but the one with stiff motors."""
    assert sorted([*MEASURED, SERVO]) == rb.catalog()


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("settings", ["balanced", pytest.param("accurate", marks=pytest.mark.slow)])
def test_both_engines_agree_on_every_scene(name: str, settings: str) -> None:
    """The path error is at most three times what was measured, and there is no fault."""
    agreement = agreement_of(name, settings)
    measured = MEASURED[name][("balanced", "accurate").index(settings)]
    assert agreement.faults == ()
    assert agreement.agrees
    assert agreement.path_error is not None
    # Where it is below 1e-12, rounding counts as well as RK4.
    assert agreement.path_error < 3 * max(measured, 1e-12)


@pytest.mark.parametrize("name", MEASURED)
def test_forces_and_torques_agree_on_every_scene(name: str) -> None:
    """Contact force, spin torque and motor torques of the two engines, at balanced."""
    agreement = agreement_of(name, "balanced")
    ours, theirs = agreement.motion.loads, agreement.theory.loads
    for kind in ("contact_force", "spin_torque", "motor_torques"):
        expected = getattr(theirs, kind)
        # Of fig05d the spin torque is zero: 5.1e-8 N m is RK4's error in a drive's load.
        scale = max(float(np.abs(expected).max()), 1e-2)
        # Measured 5.1e-6 at most (fig05d; fig06 4.9e-6): RK4's error in the state, carried by the
        # loads.
        assert np.abs(getattr(ours, kind) - expected).max() < 2e-5 * scale, kind


@pytest.mark.parametrize("name", AT_REST)
def test_a_ball_at_rest_keeps_no_momentum_also_while_it_spins_up(name: str) -> None:
    """|M| stays zero: measured 5.7e-11 kg m²/s at most (fig08), RK4's error at 1 ms."""
    momentum = agreement_of(name, "accurate").motion.momentum
    assert np.linalg.norm(momentum, axis=1).max() < 1.6e-10


@pytest.mark.slow
def test_real_motors_agree_with_the_same_motors_in_the_equations() -> None:
    """They miss their rates by more than a hundredth, in both engines alike."""
    agreement = agreement_of(SERVO, "accurate")
    assert agreement.faults == ()
    assert agreement.path_error is not None
    assert agreement.path_error < 4e-10  # measured 1.2e-10: RK4's error in a fast servo
    assert agreement.report.hinge_rate_error.max() > 0.01


@pytest.mark.parametrize("name", INTEGRABLE)
def test_the_integrable_balls_keep_their_energy(name: str) -> None:
    """With Ω = 0, or Ω and K on an axis of symmetry (Remark 5); in fig12, a control, it changes.

    Measured 5.7e-13 J of 15 at most: the tolerance of the integration.
    """

    def energy(name: str) -> Array:
        scene, motion = rb.load_scene(name), agreement_of(name, "balanced").theory
        p = scene.parameters
        gamma = motion.gamma @ scene.principal_axes
        assert np.ptp(gamma[:, 2]) > 0.1  # the ball does move about
        omega = motion.angular_velocity @ scene.principal_axes
        spinning = scene.rolling == "classical"
        return np.asarray(eq.energy(tuple(omega.T), tuple(gamma.T), p.Omega, p.A, p.d, spinning))

    assert np.ptp(energy(name)) < 1.5e-12
    assert np.ptp(energy("fig12")) > 10  # measured 27


# The robots ----------------------------------------------------------------------------------

ROBOTS = [name for name in MEASURED if rb.load_scene(name).not_reduced]


def motion_of(name: str) -> rb.ReferenceMotion:
    theory = agreement_of(name, "balanced").theory
    assert isinstance(theory, rb.ReferenceMotion)
    return theory


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


# The files -----------------------------------------------------------------------------------


def test_the_head_of_a_file_is_that_of_its_scene() -> None:
    """`robotball scenes` lists what the scenes say, and makes none of them."""
    for entry in entries():
        scene = rb.load_scene(entry.name)
        assert (entry.title, entry.rolling) == (scene.title, scene.rolling)
        assert entry.duration == scene.duration
    assert [entry.name for entry in entries()] == rb.catalog()


def test_the_classical_scenes_have_the_balls_of_their_figures() -> None:
    """Figs 12 and 14; their numbers are the captions'."""
    for name, figure in (("classical_regular", "fig12"), ("classical_chaotic", "fig14")):
        assert rb.load_scene(name).ball == rb.load_scene(figure).ball


def test_every_scene_says_where_its_numbers_come_from() -> None:
    """A source with its parameters and what was chosen."""
    for name in rb.catalog():
        scene = rb.load_scene(name)
        assert "=" in scene.source
        assert scene.title
