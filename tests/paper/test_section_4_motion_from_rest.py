"""Section 4: motion from rest, M = 0, in the rubber model."""

from dataclasses import replace
from functools import cache

import numpy as np

from robotball.dynamics import equilibria
from robotball.robot.formulas import as_vector
from robotball.rotations import Array
from tests.paper import formulas as f
from tests.paper.engine_ball import INNER, largest, mujoco_ball, rate
from tests.paper.formulas import Errors, Numbers, worst


def test_from_rest_the_momentum_stays_zero_while_the_drives_speed_up() -> None:
    """Section 4: M of MuJoCo's bodies while Ω and K grow from 0."""
    ball = mujoco_ball("spin_up_from_rest")
    classical = ball.of(lambda n, omega, gamma: f.contact_inertia(n, gamma) @ omega + n.K)
    assert largest(ball.momentum) <= 2e-7  # kg m²/s; measured 1.9e-8: MuJoCo's contact
    assert largest(classical) > 1.0  # control: Ĩω + K without γ×, 3.6


def test_from_rest_gamma_follows_a_field_on_the_sphere() -> None:
    """(4.1): dγ/dt = γ×A(Zγ - K), along MuJoCo's motion; robotball's too."""
    ball = mujoco_ball("fig06")
    turning = rate(ball.gamma)

    def error(sign: float) -> float:
        field = ball.of(lambda n, _, gamma: f.from_rest(replace(n, K=sign * n.K))(gamma))
        return largest(turning - field[INNER])

    assert error(+1) <= 2e-7  # 1/s; measured 2.6e-8: MuJoCo's contact
    assert error(-1) > 0.05  # control: the sign of K, 0.18
    ours = ball.of(lambda n, _, gamma: np.array(equilibria.flow(f.ball(n), as_vector(gamma))))
    assert largest(turning - ours[INNER]) <= 2e-7


def test_from_rest_the_attitude_and_the_path_follow_from_gamma() -> None:
    """(4.2): dα/dt, dβ/dt, Ẋ and Ẏ with ω = A(Zγ - K), along MuJoCo's motion."""
    ball = mujoco_ball("fig06")
    alpha, beta, _ = ball.axes.transpose(1, 0, 2)

    def errors(sign: float) -> Errors:
        def velocity(n: Numbers, _: Array, gamma: Array) -> Array:
            Z = (n.Omega + n.A @ n.K) @ gamma / (n.A @ gamma @ gamma)
            return n.A @ (Z * gamma - sign * n.K)

        omega = ball.of(velocity)
        shell = ball.numbers[0].a * (omega - ball.numbers[0].Omega)
        yield ball.path_error((beta * shell).sum(axis=1), -(alpha * shell).sum(axis=1))
        for axis in (alpha, beta):
            yield rate(axis) - np.cross(axis, omega)[INNER]

    assert worst(errors(+1)) <= 2e-7  # 1/s and m/s; measured 2.7e-8: MuJoCo's contact
    assert worst(errors(-1)) > 0.05  # control: the sign of K, 0.18


def test_gamma_to_minus_gamma_is_a_symmetry_of_the_motion_from_rest() -> None:
    """Remark 6: the field of (4.1) is odd."""

    def errors(image: Array) -> Errors:
        for state in f.states(44):
            field, gamma = f.from_rest(state.n), state.gamma
            yield field(image * gamma) - image * field(gamma)

    assert worst(errors(np.array([-1.0, -1.0, -1.0]))) <= 1e-14  # 1/s; measured 0
    assert worst(errors(np.array([-1.0, 1.0, -1.0]))) > 1.0  # control: a reflection, 3.5


# Without a rotating frame, Ω = 0 --------------------------------------------------------------


@cache
def gyrostats(seed: int) -> list[tuple[Numbers, Array]]:
    """Return five random balls with Ω = 0, and a γ each."""
    balls = f.states(seed, 5)
    return [(replace(f.still(b.n), Omega=np.zeros(3), K=2 * b.n.K), b.gamma) for b in balls]


def test_without_rotation_of_the_frame_there_is_another_integral() -> None:
    """Section 4, Ω = 0: (AK,γ)²/(Aγ,γ), over 20 s of (2.4) and (2.5), which do not use (4.1)."""
    times, paths = np.linspace(0.0, 20.0, 41), []
    for n, gamma in gyrostats(41):
        start = np.append(f.rubber_velocity(n, np.zeros(3), gamma), gamma)
        paths.append((n, f.followed(f.unreduced(n, True), start, times, rtol=1e-10)[:, 3:]))

    def changes(power: float) -> Errors:
        for n, path in paths:
            yield np.ptp((path @ n.A @ n.K) ** 2 / ((path @ n.A * path).sum(axis=1)) ** power)

    assert worst(changes(+1)) <= 5e-8  # measured 6.7e-9: scipy
    assert worst(changes(-1)) > 0.1  # control: the power of (Aγ,γ), 0.53


def test_without_rotation_of_the_frame_all_trajectories_are_closed() -> None:
    """Section 4, Ω = 0: γ of (4.1) returns to its start within 60 s."""

    def misses(turning: float) -> Errors:
        for (n, gamma), other in zip(gyrostats(42), f.states(43), strict=False):
            field = f.from_rest(replace(n, Omega=turning * other.n.Omega))
            passed = f.returns(field, gamma, field(gamma), 60.0, rtol=1e-11)
            yield np.linalg.norm(passed - gamma, axis=1).min() if len(passed) else 2.0

    assert worst(misses(0.0)) <= 2e-11  # measured 1.8e-12: scipy
    assert worst(misses(1.0)) > 0.01  # control: Ω ≠ 0, 0.052
