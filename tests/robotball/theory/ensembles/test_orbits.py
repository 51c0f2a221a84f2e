"""Compiled motions: their agreement with others, their invariants, their safety."""

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
def test_a_scene_moves_as_by_integrate(name: str) -> None:
    """One orbit, closely sampled, is `integrate`'s motion, and one of many orbits is that orbit.

    γ 2.2e-12 and path 4.3e-12 m, the difference of two tolerances; the lanes 2e-14, for they take
    the same steps.
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
def test_invariants_are_kept_to_rounding(ball: Parameters, c: float) -> None:
    """γ², M² and (M, γ) after 3e4 s: measured 7e-16, for only the rotation is integrated.

    |ω| stays below the bound that the step limits rest on, and comes within a factor 10.
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


def test_an_orbit_that_is_given_up_holds_up_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Past its step limit, or with a step that shrank to nothing, an orbit ends; the rest go on."""
    attitudes, momenta = some_starts(20)
    slow = momenta.copy()
    slow[3] *= 1e5  # turns 1e5 times as fast as what the limit is made for
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
    """Each with a line that says what is wrong."""
    with pytest.raises(InputError, match=message):
        orbits(REGULAR, attitudes, momenta, np.array(times))


def test_a_momentum_counts_as_horizontal_up_to_a_billionth_of_it() -> None:
    """Less is rounding and is let pass; twice as much is refused, of either sign."""
    attitudes, times = np.eye(4)[:1], np.array([0.0, 1e-3])
    for sign in (2.0, -2.0):
        orbits(REGULAR, attitudes, np.array([[2.0, 0.0, 0.5e-9 * sign]]), times)
        with pytest.raises(InputError, match=naming("horizontal rubber")):
            orbits(REGULAR, attitudes, np.array([[2.0, 0.0, 2e-9 * sign]]), times)


def test_a_ball_at_rest_stays() -> None:
    """With M, Ω and K zero nothing moves, and no step length is divided by zero."""
    still = replace(REGULAR, Omega=(0.0, 0.0, 0.0), K=(0.0, 0.0, 0.0))
    run = orbits(still, np.eye(4)[:1], np.zeros((1, 3)), np.array([0.0, 1e6]))
    assert np.array_equal(run.attitudes[0, 1], [1.0, 0, 0, 0])
    assert np.array_equal(run.contact_points[0, 1], [0.0, 0.0])


def test_the_compiled_stepper_loads_from_its_cache() -> None:
    """After one process the next compiles nothing: step and loops come from the cache, in 0.4 s."""
    code = (
        "from robotball.theory.ensembles import orbits, steppers\n"
        "step = steppers.stepper(steppers.PATH, 'rubber', orbits.FEW)\n"
        "compiled = [step, orbits.march_lanes.code, orbits.follow.code]\n"
        "print(sum(each.stats.cache_misses.total() for each in compiled))"
    )
    # Not this process is the first: what it has may be in the cache of another test.
    missed = [int(subprocess.check_output([sys.executable, "-c", code])) for _ in range(2)]
    assert missed[1] == 0
