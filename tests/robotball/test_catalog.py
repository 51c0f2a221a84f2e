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

    def energy(scene: rb.Scene) -> Array:
        motion, p = rb.integrate(scene), scene.parameters
        gamma = motion.gamma @ scene.principal_axes
        assert np.ptp(gamma[:, 2]) > 0.1  # the ball does move about
        omega = motion.angular_velocity @ scene.principal_axes
        spinning = scene.rolling == "classical"
        E = eq.energy(tuple(omega.T), tuple(gamma.T), p.Omega, p.A, p.d, spinning)
        return np.asarray(E)

    assert np.ptp(energy(rb.load_scene(name))) < 1.5e-12
    assert np.ptp(energy(rb.load_scene("fig12"))) > 10  # measured 27


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
