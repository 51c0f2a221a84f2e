"""Compiled orbits: agreement with `integrate`, invariants and refusals."""

import subprocess
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import robotball as rb
from robotball.errors import InputError
from robotball.robot.formulas import Parameters, speed_bound
from robotball.rotations import Array, rotation_matrix
from robotball.theory.ensembles.orbits import (
    COLLAPSED,
    TOO_MANY_STEPS,
    Starts,
    kernel_start,
    orbit,
    orbits,
)
from robotball.theory.ensembles.steppers import PATH
from tests.figures import BALLS, REGULAR, F, spread_starts
from tests.messages import naming
from tests.scenes import FOUR

pytestmark = pytest.mark.core

some_starts = partial(spread_starts, 7, g=1.0)

# Agreement ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FOUR)
def test_an_orbit_agrees_with_integrate(name: str) -> None:
    """Computed alone, and as one of many.

    Measured 2.2e-12 in γ and 4.3e-12 m in the path, the difference of two tolerances; 2e-14 between
    the two orbits, which take the same steps.
    """
    scene = rb.load_scene(name)
    parameters, attitudes, momenta = kernel_start(scene)
    times = np.linspace(0.0, 10.0, 501)
    motion = rb.integrate(scene, times)
    q, points = np.split(orbit(parameters, attitudes[0], momenta[0], times), [4], axis=1)
    gamma = rotation_matrix(q)[:, 2] @ scene.principal_axes.T
    assert np.abs(gamma - motion.gamma).max() < 2e-11
    assert np.abs(points - motion.contact_point).max() < 4e-11
    many = orbits(parameters, attitudes, momenta, times)
    assert np.abs(many.attitudes[0] - q).max() < 2e-13
    assert np.abs(many.contact_points[0] - points).max() < 2e-12


# Invariants --------------------------------------------------------------------------------


@pytest.mark.parametrize(("ball", "c"), BALLS)
def test_invariants_are_conserved_to_rounding(ball: Parameters, c: float) -> None:
    """γ², M² and (M, γ) after 3e4 s: measured 7e-16, because only the rotation is integrated.

    |ω| stays below the bound used for the step limits, within a factor of 10.
    """
    attitudes, momenta = some_starts(8, c)
    end = orbits(ball, attitudes, momenta, np.array([0.0, 3e4]), 1e-8).attitudes[:, 1]
    gamma, M = rotation_matrix(end)[:, 2], np.einsum("nij,ni->nj", rotation_matrix(end), momenta)
    assert np.abs(np.linalg.norm(end, axis=1) - 1).max() < 1e-15
    assert np.abs((gamma * gamma).sum(axis=1) - 1).max() < 2e-15
    assert np.abs((M * M).sum(axis=1) / F - 1).max() < 2e-15
    assert np.abs((M * gamma).sum(axis=1) - c).max() / np.sqrt(F) < 2e-15
    omega = np.array(ball.angular_velocity(tuple(M.T), tuple(gamma.T)))
    fastest, bound = np.linalg.norm(omega, axis=0).max(), speed_bound(ball, np.array([5.0]))[0]
    assert bound / 10 < fastest < bound


# Safety ------------------------------------------------------------------------------------


def test_an_orbit_that_fails_does_not_stop_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """An orbit ends at its step limit, or if its step length vanishes."""
    attitudes, momenta = some_starts(20)
    slow = momenta.copy()
    slow[3] *= 1e5  # rotates 1e5 times as fast as the limit assumes
    with monkeypatch.context() as limited:
        limited.setattr(Starts, "step_limit", lambda self, duration: 500)
        runs = orbits(REGULAR, attitudes, slow, np.array([0.0, 10.0]), 1e-9)
    assert runs.status[3] == TOO_MANY_STEPS
    assert np.isnan(runs.attitudes[3, 1]).all()
    assert np.isfinite(np.delete(runs.attitudes, 3, axis=0)).all()
    starts = Starts(REGULAR, attitudes, momenta)
    starts.rows[5] = np.nan
    status = starts.march(PATH, np.zeros((20, 2)), np.array([1.0]), 1e-9)[1]
    assert np.flatnonzero(status).tolist() == [5]
    assert status[5] == COLLAPSED


@pytest.mark.parametrize(
    ("attitudes", "momenta", "times", "message"),
    [
        (np.eye(4)[:1], np.array([[1.0, 0, 0.5]]), [0.0, 1], "horizontal"),
        (2 * np.eye(4)[:1], np.zeros((1, 3)), [0.0, 1], "unit"),
        (np.eye(4)[:1], np.zeros((2, 3)), [0.0, 1], "momenta"),
        (np.eye(4)[:1], np.full((1, 3), np.inf), [0.0, 1], "finite"),
        (np.eye(4)[:1], np.zeros((1, 3)), [0.0, 0.0], "increase"),
    ],
)
def test_unusable_starts_are_refused(
    attitudes: Array, momenta: Array, times: list[float], message: str
) -> None:
    """The error names the invalid property."""
    with pytest.raises(InputError, match=message):
        orbits(REGULAR, attitudes, momenta, np.array(times))


def test_a_momentum_is_horizontal_up_to_a_billionth() -> None:
    """Half of that passes as rounding; twice as much is refused, with either sign."""
    attitudes, times = np.eye(4)[:1], np.array([0.0, 1e-3])
    for sign in (2.0, -2.0):
        orbits(REGULAR, attitudes, np.array([[2.0, 0.0, 0.5e-9 * sign]]), times)
        with pytest.raises(InputError, match=naming("horizontal rubber")):
            orbits(REGULAR, attitudes, np.array([[2.0, 0.0, 2e-9 * sign]]), times)


def test_a_ball_at_rest_stays() -> None:
    """Zero M, Ω and K do not lead to a division by zero."""
    still = replace(REGULAR, Omega=(0.0, 0.0, 0.0), K=(0.0, 0.0, 0.0))
    run = orbits(still, np.eye(4)[:1], np.zeros((1, 3)), np.array([0.0, 1e6]))
    assert np.array_equal(run.attitudes[0, 1], [1.0, 0, 0, 0])
    assert np.array_equal(run.contact_points[0, 1], [0.0, 0.0])


def test_the_compiled_stepper_loads_from_its_cache() -> None:
    """A second process compiles neither the step nor the loops; loading takes 0.4 s."""
    code = (
        "from robotball.theory.ensembles import orbits, steppers\n"
        "step = steppers.stepper(steppers.PATH, 'rubber', orbits.FEW)\n"
        "compiled = [step, orbits.march_lanes.code, orbits.follow.code]\n"
        "print(sum(function.stats.cache_misses.total() for function in compiled))"
    )
    # This process cannot be the first: another test may have changed its cache folder.
    missed = [int(subprocess.check_output([sys.executable, "-c", code])) for _ in range(2)]
    assert missed[1] == 0
