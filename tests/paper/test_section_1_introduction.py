"""Section 1, the introduction: Chaplygin's ball in both rolling models."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from robotball import integrate, sample_times, simulate
from robotball.dynamics.sections import (
    crossings_of_motion,
    period_of,
)
from robotball.fit.sensing import of_shell
from robotball.robot.scene import Start, along_momentum, section_state
from robotball.rotations import Array
from tests.invariant_curves import invariant_curve, shared_integral
from tests.paper import formulas as f
from tests.paper.engine_ball import DRIVEN, RUBBER, largest, mujoco_ball, mujoco_ball_of
from tests.paper.formulas import Errors, Numbers, cross, paper_scene, worst

BALL = f.with_A((0.8, 0.6, 0.7), np.zeros(3), np.zeros(3), d=0.9)
GAMMA, OMEGA = np.array([0.6, 0.48, 0.64]), np.array([3.0, -2.0, 1.0])  # in general position
TIMES = np.linspace(0.0, 20.0, 201)


def roll(n: Numbers, omega: Array, rubber: bool) -> tuple[Array, Array]:
    """Integrate (2.4), with λ₀ of (2.5) if `rubber`; ω and γ (201, 3)."""
    states = f.followed(f.unreduced(n, rubber), np.concatenate([omega, GAMMA]), TIMES)
    return states[:, :3], states[:, 3:]


def test_chaplygins_ball_keeps_its_energy() -> None:
    """Par. 2: T = (ω, Iω)/2 + mv²/2, v = -aγ×ω, d = ma²."""
    omega, gamma = roll(BALL, OMEGA, rubber=False)
    v = np.cross(gamma, omega)

    def change(sign: float) -> float:
        T = (omega @ BALL.I * omega).sum(axis=1) / 2 + sign * BALL.d * (v * v).sum(axis=1) / 2
        return float(np.ptp(T) / abs(T[0]))

    assert change(+1) <= 1e-10  # measured 9.3e-12: scipy
    assert change(-1) > 0.1  # control: the sign of d, 0.41


def test_chaplygins_ball_has_an_invariant_measure() -> None:
    """Par. 2: (1/d - (Aγ,γ))^(-1/2) dM dγ; the divergence of (3.3) times the density is 0."""

    def divergences(power: float) -> Errors:
        for state in f.states(11):
            n = replace(f.still(state.n), Omega=np.zeros(3), K=np.zeros(3))
            yield f.divergence(n, state.M, state.gamma, True, power)

    assert worst(divergences(-0.5)) <= 1e-14  # 1/s; measured 7e-16: rounding
    assert worst(divergences(+0.5)) > 0.1  # control: the exponent, 0.33


def test_with_vertical_momentum_chaplygins_ball_rotates_as_eulers_top() -> None:
    """Par. 2: M = cγ gives γ' = γ×Aγ in the time ct/(1 - d(Aγ,γ)); here c = 3."""
    c = 3.0
    omega = np.linalg.solve(f.contact_inertia(BALL, GAMMA), c * GAMMA).astype(float)
    gamma = roll(BALL, omega, rubber=False)[1]

    def error(sign: float) -> float:
        speed = c / (1 - sign * BALL.d * (BALL.A @ GAMMA @ GAMMA))
        return largest(gamma - f.followed(lambda x: speed * cross(x, BALL.A @ x), GAMMA, TIMES))

    assert error(+1) <= 4e-11  # measured 4.2e-12: scipy
    assert error(-1) > 0.5  # control: the sign of d, 1.8


def test_the_rubber_chaplygin_ball_keeps_its_energy() -> None:
    """Par. 3: (ω, A⁻¹ω)/2, as (ω, γ) = 0."""
    omega, _ = roll(BALL, f.level(OMEGA, GAMMA), rubber=True)

    def change(sign: float) -> float:
        T = (omega @ (BALL.I + sign * BALL.d * f.E) * omega).sum(axis=1) / 2
        return float(np.ptp(T) / abs(T[0]))

    assert change(+1) <= 1e-11  # measured 1.1e-12: scipy
    assert change(-1) > 0.05  # control: the sign of d, 0.12


def test_the_rubber_ball_of_E_over_d_minus_A_moves_on_the_tori_of_the_classical_ball_of_A() -> None:
    """Par. 3: along its motion the classical energy and integral, at its γ and M, are constant."""

    def changes(sign: float) -> Errors:
        rubber = f.with_A(tuple(1 / BALL.d - sign * BALL.moments), np.zeros(3), np.zeros(3))
        states = zip(*roll(rubber, f.level(OMEGA, GAMMA), rubber=True), strict=True)
        pairs = [(f.level(f.contact_inertia(rubber, v) @ w, v), v) for w, v in states]
        L, gamma = (np.array(rows) for rows in zip(*pairs, strict=True))
        E = np.array([M @ f.classical_velocity(BALL, M, v) / 2 for M, v in pairs])
        for kept in (E, shared_integral(f.ball(rubber), gamma, L)):
            yield np.ptp(kept) / abs(kept[0])

    assert worst(changes(+1)) <= 4e-11  # measured 3.9e-12: scipy
    assert worst(changes(-1)) > 0.02  # control: the sign of A, 0.043


