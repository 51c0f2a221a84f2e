"""Sections 3.1 and 3.2: momentum, reduced equations, integrals, energy and invariant measure."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from robotball import Scene, sample_times, simulate
from robotball.dynamics import straight_motions as lines
from robotball.robot import formulas as eq
from robotball.robot.formulas import Rolling
from robotball.robot.scene import along_momentum, section_state
from robotball.rotations import Array, on_circle, rotation_matrix, tangents
from robotball.theory.ensembles.orbits import kernel_start, orbit
from tests.paper import formulas as f
from tests.paper.captions import PERIOD
from tests.paper.engine_ball import (
    CLASSICAL,
    DRIVEN,
    RUBBER,
    BallMotion,
    largest,
    mujoco_ball,
    mujoco_ball_of,
)
from tests.paper.formulas import Errors, Numbers, Velocity, count, cross, paper_scene, worst

# M of MuJoCo's motions is off by 1e-8 (rubber) and 1e-6 kg m²/s (classical): the contact.
LEEWAY = {False: 2e-7, True: 4e-6}
BOTH = pytest.mark.parametrize("classical", [False, True], ids=["rubber", "classical"])


# The momentum --------------------------------------------------------------------------------


def rubber_momentum(n: Numbers, omega: Array, gamma: Array, sign: float = 1.0) -> Array:
    """Return γ×(Ĩω + K) of (3.1), or with -K."""
    return cross(gamma, f.contact_inertia(n, gamma) @ omega + sign * n.K)


def classical_momentum(n: Numbers, omega: Array, gamma: Array, sign: float = 1.0) -> Array:
    """Return Ĩω + K + d(Ω,γ)γ of section 3.2, or with - d(Ω,γ)γ."""
    return f.contact_inertia(n, gamma) @ omega + n.K + sign * n.d * (n.Omega @ gamma) * gamma


MOMENTA = {False: rubber_momentum, True: classical_momentum}


def test_the_momentum_of_the_rubber_ball_is_constant_in_space() -> None:
    """(3.1), E1: M = γ×(Ĩω + K). The paper prints -K."""
    ball = mujoco_ball(RUBBER)

    def drift(sign: float) -> float:
        return ball.drift(ball.of(lambda n, w, g: rubber_momentum(n, w, g, sign)))

    assert drift(+1) <= 2e-7  # kg m²/s; measured 2.5e-8: MuJoCo's contact
    assert drift(-1) > 1.0  # printed, and the control: 9.5


def test_the_momentum_of_the_classical_ball_is_constant_in_space() -> None:
    """3.2, E2: M = Ĩω + K + d(Ω,γ)γ. The paper prints - d(Ω,γ)γ."""
    ball = mujoco_ball(CLASSICAL)

    def drift(sign: float) -> float:
        return ball.drift(ball.of(lambda n, w, g: classical_momentum(n, w, g, sign)))

    assert drift(+1) <= 4e-6  # kg m²/s; measured 5.1e-7: MuJoCo's contact
    assert drift(-1) > 1.0  # printed, and the control: 6.4


def from_section(scene: Scene, rolling: Rolling, L: float, c: float = 0.0) -> Scene:
    """Start a ball at (L, l) = (L, 0.6) and g = 0 with f = 25 and (M, γ) = c."""
    gamma, M = section_state(L, 0.6, 0.0, 25.0, c)
    axes = scene.principal_axes
    return replace(scene, rolling=rolling, start=along_momentum(axes @ gamma, axes @ M))


@cache
def driven(classical: bool) -> BallMotion:
    """Roll the ball of Fig. 12 with oscillating rates; the classical ball with (M, γ) = 3."""
    if not classical:
        return mujoco_ball(DRIVEN)
    return mujoco_ball_of(from_section(paper_scene(DRIVEN), "classical", 3.6, c=3.0), 10.0)


@BOTH
def test_the_momentum_is_that_of_the_bodies(classical: bool) -> None:
    """(3.1) and 3.2: the momentum of MuJoCo's bodies while Ω and K change; robotball's too."""
    ball, momentum = driven(classical), MOMENTA[classical]

    def error(sign: float) -> float:
        return largest(
            ball.of(lambda n, *of: momentum(replace(n, d=sign * n.d), *of)) - ball.momentum
        )

    assert error(+1) <= LEEWAY[classical]  # kg m²/s; measured 2.1e-8 and 5.1e-7
    assert error(-1) > 1.0  # control: the sign of d, 9.9 and 9.1
    ours = ball.of(lambda n, w, gamma: np.array(f.ball(n, classical).momentum(w, gamma)))
    assert largest(ours - ball.momentum) <= LEEWAY[classical]


@BOTH
def test_the_momentum_stays_constant_while_the_rates_change(classical: bool) -> None:
    """3.1 and 3.2: for any Ω(t) and K(t)."""
    ball, momentum = driven(classical), MOMENTA[classical]
    first = ball.numbers[0].K
    assert ball.drift(ball.of(momentum)) <= LEEWAY[classical]  # measured 3.1e-8 and 6.6e-7
    # Control: with the K of the start, 1.2 and 1.3.
    assert ball.drift(ball.of(lambda n, *of: momentum(replace(n, K=first), *of))) > 0.5


def test_the_horizontal_angular_momentum_is_the_momentum_turned_by_a_right_angle() -> None:
    """Not in the paper: M×γ is the horizontal part of L = Ĩω + K + d(Ω,γ)γ."""
    ball = mujoco_ball(RUBBER)
    turned = np.cross(ball.momentum, ball.gamma)
    L = ball.of(lambda n, w, g: f.level(f.contact_inertia(n, g) @ w + n.K, g))
    assert largest(turned - L) <= 2e-7  # kg m²/s; measured 1.5e-8: MuJoCo's contact
    assert largest(-turned - L) > 1.0  # control: the sign of M, 10


# The reduced equations -----------------------------------------------------------------------


def test_the_rubber_velocity_solves_the_definition_of_the_momentum() -> None:
    """(3.2): ω(M, γ) solves (3.1) and (2.2); robotball's too."""

    def errors(sign: float) -> Errors:
        for state in f.states(31):
            n, gamma, M = state.n, state.gamma, state.momentum(classical=False)
            # Four consistent equations for three unknowns: γ×(…) has no component along γ.
            linear = np.vstack([f.hat(gamma).T @ f.contact_inertia(n, gamma), gamma])
            right = np.append(M - cross(gamma, n.K), n.Omega @ gamma)
            omega = np.linalg.lstsq(linear, right, rcond=None)[0]
            yield f.rubber_velocity(replace(n, Omega=sign * n.Omega), M, gamma) - omega
            yield (sign > 0) * (f.ball(n).angular_velocity(M, gamma) - omega)

    assert worst(errors(+1)) <= 1e-13  # rad/s; measured 1.7e-14: rounding
    assert worst(errors(-1)) > 1.0  # control: the sign of Ω, 5.1


