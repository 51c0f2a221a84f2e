"""The flow near an equilibrium agrees with the motion, and so do its linear and cubic parts."""

import numpy as np
import pytest

from robotball.dynamics.equilibria import Flow, fixed_points, flow_near, linear_part, lyapunov_value
from robotball.robot import formulas as eq
from robotball.robot.formulas import Parameters, as_vector
from robotball.rotations import Array, rotation_matrix, tangents
from tests.figures import CHAOTIC, CLASSICAL, ball, from_rest, proposition_2

pytestmark = pytest.mark.core

POINT = fixed_points(from_rest(0.3))[0].gamma
M = np.array([1.0, -2.0, 0.5])


def rates_of(ball: Parameters, momentum: Array, gamma: Array) -> Array:
    """Return the rates of γ and M in frame axes (2, 3)."""
    omega = ball.angular_velocity(tuple(momentum), tuple(gamma))
    return np.array([eq.cross(tuple(gamma), omega), eq.cross(tuple(momentum), omega)])


@pytest.mark.parametrize("x", [(0.3, 0.0), (0.2, -0.4), (-0.7, 0.5)])
def test_the_flow_from_rest_moves_a_point_as_the_motion_does(x: tuple[float, float]) -> None:
    """Far from the fixed point: a step of γ, projected to the plane, by central differences.

    A coordinate is the intersection of the ray through γ with the plane. Measured 1e-11, the error
    of the difference.
    """
    ball, basis = from_rest(0.3), tangents(POINT)
    gamma = POINT + np.array(x) @ basis
    gamma = gamma / np.linalg.norm(gamma)
    step = 1e-5 * rates_of(ball, np.zeros(3), gamma)[0]
    ahead, behind = (basis @ (g / (g @ POINT)) for g in (gamma + step, gamma - step))
    assert np.abs(basis @ (gamma / (gamma @ POINT)) - x).max() < 1e-15
    expected = (ahead - behind) / 2e-5
    assert np.abs(flow_near(ball, POINT)(np.array(x)) - expected).max() < 1e-9
    assert np.abs(expected).max() > 0.05


@pytest.mark.parametrize("ball", [CHAOTIC, CLASSICAL])
def test_the_flow_of_rotations_moves_gamma_and_momentum_as_the_motion_does(
    ball: Parameters,
) -> None:
    """A rotation tan(θ/2) n moves both vectors, by central differences along the flow."""
    gamma, x = np.array([0.6, 0.0, 0.8]), np.array([0.2, -0.3, 0.1])

    def turned(y: Array) -> Array:
        q = np.array([1.0, *y]) / np.sqrt(1 + y @ y)
        return np.array([gamma, M]) @ rotation_matrix(q)

    rate = flow_near(ball, gamma, M)(x)
    moved = (turned(x + 1e-5 * rate) - turned(x - 1e-5 * rate)) / 2e-5
    expected = rates_of(ball, turned(x)[1], turned(x)[0])
    assert np.abs(moved - expected).max() < 3e-8  # measured 8e-9
    assert np.abs(rate).max() > 0.1


def normal_form(nu: float, value: float, bent: float) -> Flow:
    """Return ṙ = value r³, φ̇ = ν, with a third number that follows r² and acts back with `bent`."""

    def flow(x: Array) -> Array:
        a, b, c = x
        square = a * a + b * b
        return np.stack(
            [
                -nu * b + value * square * a + bent * c * a,
                nu * a + value * square * b + bent * c * b,
                square - 2 * c,
            ]
        )

    return flow


def in_curved_axes(flow: Flow) -> Flow:
    """Return the flow in coordinates y, x = y + squares, which change second derivatives."""
    squares = 0.1 * np.random.default_rng(3).normal(size=(3, 3, 3))

    def curved(y: Array) -> Array:
        rate = flow(y + np.einsum("ijk,j...,k...->i...", squares, y, y))
        slopes = np.einsum("ijk,k...->...ij", squares + squares.swapaxes(1, 2), y)
        rows = np.linalg.solve(np.eye(3) + slopes, np.moveaxis(rate, 0, -1)[..., None])
        return np.asarray(np.moveaxis(rows[..., 0], -1, 0))

    return curved


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("bent", [0.0, 0.8, -0.8])
def test_the_lyapunov_value_of_a_normal_form_is_exact(bent: float, curved: bool) -> None:
    """On the surface c ≈ r²/2 - ... dr/dt = (value + bent κ) r³, also in curved coordinates.

    κ follows from the surface's quadratic part: 2κ + its rate, which is zero on a circle, is 1.
    """
    flow = normal_form(1.7, -0.4, bent)
    flow = in_curved_axes(flow) if curved else flow
    linear = linear_part(flow, 3)
    assert np.abs(linear - [[0, -1.7, 0], [1.7, 0, 0], [0, 0, -2.0]]).max() < 1e-15
    # r depends on the scale of the unit eigenvector: r = |z|·2/√2.
    found = lyapunov_value(flow, 3)
    expected = (-0.4 + bent / 2) / 2
    assert found == pytest.approx(expected, rel=1e-9)


def test_the_lyapunov_value_of_a_slow_focus_agrees_with_the_closed_form() -> None:
    """B/(8a₃A₁A₂(A₁ + A₂)) from Proposition 2 at Γ₅, for 60 random balls; measured 4e-11.

    The closed form is from the formula for two real dimensions (Guckenheimer and Holmes,
    (3.4.11)), in which the cubic terms cancel. The amplitude is along a unit eigenvector.
    """
    rng, foci = np.random.default_rng(6), 0
    for _ in range(60):
        A, Omega, K = rng.uniform(0.2, 1.0, 3), rng.normal(size=3), np.zeros(3)
        K[2] = rng.uniform(-3.0, 3.0)
        parameters = ball(as_vector(A), as_vector(Omega), as_vector(K))
        A1, A2, B = proposition_2(parameters)
        if A1 * A2 > 0.01:
            expected = B / (8 * A[2] * A1 * A2 * (A1 + A2))
            found = lyapunov_value(flow_near(parameters, np.array([0.0, 0.0, 1.0])), 2)
            assert found == pytest.approx(expected, rel=1e-8)
            foci += 1
    assert foci > 30


def test_the_linear_part_is_the_derivative_of_the_flow() -> None:
    """Compared with central differences; its trace is the growth of volume in the coordinates."""
    flow = flow_near(from_rest(0.3), POINT)
    by_hand = np.stack([(flow(1e-6 * e) - flow(-1e-6 * e)) / 2e-6 for e in np.eye(2)], axis=1)
    assert np.abs(linear_part(flow, 2) - by_hand).max() < 1e-9
    assert np.abs(by_hand).max() > 0.1
