"""The compiled stepper: its order, its agreement with others, its invariants, its safety."""

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.engines.ensembles import steppers
from robotball.engines.ensembles.flatten import LANES, Dual, Tape, lane_function
from robotball.engines.ensembles.orbits import (
    COLLAPSED,
    TOO_MANY_STEPS,
    Starts,
    kernel_start,
    orbit,
    orbits,
)
from robotball.engines.ensembles.steppers import EIGHTH, NINTH, PATH, STAGES, Level, State
from robotball.equations import Parameters, speed_bound
from robotball.errors import InputError
from robotball.rotations import Array, rotation_matrix
from tests.figures import BALLS, REGULAR, F, spread_starts
from tests.scenes import FOUR

pytestmark = pytest.mark.core

some_starts = partial(spread_starts, 7, g=1.0)

# The step ----------------------------------------------------------------------------------


def sample(x: Any, y: Any) -> tuple[Any, Any]:
    """Every operation that functions of symbols and of dual numbers may use."""
    z = (x - 2) * y / (1 + x * y) - x * y / 2 + 0 * x
    return -z + (3 - x) * (2 / y - x), 1 * y + 0


def test_traced_code_and_dual_numbers_are_the_function_and_its_derivative() -> None:
    """A function, the code traced from it, and its slope by central differences.

    The products of the code are commuted. Measured 4.5e-11 of the slope, the difference's rounding.
    """
    tape = Tape(LANES)
    results = sample(tape.read(0), tape.read(1))
    names: dict[str, Any] = {"wide_vectors": lambda: None}
    exec(lane_function("compute", tape, dict(enumerate(results, start=2))), names)
    w = np.linspace(0.5, 3.0, 4 * LANES)
    names["compute"](w)
    x, y, *found = w.reshape(4, LANES)
    expected = sample(x, y)
    assert np.abs(found[0] - expected[0]).max() < 1e-15
    assert np.array_equal(found[1], expected[1])
    moving = sample(Dual(x, 0.6), Dual(y, -0.8))
    for i in range(2):
        ahead, behind = (sample(x + h * 0.6, y - h * 0.8)[i] for h in (1e-5, -1e-5))
        assert np.abs(moving[i].value - expected[i]).max() < 1e-15
        assert np.abs(moving[i].slope - (ahead - behind) / 2e-5).max() < 2e-10


def test_the_step_and_its_estimate_are_of_order_9() -> None:
    """The error of fixed steps falls as their ninth power: measured 9.3, the estimated one 9.0."""
    attitudes, momenta = some_starts(1)
    level = Level(m=float(np.linalg.norm(momenta)), c=0.0)
    begin = [*Starts(REGULAR, attitudes, momenta).attitudes[0], 0.0, 0.0]

    def rate(state: State) -> State:
        return PATH.rate(state, REGULAR, level)

    def end(steps: int) -> tuple[Array, float]:
        state, per_squared = begin, []
        for _ in range(steps):
            state, each = steppers.runge_kutta(rate, state, rate(state), 2.0 / steps, PATH.allowed)
            per_squared.append(each)
        return np.array(state), float(max(per_squared)) ** -0.5

    def order(errors: list[float]) -> float:
        return float(-np.polyfit(np.log(steps), np.log(errors), 1)[0])

    steps, right = np.array([20, 28, 40]), end(120)[0]
    assert order([np.abs(end(n)[0] - right).max() for n in steps]) == pytest.approx(9, abs=0.4)
    assert order([end(n)[1] for n in steps]) == pytest.approx(9, abs=0.2)


@pytest.mark.parametrize(("weights", "order"), [(NINTH, 9), (EIGHTH, 8)])
def test_verners_numbers_satisfy_the_conditions_of_their_order(
    weights: tuple[float, ...], order: int
) -> None:
    """Quadrature of every power below the order, and no other; and the stages' own: to rounding.

    In fractions, so that what is left is the rounding of the numbers, and of no sum.
    """
    rows = [(*row, *[0.0] * (16 - len(row))) for row in ((), *STAGES)]
    A = np.array([[Fraction(each) for each in row] for row in rows])
    c, b = A.sum(axis=1), np.array([Fraction(each) for each in weights])
    gaps = np.array([b @ c**k - Fraction(1, k + 1) for k in range(order + 1)])
    assert np.abs(gaps[:-1]).max() < 2e-15  # 1.3e-15
    assert abs(gaps[-1]) > 1e-6
    # Stages: order 2 from the third on, order 3 from the fourth; those of less have no weight.
    assert np.abs((A @ c - c**2 / 2)[2:]).max() < 5e-15  # 3.3e-15
    assert np.abs((A @ c**2 - c**3 / 3)[3:]).max() < 6e-15  # 4.8e-15
    assert np.abs(b[1:3]).max() == 0
    assert np.abs(b @ A - b * (1 - c)).max() < 1e-15  # 4.9e-16


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
    q, points = orbit(parameters, attitudes[0], momenta[0], times)
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


def test_a_ball_at_rest_stays() -> None:
    """With M, Ω and K zero nothing moves, and no step length is divided by zero."""
    still = replace(REGULAR, Omega=(0.0, 0.0, 0.0), K=(0.0, 0.0, 0.0))
    run = orbits(still, np.eye(4)[:1], np.zeros((1, 3)), np.array([0.0, 1e6]))
    assert np.array_equal(run.attitudes[0, 1], [1.0, 0, 0, 0])
    assert np.array_equal(run.contact_points[0, 1], [0.0, 0.0])


@pytest.mark.slow
def test_the_compiled_stepper_loads_from_its_cache() -> None:
    """After one process the next compiles nothing: step and loops come from the cache, in 0.4 s."""
    code = (
        "from robotball.engines.ensembles import orbits, steppers\n"
        "step = steppers.stepper(steppers.PATH, 'rubber', orbits.FEW)\n"
        "compiled = [step, orbits._march_lanes.code, orbits._follow.code]\n"
        "print(sum(each.stats.cache_misses.total() for each in compiled))"
    )
    # Not this process is the first: what it has may be in the cache of another test.
    missed = [int(subprocess.check_output([sys.executable, "-c", code])) for _ in range(2)]
    assert missed[1] == 0