def test_the_classical_velocity_solves_the_definition_of_the_momentum() -> None:
    """(3.3): ω(M, γ) solves M = Ĩω + K + d(Ω,γ)γ; robotball's too."""

    def errors(sign: float) -> Errors:
        for state in f.states(34):
            n, gamma = state.n, state.gamma
            right = state.M - n.K - n.d * (n.Omega @ gamma) * gamma
            omega = np.linalg.solve(f.contact_inertia(n, gamma), right)
            yield f.classical_velocity(replace(n, Omega=sign * n.Omega), state.M, gamma) - omega
            ours = f.ball(n, classical=True).angular_velocity(state.M, gamma)
            yield (sign > 0) * (ours - omega)

    assert worst(errors(+1)) <= 3e-14  # rad/s; measured 4.9e-15: rounding
    assert worst(errors(-1)) > 1.0  # control: the sign of Ω, 11


def velocity_error(classical: bool, velocity: Velocity, sign: float = 1.0) -> float:
    """Compare ω(M, γ) at the initial M with MuJoCo's ω while the rates change."""
    ball = driven(classical)
    states = zip(ball.numbers, ball.carried(ball.momentum), ball.gamma, strict=True)
    return largest(np.array([velocity(n, sign * M, g) for n, M, g in states]) - ball.omega)


def test_the_rubber_balls_reduced_system_is_3_2() -> None:
    """(3.2), along MuJoCo's motion."""
    assert velocity_error(False, f.rubber_velocity) <= 2e-7  # rad/s; measured 2.5e-8: contact
    assert velocity_error(False, f.rubber_velocity, -1) > 1.0  # control: the sign of M, 7.9


def test_the_classical_balls_reduced_system_is_3_3() -> None:
    """Remark 5, 3.2, 3.3, E5. The paper prints "the autonomous system of equations (3.2)"."""
    assert velocity_error(True, f.classical_velocity) <= 4e-6  # rad/s; measured 5.6e-7: contact
    assert velocity_error(True, f.rubber_velocity) > 1.0  # printed: 12
    assert velocity_error(True, f.classical_velocity, -1) > 1.0  # control: the sign of M, 18


