"""PyBullet rolls the ball to the error of its first-order steps, and as it comes not at all."""

from dataclasses import replace

import pytest

import robotball as rb
from robotball.engines.bullet import BULLET
from robotball.motion import momentum_error, path_error

needs_bullet = pytest.mark.skipif(not BULLET.installed, reason="needs the extra bullet")


def errors(scene: str, preset: str, timestep: float, duration: float = 2.0) -> tuple[float, float]:
    theory = rb.integrate(rb.load_scene(scene), rb.sample_times(duration))
    settings = replace(BULLET.presets[preset], timestep=timestep)
    motion = rb.simulate(theory.scene, theory.times, settings, engine=BULLET)
    return path_error(motion, theory), momentum_error(motion, theory)


@needs_bullet
def test_at_its_best_it_is_of_first_order() -> None:
    """A fifth of the step makes a fifth of the error, of the path and of M."""
    coarse, fine = errors("fig12", "best", 5e-3), errors("fig12", "best", 1e-3)
    assert coarse[0] / fine[0] == pytest.approx(5, rel=0.2)
    assert coarse[1] / fine[1] == pytest.approx(5, rel=0.2)


@needs_bullet
def test_as_it_comes_it_cuts_the_rotors_rate() -> None:
    """Every hinge at 100 rad/s at most, in silence: the rotor's 148 are off by a third."""
    scene = rb.load_scene("fig12")
    motion = rb.simulate(scene, rb.sample_times(0.2), "as-it-comes", engine=BULLET)
    assert motion.hinge_rates[-1, 1] == pytest.approx(100, abs=1)
    assert motion.report.faults[0].kind is rb.FaultKind.RATE_OFF
