"""Exponents and limit cycles from the tangent of MuJoCo's map, compared with the equations."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import robotball as rb
from robotball.dynamics.cycles import limit_cycles, tangent
from robotball.engines.mujoco.model import build
from robotball.robot.formulas import scale
from tests.paper.clouds import COARSE
from tests.paper.engine_cycles import by_equations, contact_cycle, integrated, rolled
from validation.studies.contact_sections import level_starts
from validation.studies.long_runs import growths


@pytest.mark.parametrize(("name", "numbers"), [("fig14", 5), ("classical_chaotic", 6)])
def test_mujocos_tangent_equals_the_equations_tangent(name: str, numbers: int) -> None:
    """Small rotations and changes of M evolve alike over 2 s."""
    scene = rb.load_scene(name)
    attitudes, momenta = level_starts(scene, 1, 0)
    state = attitudes, momenta, np.eye(6)[None, :, :numbers]
    contact = tangent(partial(rolled, build(scene, rb.preset("balanced")), 2.0), *state)[1]
    ball = scene.parameters
    other = replace(ball, Omega=scale(1.001, ball.Omega))
    right, wrong = (tangent(partial(integrated, b, 2.0), *state)[1] for b in (ball, other))
    # Measured 6e-8 and 2.7e-7 with steps of 5 ms; 8e-3 and 2e-2 if the frame turns 0.1 % faster.
    assert np.abs(contact - right).max() < 2e-6
    assert np.abs(contact - wrong).max() > 2e-3


def test_deviations_grow_alike_in_mujoco_and_in_the_equations() -> None:
    """The five deviations of Fig. 14 agree in each stretch, and their sum is the divergence."""
    scene = rb.load_scene("fig14")
    flow = partial(rolled, build(scene, COARSE), 10.0)
    attitudes, momenta = level_starts(scene, 1, 0)
    found = growths(scene, flow, 10.0, 3, 5, (attitudes, momenta))
    logarithms, divergence = by_equations(found, scene.parameters, momenta)
    assert found.spectra.shape == (1, 6)
    # Measured 1.5e-3 of 3 with steps of 50 ms; 2.7 and 3.4 with the other sign of K or of Ω.
    assert np.abs(found.logarithms - logarithms).max() < 1e-2
    assert np.abs(found.logarithms).max() > 1
    # Measured 1.6e-3 of -0.019: the densities of Remark 5 at the ends, ln(0.8/0.6)/2 over 50 s.
    assert found.spectra.sum() == pytest.approx(divergence, abs=3e-3)


def test_mujoco_has_the_unstable_limit_cycle_of_fig8() -> None:
    """It is found from a start 1e-3 rad away. A rotor that is 0.1 % faster has another cycle."""
    scene = rb.load_scene("fig08")
    (cycle,) = limit_cycles(scene.parameters)
    faster = scene.with_hinges(command={"rotor1": 1.001 * scene.hinges[1].rate})
    own, other = (
        contact_cycle(build(variant, rb.preset("fast")), cycle, parts=4)
        for variant in (scene, faster)
    )
    # Measured 9e-6 s and 2.9e-5 with steps of 20 ms; 2.7e-3 s for the other cycle.
    assert own.period == pytest.approx(cycle.period, abs=5e-5)
    assert own.multipliers[0].real == pytest.approx(cycle.multipliers[0].real, abs=1e-4)
    assert abs(other.period - cycle.period) > 1e-3