@pytest.mark.parametrize(("name", "c"), [("fig14", 0.0), (CLASSICAL, 3.0)])
def test_the_reduced_equations_have_three_integrals(name: str, c: float) -> None:
    """3.1 and 3.2: γ², (M, γ) and M² over 20 s; c = (M, γ)."""
    scene = paper_scene(name)
    gamma, M = section_state(0.0, 0.6, 0.0, 25.0, c)
    rate = f.reduced(f.velocity_of(scene.rolling == "classical"), f.numbers(scene.parameters))

    def change(sign: float) -> float:
        sense = np.repeat([sign, 1.0], 3)
        times = np.linspace(0.0, 20.0, 101)
        states = f.followed(lambda x: sense * rate(x), np.concatenate([M, gamma]), times)
        M_t, gamma_t = states[:, :3] / 5.0, states[:, 3:]  # |M| = 5
        return worst(
            np.ptp((u * v).sum(1)) for u, v in ((gamma_t,) * 2, (M_t, gamma_t), (M_t,) * 2)
        )

    assert change(+1) <= 1e-10  # measured 1.1e-11 and 6.7e-12: scipy
    assert change(-1) > 0.5  # control: the sign of dM/dt, 0.99 and 2.0


@BOTH
def test_the_common_level_of_the_integrals_has_three_dimensions(classical: bool) -> None:
    """3.1 and 3.2: the gradients of F₀, F₁, F₂ are independent."""

    def dependent(size: float) -> Errors:
        for state in f.states(32):
            gradients = f.integral_gradients(size * state.momentum(classical), state.gamma)
            yield np.linalg.matrix_rank(gradients, tol=1e-9) < 3

    assert count(dependent(1.0)) == 0  # of 100
    assert count(dependent(0.0)) == 100  # control: M = 0, the sphere of section 4


# Energy and measure --------------------------------------------------------------------------


def energies(ball: BallMotion, classical: bool, sign: float = 1.0) -> Array:
    """Return (ω, A⁻¹ω)/2 - (Ω, A⁻¹ω), less d(γ, ω-Ω)²/2 for the classical ball, at all times."""

    def energy(n: Numbers, omega: Array, gamma: Array) -> float:
        carried = (n.I + n.d * f.E) @ omega
        spin = gamma @ (omega - n.Omega) if classical else 0.0
        return float(omega @ carried / 2 - sign * n.Omega @ carried - n.d * spin**2 / 2)

    return ball.of(energy)


def rubber_routh() -> Scene:
    """Return Routh's sphere in the rubber model."""
    return from_section(paper_scene("routh_sphere"), "rubber", 3.0)


@cache
def routh(classical: bool) -> BallMotion:
    """Roll Routh's sphere; all that rotates does so about its axis of symmetry."""
    return mujoco_ball("routh_sphere") if classical else mujoco_ball_of(rubber_routh(), 10.0)


def test_energy_is_no_integral_in_general() -> None:
    """Remark 5: E of MuJoCo's ball of Fig. 12 changes."""
    assert np.ptp(energies(mujoco_ball(RUBBER), classical=False)) > 1.0  # J; measured 27
    assert np.ptp(energies(routh(False), classical=False)) < 1e-5  # control: Routh's sphere, 2e-7


@BOTH
def test_energy_is_an_integral_of_rouths_sphere(classical: bool) -> None:
    """Remark 5: A, Ω and K have a common axis."""
    change = np.ptp(energies(routh(classical), classical))
    assert change <= 2e-6  # J; measured 1.9e-7 and 3.5e-7: MuJoCo's contact
    assert np.ptp(energies(routh(classical), classical, -1)) > 1.0  # control: (Ω, A⁻¹ω), 8.6, 15


