"""Lyapunov exponents: the reduced form against the full one, and the paper's numbers corrected."""

import numpy as np
import pytest

from robotball.engines.ensembles.orbits import Starts
from robotball.engines.ensembles.systems import DEVIATION
from robotball.equations import Parameters
from robotball.errors import InputError
from robotball.qualitative.long_run import exponents, kaplan_yorke
from robotball.qualitative.sections import section_starts
from robotball.rotations import Array, rotation_matrix
from tests.figures import CHAOTIC, CLASSICAL, REGULAR, F

pytestmark = pytest.mark.core

BALLS = [pytest.param(CHAOTIC, 0.0, id="rubber"), pytest.param(CLASSICAL, 3.0, id="classical")]


def some_starts(n: int, c: float = 0.0) -> tuple[Array, Array]:
    """Attitudes (n, 4) and momenta (n, 3) all over the section g = 0."""
    rng = np.random.default_rng(5)
    return section_starts(rng.uniform(-4, 4, n), rng.uniform(0, 6.28, n), F, c=c)


def level_state(attitude: Array, momentum: Array) -> Array:
    """(γ, M) (6,) in frame axes."""
    axes = rotation_matrix(attitude)
    return np.concatenate([axes[2], momentum @ axes])


def propagator(ball: Parameters, state: Array, times: Array) -> Array:
    """States with their 6×6 derivatives by the start (m, 42), by heyoka, from the 6 numbers."""
    hy = pytest.importorskip("heyoka")
    from validation.bench.kernels import level_equations

    equations = hy.var_ode_sys(level_equations(ball), hy.var_args.vars, order=1)
    ta = hy.taylor_adaptive(equations, state, compact_mode=True, tol=1e-16)
    return ta.propagate_grid(times)[5]


@pytest.mark.parametrize(("ball", "c"), BALLS)
def test_a_deviation_is_that_of_the_six_equations(ball: Parameters, c: float) -> None:
    """ξ and its growth after 20 s, against the full 6×6 propagator applied to (γ×ξ, M×ξ).

    Two integrations to round-off, of a deviation that grew by up to e^7: relative 3e-11.
    """
    attitudes, momenta = some_starts(1, c)
    starts = Starts(ball, attitudes, momenta)
    xi = np.array([0.6, 0.48, 0.64])
    end = starts.march(DEVIATION, np.array([[*xi, 0, 0]]), np.array([20.0]), 1e-14)[0][0, 0]
    begin = level_state(attitudes[0], momenta[0])
    full = propagator(ball, begin, np.array([0.0, 20.0]))[-1]
    pushed = full[6:].reshape(6, 6) @ np.concatenate([np.cross(v, xi) for v in begin.reshape(2, 3)])
    expected = np.concatenate([np.cross(v, end[4:7]) for v in full[:6].reshape(2, 3)])
    error = np.abs(np.exp(end[7]) * expected - pushed).max() / np.abs(pushed).max()
    assert error < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(("ball", "c"), BALLS)
def test_the_full_spectrum_is_the_reduced_one(ball: Parameters, c: float) -> None:
    """By QR of the 6×6 propagator over 1000 s: λ₁, four zeros, λ₆, and the sum is the divergence.

    A mean over 1000 s scatters by 0.01 (λ₁, λ₆ and the sum), and 0 is reached as ln T / T: 0.011.
    """
    attitudes, momenta = some_starts(8, c)
    state, basis, logs, steps = level_state(attitudes[0], momenta[0]), np.eye(6), np.zeros(6), 500
    hy = pytest.importorskip("heyoka")
    from validation.bench.kernels import level_equations

    equations = hy.var_ode_sys(level_equations(ball), hy.var_args.vars, order=1)
    ta = hy.taylor_adaptive(equations, state, compact_mode=True, tol=1e-10)
    for i in range(1, steps + 1):
        ta.state[6:] = np.eye(6).ravel()
        ta.propagate_until(2.0 * i)
        basis, triangle = np.linalg.qr(ta.state[6:].reshape(6, 6) @ basis)
        logs += np.log(np.abs(np.diag(triangle)))
    spectrum = np.sort(logs / (2.0 * steps))[::-1]
    reduced = exponents(ball, attitudes, momenta, duration=2000.0, transient=100.0)
    assert spectrum[0] == pytest.approx(reduced.mean[0], abs=0.04)
    assert np.abs(spectrum[1:5]).max() < 0.02
    assert spectrum[5] == pytest.approx(reduced.mean[1], abs=0.04)
    assert spectrum.sum() == pytest.approx(reduced.divergence.mean(), abs=0.04)


@pytest.mark.slow
def test_fig11b_has_a_strange_attractor() -> None:
    """λ₁ = 0.1160 ± 0.0005 and D = 1.832 ± 0.002, from 16 starts over 1e5 s each.

    Measured 0.1159 ± 0.0002 and 1.8320 ± 0.0011; the error is the chaos's own scatter.
    """
    result = exponents(CHAOTIC, *some_starts(16), duration=1e5)
    assert result.mean[0] == pytest.approx(0.1160, abs=0.0005)
    assert result.mean[1] == pytest.approx(-0.1394, abs=0.0005)
    assert result.dimension == pytest.approx(1.832, abs=0.002)
    assert result.error[0] < 0.0005
    assert result.dimension_error < 0.002


def test_the_classical_ball_is_chaotic_too() -> None:
    """λ₁ near 0.34, with a standard error below 2 %: measured 0.3389 ± 0.0010."""
    largest = exponents(CLASSICAL, *some_starts(16, 3.0), duration=1e4)
    assert largest.mean[0] == pytest.approx(0.339, abs=0.005)
    assert largest.error[0] < 0.02 * largest.mean[0]


def test_a_regular_ball_has_no_positive_exponent() -> None:
    """Fig. 11a: λ₁ = 0 on the cycle and on the torus, and volume shrinks on both.

    On the cycle by 2 ln 0.9281608 a period of 8.7432614 s, the product of its multipliers. λ₁
    falls as ln T / T: 6e-5 after 1e4 s.
    """
    cycle = exponents(REGULAR, *section_starts(3.6, 0.6, F), duration=1e4)
    torus = exponents(REGULAR, *section_starts(0.0, 1.96, F), duration=1e4)
    # The leading exponent of the flow on a cycle is the flow's own zero.
    assert cycle.largest[0] == pytest.approx(0.0, abs=1e-3)
    assert cycle.divergence[0] == pytest.approx(2 * np.log(0.9281608) / 8.7432614, abs=1e-4)
    assert torus.largest[0] == pytest.approx(0.0, abs=1e-3)
    assert torus.divergence[0] < -1e-4


def test_dimension_of_what_is_no_chaos() -> None:
    """1 + λ₁/|λ₆|; 2 for a flow that keeps its volume."""
    assert kaplan_yorke(0.1, -0.2) == 1.5
    assert kaplan_yorke(0.1, -0.1) == 2.0
    assert kaplan_yorke(-0.1, -0.2) == 0.0


def test_exponents_need_a_momentum() -> None:
    """M = 0 and durations of nothing are refused."""
    with pytest.raises(InputError, match="M other than zero"):
        exponents(REGULAR, np.eye(4)[:1], np.zeros((1, 3)), duration=10.0)
    with pytest.raises(InputError, match="positive"):
        exponents(REGULAR, *some_starts(1), duration=0.0)