@pytest.mark.slow
def test_both_chaplygin_balls_cross_the_section_on_the_same_curve_at_different_rates() -> None:
    """Par. 3: from the same (γ, ℓ), with ℓ = M×γ of the rubber ball and ℓ = M of the other."""

    def crossings(name: str, l: float, settings: str | None = None) -> Array:
        scene, (gamma, level) = paper_scene(name), section_state(0.0, l, 0.0, 25.0)
        rubber = scene.rolling == "rubber"
        start = along_momentum(gamma, np.cross(gamma, level) if rubber else level)
        scene, times = replace(scene, start=start), sample_times(210.0, 0.01)
        motion = (
            simulate(scene, times, settings=settings)
            if settings
            else integrate(scene, times, 1e-12)
        )
        if rubber:  # ℓ in place of M is as constant in space
            motion = replace(motion, momentum=np.cross(motion.momentum, [0.0, 0.0, 1.0]))
        return crossings_of_motion(motion, scene).only(1).states

    rubber, classical = "rubber_chaplygin_ball", "chaplygin_ball_same_tori"
    curve, ours = (invariant_curve(crossings(name, 0.5)) for name in (classical, rubber))
    assert (ours.rotation, curve.rotation) == pytest.approx((0.08697, 0.14492), abs=1e-5)
    points = cKDTree(curve.at(np.linspace(0.0, 1.0, 200_000)))

    def error(*of: Any) -> float:
        return float(np.max(points.query(crossings(*of))[0]))

    # Measured 1.6e-5 in both: half of the distance between two points of the curve.
    assert error(rubber, 0.5) < 3e-5
    assert error(rubber, 0.5, "fast") < 3e-5
    assert error(rubber, 0.4) > 0.1  # control: a start on another torus, 0.23


def test_the_windings_of_the_rubber_and_the_classical_ball_are_transversal() -> None:
    """Par. 3: at the same γ and M no two ω are parallel, along MuJoCo's rubber motion."""
    ball = mujoco_ball("rubber_chaplygin_ball")

    def least_sine(name: str) -> float:
        scene = paper_scene(name)
        classical = scene.rolling == "classical"
        n, velocity = f.numbers(scene.parameters), f.velocity_of(classical)
        momenta = np.cross(ball.momentum, ball.gamma) if classical else ball.momentum
        omega = np.array([velocity(n, *state) for state in zip(momenta, ball.gamma, strict=True)])
        sizes = np.linalg.norm(ball.omega, axis=1) * np.linalg.norm(omega, axis=1)
        return float((np.linalg.norm(np.cross(ball.omega, omega), axis=1) / sizes).min())

    assert least_sine("chaplygin_ball_same_tori") >= 0.05  # measured 0.096
    assert least_sine("rubber_chaplygin_ball") < 1e-10  # control: the rubber ball itself, 3e-16


def test_a_periodically_moving_mass_does_not_speed_up_the_ball_in_eleven_turns() -> None:
    """Par. 4, which asks it of other systems; docs/periodic.md has 10⁴ turns."""
    toy = paper_scene("beaver_ball")
    start = Start(toy.start.attitude, toy.momentum_of(np.array([8.0, 6.0, 0.0])))
    times = period_of(replace(toy, start=start)) * np.arange(12.0)

    def largest_speed(tilt: float) -> float:
        down = (np.sin(tilt), 0.0, -np.cos(tilt))
        scene = replace(toy, start=start, gravity_direction=down)
        return max(
            largest(of_shell(m)) for m in (integrate(scene, times, 1e-9), simulate(scene, times))
        )

    assert largest_speed(tilt=0.0) <= 20.0  # rad/s; measured 11.7
    assert largest_speed(tilt=0.05) > 30.0  # control: an inclined plane, 38.6


def test_with_constant_rates_the_motion_does_not_depend_on_time() -> None:
    """Par. 5: MuJoCo's ball started in the state at 3 s, with its hinges at zero."""

    def error(name: str) -> float:
        scene, whole = paper_scene(name), mujoco_ball(name)
        i = int(np.searchsorted(whole.motion.times, 3.0 - 1e-9))
        # A rubber ball's M is horizontal, which a start must satisfy exactly.
        start = Start(whole.motion.attitude[i], whole.motion.momentum[i] * [1.0, 1.0, 0.0])
        again = mujoco_ball_of(replace(scene, start=start), 5.0)
        return largest(again.gamma - whole.gamma[i : i + len(again.gamma)])

    assert error(RUBBER) <= 2e-8  # measured 2.3e-9: MuJoCo's contact
    assert error(DRIVEN) > 0.5  # control: oscillating rates, 1.3