@pytest.mark.parametrize(("name", "bound"), [(RUBBER, 1.5e-6), (CLASSICAL, 1e-5)])
def test_energy_changes_by_the_power_of_the_drives(name: str, bound: float) -> None:
    """Not in the paper: dE/dt = -(Ω, (A⁻¹ω + K)×ω), along MuJoCo's motion; robotball's E too."""
    ball, classical = mujoco_ball(name), name == CLASSICAL
    n, omega, gamma = ball.numbers[0], tuple(ball.omega.T), tuple(ball.gamma.T)
    ours = eq.energy(omega, gamma, tuple(n.Omega), tuple(n.moments), n.d, spinning=classical)

    def error(E: Array, sign: float) -> float:
        power = ball.of(lambda n, w, _: -n.Omega @ cross((n.I + n.d * f.E) @ w + sign * n.K, w))
        return largest(E - E[0] - cumulative_simpson(power, x=ball.motion.times, initial=0))

    assert error(energies(ball, classical), +1) <= bound  # J; measured 1.9e-7, 1.6e-6: contact
    assert error(np.array(ours), +1) <= bound
    assert error(energies(ball, classical), -1) > 10.0  # control: the sign of K, 34 and 90


@BOTH
def test_rouths_sphere_has_an_invariant_measure(classical: bool) -> None:
    """Remark 5: (Aγ,γ)^(-1/2) dM dγ for rubber, (1/d - (Aγ,γ))^(-1/2) dM dγ for classical."""

    def divergences(power: float) -> Errors:
        for state in f.states(33):
            n, along = f.still(state.n), f.E[2]
            n = replace(
                n, I=np.diag(n.I[[0, 0, 2], [0, 0, 2]]), Omega=n.Omega * along, K=n.K * along
            )
            yield f.divergence(n, state.momentum(classical), state.gamma, classical, power)

    assert worst(divergences(-0.5)) <= 1e-14  # 1/s; measured 9e-16 and 1.1e-15: rounding
    assert worst(divergences(+0.5)) > 0.1  # control: the exponent, 0.44 and 0.26


@BOTH
def test_robotballs_divergence_is_that_of_the_reduced_equations(classical: bool) -> None:
    """Not in the paper: how fast any ball changes the density of Remark 5."""

    def errors(sign: float) -> Errors:
        for state in f.states(33):
            n, M = f.still(state.n), state.momentum(classical)
            divergence = f.divergence(n, M, state.gamma, classical, -0.5)
            yield divergence - sign * f.ball(n, classical).divergence(state.gamma)

    assert worst(errors(+1)) <= 1e-14  # 1/s; measured 1.1e-15: rounding
    assert worst(errors(-1)) > 0.1  # control: the sign, 0.65 and 0.35


def test_there_is_no_invariant_measure_with_a_continuous_density_in_general() -> None:
    """3.1: with one, volume near a periodic motion would be the same after a period."""

    def change(scene: Scene) -> float:
        """Return |ln det| of the flow over a period of Fig. 11a's cycle."""
        n = f.numbers(scene.parameters)
        # Fig. 12's motion is on the cycle after 600 s, to 1e-9.
        times = np.append(0.0, 600.0 + np.linspace(0.0, PERIOD, 201))
        parameters, attitude, momentum = kernel_start(scene)
        axes = rotation_matrix(orbit(parameters, attitude[0], momentum[0], times)[1:-1, :4])
        growth = [f.divergence(n, momentum[0] @ S, S[2], False, -0.5) for S in axes]
        return abs(float(np.mean(growth))) * PERIOD

    assert change(paper_scene(RUBBER)) >= 0.1  # measured 0.149
    assert change(rubber_routh()) < 1e-10  # control: Routh's sphere, which has a measure, 6e-16


# Symmetries and straight lines, which the paper does not mention -----------------------------


def full_rates(n: Numbers, velocity: Velocity, M: Array, gamma: Array) -> Array:
    """Return dM/dt, dγ/dt and (Ẋ, Ẏ) of section 3.3 (8,)."""
    omega, c = velocity(n, M, gamma), M @ gamma
    shell = n.a * (omega - n.Omega) / np.sqrt(M @ M - c * c)
    path = [cross(M, gamma) @ shell, (M - c * gamma) @ shell]
    return np.concatenate([cross(M, omega), cross(gamma, omega), path])


@BOTH
def test_the_motion_is_reversible_if_one_component_of_both_momenta_is_zero(classical: bool) -> None:
    """Not in the paper: Ωᵢ = Kᵢ = 0 gives (γ, M, t) → (Dγ, ∓DM, -t), - for rubber."""
    sign = 1.0 if classical else -1.0
    velocity = f.velocity_of(classical)

    def errors(other: float) -> Errors:
        D = np.array([1.0, -other, 1.0])
        for state in f.states(91):
            n = replace(f.still(state.n), Omega=state.n.Omega * [1, 0, 1], K=state.n.K * [1, 0, 1])
            M = state.momentum(classical)
            here = full_rates(n, velocity, M, state.gamma)
            there = full_rates(n, velocity, sign * D * M, D * state.gamma)
            yield from (there[:3] + sign * D * here[:3], there[3:6] + D * here[3:6])

    assert worst(errors(+1)) <= 1e-14  # measured 0
    assert worst(errors(-1)) > 1.0  # control: no reflection, 7.6 and 14


