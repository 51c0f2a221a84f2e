"""The motion by a second formulation, (2.4)-(2.5), and by a second integrator, heyoka's."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import robotball as rb
from robotball import equations as eq
from robotball.equations import Scalar, Vector, as_vector
from robotball.rotations import Array, conjugate, multiply, rotation_matrix
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


def test_momentum_is_constant_in_space_along_the_full_motion(
    scene: rb.Scene, full: FullMotion
) -> None:
    """M(ω, γ), turned into world axes, stays the start's: the full system does not know of M.

    Integration error of ω and the axes: at most 2.2e-12 kg m²/s of 5.
    """
    gamma = full.space_axes[:, 2, :]
    M = np.stack(scene.parameters.momentum(tuple(full.omega.T), tuple(gamma.T)), axis=1)
    M_world = np.einsum("nij,nj->ni", full.space_axes, M)
    assert np.abs(M_world - scene.start.momentum).max() < 1e-11


def test_shell_spins_on_the_spot_in_the_classical_model_only(
    scene: rb.Scene, full: FullMotion
) -> None:
    """(ω - Ω, γ) stays 0 in the rubber model, held by a spin torque λ₀; not in the classical."""
    gamma = full.space_axes[:, 2, :]
    spin = np.einsum("ni,ni->n", full.omega - scene.parameters.Omega, gamma)
    _, spin_torque = full_acceleration(scene, tuple(full.omega.T), tuple(gamma.T))
    if scene.rolling == "rubber":
        assert np.abs(spin).max() < 5e-12  # integration error, measured 1.3e-12 rad/s
        assert np.abs(spin_torque).max() > 1  # N m; measured 14 to 21
    else:
        assert np.abs(spin).max() > 1  # rad/s; measured 4.8
        assert spin_torque == 0


def test_an_independent_integrator_reaches_the_same_state(scene: rb.Scene) -> None:
    """heyoka's Taylor series of the same formulas end where `integrate` does, at 10 s."""
    hy = pytest.importorskip("heyoka", reason="heyoka is the extra `reference`, on Linux only")
    p = scene.parameters
    w, x, y, z, X, Y = hy.make_vars("w", "x", "y", "z", "X", "Y")
    alpha, beta, gamma = eq.space_axes((w, x, y, z))
    MX, MY, MZ = as_vector(scene.start.momentum)
    M = eq.add(eq.add(eq.scale(MX, alpha), eq.scale(MY, beta)), eq.scale(MZ, gamma))
    omega = p.angular_velocity(M, gamma)
    rates = (
        *eq.attitude_rate((w, x, y, z), omega),
        *eq.contact_velocity(alpha, beta, omega, p.Omega, p.a),
    )
    q0 = multiply(scene.start.attitude, scene.principal_quaternion)
    taylor = hy.taylor_adaptive(
        list(zip((w, x, y, z, X, Y), rates, strict=True)), [*q0, 0.0, 0.0], compact_mode=True
    )
    taylor.propagate_until(SECONDS)
    end = rb.integrate(scene, np.array([0.0, SECONDS]))
    axes = rotation_matrix(multiply(taylor.state[:4], conjugate(scene.principal_quaternion)))
    # DOP853's own error; measured 1.2e-13 (fig12) to 4.0e-12 m (classical_regular).
    assert np.abs(taylor.state[4:] - end.contact_point[-1]).max() < 1e-11
    # Measured 2.8e-13 to 2.1e-12.
    assert np.abs(axes - rotation_matrix(end.attitude[-1])).max() < 1e-11
