"""MuJoCo agrees with the equations for balanced balls: path, momentum, attitude and torques."""

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.stepping import stretches
from tests.motions import pair_of

pytestmark = pytest.mark.core

FIG12 = rb.load_scene("fig12")


@pytest.mark.parametrize(
    ("name", "settings", "bound"),
    [
        ("fig12", "accurate", 5.5e-12),  # 1.8e-12: RK4's error
        ("fig12", "exact", 1.2e-13),  # 4e-14: rounding
        ("classical_regular", "exact", 2e-13),  # 6e-14
    ],
)
def test_mujoco_follows_the_equations(name: str, settings: str, bound: float) -> None:
    pair = pair_of(rb.load_scene(name), settings, rb.sample_times(3.0))
    assert pair.agrees
    assert pair.path_error < bound


@pytest.mark.parametrize("name", ["fig12", "classical_regular"])
def test_momentum_attitude_and_angular_velocity_agree(name: str) -> None:
    """M is summed from the momenta of MuJoCo's bodies; frame and rotors keep prescribed rates."""
    pair = pair_of(rb.load_scene(name), "balanced")
    ours, theirs = pair.motion, pair.theory
    # Measured at most 2.5e-14 kg m²/s, of 5: rounding of the sum.
    assert np.abs(ours.momentum[0] - theirs.momentum[0]).max() < 8e-14
    same = np.abs((ours.attitude * theirs.attitude).sum(axis=1))
    # Measured 1.3e-15 and 2.4e-7 rad/s: RK4's error, which a quaternion's cosine squares.
    assert np.abs(same - 1).max() < 5e-15
    assert np.abs(ours.angular_velocity - theirs.angular_velocity).max() < 8e-7
    assert pair.gamma_error < 1.7e-7  # measured 5.6e-8 rad
    assert pair.momentum_error < 1.2e-8  # measured 3.9e-9
    # Measured 2.9e-11 rad, of 1480: rounding of 2 000 additions.
    assert np.abs(ours.hinge_angles - theirs.hinge_angles).max() < 2e-10
    assert pair.report.hinge_rate_error.max() < 3e-13  # measured 6e-14 at most


def test_sparse_samples_take_the_same_steps_as_dense_ones() -> None:
    """A long interval is run in parts, which only its progress reveals; a model can run twice."""
    model, progress = build(FIG12, rb.preset("accurate")), list[float]()
    dense = run(model, np.linspace(0.0, 5.0, 251), progress.append)
    sparse = run(model, np.array([0.0, 5.0]))
    # Measured 1.6e-13 m: step lengths differ by rounding.
    assert np.abs(dense.contact_point[-1] - sparse.contact_point[-1]).max() < 1e-12
    assert sparse.report.steps == 5000
    assert progress == sorted(progress)
    assert len(progress) > 1
    assert progress[-1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("preset", ["fast", "naive"])
def test_a_servo_torque_is_its_clipped_law(preset: str) -> None:
    """The torque is kv times the rate error, clipped at the limit.

    "fast" splits its steps at each switch; "naive" leaves the limit to MuJoCo.
    """
    motors = (rb.Servo(gain=100.0, torque_limit=3.0), None)
    scene = FIG12.with_hinges(motor=motors)
    motion = rb.simulate(scene, rb.sample_times(2.0), settings=preset)
    torque = motion.loads.motor_torques[:, 0]
    rate = scene.hinges[0].command.rate(motion.times)
    law = np.clip(100.0 * (rate - motion.hinge_rates[:, 0]), -3.0, 3.0)
    assert np.abs(torque - law).max() < 5e-14  # measured 1.4e-14 N m: rounding
    # 39 and 46 of 101 samples are at the upper limit, 31 and 27 at the lower one.
    assert min((law == 3.0).sum(), (law == -3.0).sum(), (np.abs(law) < 3.0).sum()) > 20


def test_steps_end_on_every_sample_and_breakpoint() -> None:
    """Intervals are divided evenly into steps of at most one timestep, in bounded stretches."""
    parts = list(stretches(np.array([0.0, 0.013, 40.0]), (0.5, 7.0), timestep=1e-3))
    edges = np.concatenate([part.ends for part in parts])
    steps = [int(part.counts.sum()) for part in parts]
    assert set(np.round(edges[:, 1], 9)) >= {0.013, 0.5, 7.0, 40.0}
    np.testing.assert_allclose(edges[1:, 0], edges[:-1, 1], rtol=1e-12)
    assert max(steps) <= 2 * 4096
    assert sum(steps) == 40_000
    befores = np.cumsum([0, *steps[:-1]])
    starts = [i + before for part, before in zip(parts, befores, strict=True) for i in part.samples]
    assert starts == [0, 13]
