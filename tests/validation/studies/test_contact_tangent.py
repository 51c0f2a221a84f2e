"""Exponents and limit cycles by the tangent of MuJoCo's map, beside those of the equations."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import robotball as rb
from robotball.dynamics.cycles import tangent
from robotball.dynamics.portraits import limit_cycles
from robotball.engines.mujoco.model import build
from robotball.robot.formulas import scale
from tests.paper.clouds import COARSE
from tests.paper.engine_cycles import contact_cycle
from validation.studies.contact_sections import level_starts
from validation.studies.contact_tangent import (
    growths,
    integrated,
    rolled,
)


@pytest.mark.parametrize(("name", "numbers"), [("fig14", 5), ("classical_chaotic", 6)])
def test_mujocos_tangent_is_the_equations(name: str, numbers: int) -> None:
    """Each small turn and change of M is carried on for 2 s as the equations carry it."""
    scene = rb.load_scene(name)
    attitudes, momenta = level_starts(scene, 1, 0)
    state = attitudes, momenta, np.eye(6)[None, :, :numbers]
    contact = tangent(partial(rolled, build(scene, rb.preset("balanced")), 2.0), *state)[1]
    ball = scene.parameters
    other = replace(ball, Omega=scale(1.001, ball.Omega))
    right, wrong = (tangent(partial(integrated, each, 2.0), *state)[1] for each in (ball, other))
    # Measured 6e-8 and 2.7e-7, of steps of 5 ms; 8e-3 and 2e-2 of a frame that turns 0.1 % faster.
    assert np.abs(contact - right).max() < 2e-6
    assert np.abs(contact - wrong).max() > 2e-3


def test_deviations_grow_in_mujoco_as_in_the_equations() -> None:
    """All five of Fig. 14's along MuJoCo's motion, stretch by stretch; their sum is ⟨div⟩."""
    scene = rb.load_scene("fig14")
    flow = partial(rolled, build(scene, COARSE), 10.0)
    found = growths(scene, flow, 10.0, 3, 5, level_starts(scene, 1, 0))
    logarithms, divergence = found.by_equations(scene.parameters)
    assert found.spectra.shape == (1, 6)
    # Measured 1.5e-3 of 3, of steps of 50 ms; with the sign of K or of Ω changed 2.7 and 3.4.
    assert np.abs(found.logarithms - logarithms).max() < 1e-2
    assert np.abs(found.logarithms).max() > 1
    # Measured 1.6e-3 of -0.019: the density of Remark 5 at both ends, ln(0.8/0.6)/2 over 50 s.
    assert found.spectra.sum() == pytest.approx(divergence, abs=3e-3)


def test_mujoco_has_the_unstable_limit_cycle_of_fig8() -> None:
    """Closed on its own map from 1e-3 rad beside; a rotor 0.1 % faster has another."""
    scene = rb.load_scene("fig08")
    (cycle,) = limit_cycles(scene.parameters)
    faster = scene.with_hinges(command={"rotor1": 1.001 * scene.hinges[1].rate})
    own, other = (
        contact_cycle(build(each, rb.preset("fast")), cycle, parts=4) for each in (scene, faster)
    )
    # Measured 9e-6 s and 2.9e-5, of steps of 20 ms; 2.7e-3 s of the other.
    assert own.period == pytest.approx(cycle.period, abs=5e-5)
    assert own.multipliers[0].real == pytest.approx(cycle.multipliers[0].real, abs=1e-4)
    assert abs(other.period - cycle.period) > 1e-3
