"""Variations of a scene change the requested quantities and nothing else."""

import numpy as np
import pytest

import robotball as rb
from robotball.robot.variations import gyrostat, momentum_of, redistributed, scaled
from tests.messages import naming

pytestmark = pytest.mark.core

SCENES = [rb.load_scene(name) for name in ("fig12", "classical_regular")]


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.rolling)
def test_a_gyrostat_has_the_momentum_and_the_rate_requested(scene: rb.Scene) -> None:
    """Only Ω and K change: I, d and M are kept."""
    K = np.array([30.0, -4.0, 500.0])
    numbers, new = scene.parameters, gyrostat(scene, frame_rate=-7.0, K=K).parameters
    np.testing.assert_allclose(new.K, K, rtol=1e-12)
    np.testing.assert_allclose(new.Omega, [0, 0, -7.0], atol=1e-14)
    np.testing.assert_allclose([*new.I, new.d], [*numbers.I, numbers.d], rtol=1e-12)
    slow = gyrostat(scene, frame_rate=2.0, K=momentum_of(scene), rotor_rate=1e6)
    assert slow.hinges[1].rate == pytest.approx(1e6)
    np.testing.assert_allclose(slow.parameters.K, numbers.K, rtol=1e-12, atol=1e-12)
    with pytest.raises(rb.InputError, match=naming("frame moment positive")):
        gyrostat(scene, frame_rate=2.0, K=momentum_of(scene), rotor_rate=1.0)


def test_a_mass_shared_out_anew_is_the_same_mass() -> None:
    """Ratios over twelve decades."""
    new = redistributed(SCENES[0], frame_to_shell=1e6, rotor_to_frame=1e-6).ball
    assert new.mass == pytest.approx(SCENES[0].ball.mass, rel=1e-14)
    assert new.frame.mass / new.shell.mass == pytest.approx(1e6)
    assert new.rotors[0].mass / new.frame.mass == pytest.approx(1e-6)


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.rolling)
def test_a_scaled_ball_moves_alike(scene: rb.Scene) -> None:
    """The path goes with the length, whatever the masses: 1e-14 of it, by rounding."""
    times = rb.sample_times(1.0)
    small, large = (
        rb.integrate(item, times) for item in (scene, scaled(scene, mass=1e7, length=1e5))
    )
    assert np.abs(large.contact_point / 1e5 - small.contact_point).max() < 1e-12
    frictions = [item.loads.sliding_friction.max() for item in (small, large)]
    assert frictions[1] == pytest.approx(frictions[0], rel=1e-12)