def test_reversing_gamma_and_the_momentum_reverses_only_the_sideways_velocity() -> None:
    """Not in the paper: (γ, M) → (-γ, -M) keeps Ẋ and reverses Ẏ."""

    def errors(sign: float) -> Errors:
        image = np.array([*[-1.0] * 6, 1.0, -sign])
        for state in f.states(92):
            n, M = f.still(state.n), state.momentum(classical=False)
            here = full_rates(n, f.rubber_velocity, M, state.gamma)
            yield full_rates(n, f.rubber_velocity, -M, -state.gamma) - here * image

    assert worst(errors(+1)) <= 1e-14  # measured 0
    assert worst(errors(-1)) > 1.0  # control: the sign of Ẏ, 7.5


def test_the_classical_ball_rolls_straight_if_the_momentum_is_that_of_the_drives() -> None:
    """Not in the paper: M = K + d(Ω,γ)γ rolls at a|γ×Ω|; MuJoCo, 5 s."""
    scene, gamma = paper_scene(CLASSICAL), np.array([0.6, 0.48, 0.64])
    n = f.numbers(scene.parameters)

    def error(sign: float) -> float:
        M = n.K + sign * n.d * (n.Omega @ gamma) * gamma
        ball = replace(scene, start=along_momentum(gamma, M))
        distance = np.linalg.norm(simulate(ball, sample_times(5.0)).contact_point[-1])
        return abs(float(distance - 5.0 * n.a * np.linalg.norm(cross(gamma, n.Omega))))

    assert error(+1) <= 2e-12  # m; measured 1.3e-13: rounding
    assert error(-1) > 0.5  # control: the sign of d, 2.2


def test_all_straight_lines_of_the_classical_ball_are_found() -> None:
    """Not in the paper: for right f and c, on the circle (K + dΩ, γ) = c."""
    turn = np.linspace(0.0, 2 * np.pi, 20001)

    def wrong(sign: float) -> Errors:
        for state in f.states(93, 50):
            n = f.still(state.n)
            M = n.K + n.d * (n.Omega @ state.gamma) * state.gamma
            level, c, axis = float(M @ M), float(M @ state.gamma), n.K + n.d * n.Omega
            foot = c * axis / (axis @ axis)
            across = tangents(f.unit(axis))
            circle = foot + np.sqrt(1 - foot @ foot) * on_circle(across, turn)
            along = sign * n.d * (circle @ n.Omega)
            off = ((n.K + along[:, None] * circle) ** 2).sum(axis=1) - level
            meets = circle[:-1][off[1:] * off[:-1] < 0]
            ours = lines.straight_motions(f.ball(n, classical=True), level, c)
            apart = np.array([np.linalg.norm(meets - line.gamma, axis=1) for line in ours])
            # Equal in number, and line within a step of the circle from a meeting.
            near = all((apart.min(axis=i) < turn[1]).all() for i in (0, 1)) if apart.size else False
            yield len(ours) != len(meets) or not near

    assert count(wrong(+1)) == 0  # of 50
    assert count(wrong(-1)) > 40  # control: the sign of d, 50


@pytest.mark.parametrize("gamma", [[0.6, 0.48, 0.64], [-0.8, 0.36, -0.48], [0.48, -0.8, 0.36]])
def test_the_exponents_of_a_classical_straight_line_add_up_to_the_divergence(
    gamma: list[float],
) -> None:
    """Not in the paper: Σλ = (Aγ, γ×Ω)/(1/d - (Aγ,γ)), where ω = 0."""
    ball, at = paper_scene(CLASSICAL).parameters, np.array(gamma)
    n = f.numbers(ball)
    divergence = n.A @ at @ cross(at, n.Omega) / (1 / n.d - n.A @ at @ at)
    total = lines.straight_motion(ball, at).eigenvalues.sum().real
    assert abs(total - divergence) <= 2e-14  # 1/s; measured 4.3e-15: rounding
    assert abs(total + divergence) > 0.05  # control: the sign, 0.58 and more
