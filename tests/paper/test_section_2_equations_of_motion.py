"""Section 2: the system, its constraints and energy, and the equations of motion."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from robotball import sample_times, simulate
from robotball.robot import formulas as eq
from robotball.robot.ball import Frame
from robotball.robot.formulas import as_vector
from robotball.robot.scene import Start
from robotball.rotations import Array, from_matrix, multiply
from tests.paper import formulas as f
from tests.paper.engine_ball import (
    CLASSICAL,
    DRIVEN,
    EACH,
    INNER,
    RUBBER,
    BallMotion,
    largest,
    mujoco_ball,
    mujoco_ball_of,
    rate,
)
from tests.paper.formulas import Errors, Numbers, cross, paper_scene, worst
from tests.paper.point_masses import Moment, moments, rolled

# Bounds of MuJoCo's motion: the contact leaves 1e-8; rates from finite differences, 1e-6 and more.


def test_the_inertia_is_constant_in_the_frames_axes() -> None:
    """Section 2, of balls of point masses whose shell and rotors rotate for 0.3 s."""

    def changes(time: float) -> Errors:
        for moment in moments(21):
            ball = moment.ball.turned(0.3)
            axes = f.turned_about(ball.shell.axis, ball.shell.rate * time)
            yield axes.T @ ball.inertia(np.zeros(3)) @ axes - moment.ball.inertia(np.zeros(3))

    assert worst(changes(time=0.0)) <= 3e-15  # kg m²; measured 3e-16: rounding
    assert worst(changes(time=0.3)) > 0.05  # control: in the shell's axes, 0.090


def test_the_space_axes_stay_orthonormal() -> None:
    """Remark 1: (2.6) and dγ/dt = γ×ω for any ω(t), 10 s."""
    swing = np.array([3.0, -2.0, 1.0])  # an ω(t) of no ball, without conserved quantities

    def error(sign: float) -> float:
        def field(x: Array) -> Array:
            omega = swing * np.cos(swing * x[9])
            rows = [cross(v, omega) for v in x[:9].reshape(3, 3)]
            return np.concatenate([rows[0], sign * rows[1], rows[2], [1.0]])

        start = np.concatenate([f.E.ravel(), [0.0]])
        S = f.followed(field, start, np.array([0.0, 10.0]))[-1, :9].reshape(3, 3)
        return float(np.abs(S @ S.T - f.E).max())

    assert error(+1) <= 1e-11  # measured 1.4e-12: scipy
    assert error(-1) > 0.1  # control: the sign of dβ/dt, 0.69


def test_the_angular_velocity_is_the_rate_of_the_attitude() -> None:
    """Section 2: ω̂ = dS/dt Sᵀ along MuJoCo's motion."""
    ball = mujoco_ball(RUBBER)
    S = ball.axes.transpose(0, 2, 1)
    turning = rate(S) @ S[INNER].transpose(0, 2, 1)

    def error(sign: float) -> float:
        return worst(turning - [sign * f.hat(omega) for omega in ball.omega[INNER]])

    assert error(+1) <= 4e-6  # rad/s; measured 5e-7: differences
    assert error(-1) > 1.0  # control: the sign of ω̂, 15


# Constraints ---------------------------------------------------------------------------------


def test_the_contact_point_does_not_slip() -> None:
    """(2.1): v + aγ×(ω - Ω) = 0 along MuJoCo's motions."""

    def slip(sign: float) -> Errors:
        for ball in map(mujoco_ball, EACH):
            rolling = ball.of(lambda n, w, gamma: n.a * cross(gamma, w - sign * n.Omega))
            yield largest(ball.centre_velocity + rolling[INNER])

    assert worst(slip(+1)) <= 6e-6  # m/s; measured 1.0e-6: differences
    assert worst(slip(-1)) > 1.0  # control: the sign of Ω, 6.0


def test_the_rubber_ball_does_not_spin() -> None:
    """(2.2): (ω - Ω, γ) = 0 along MuJoCo's motions."""

    def spin(sign: float) -> Errors:
        for ball in map(mujoco_ball, (RUBBER, DRIVEN)):
            yield ball.of(lambda n, w, gamma: (w - sign * n.Omega) @ gamma)

    assert worst(spin(+1)) <= 1e-7  # rad/s; measured 1.1e-8: MuJoCo's contact
    assert worst(spin(-1)) > 1.0  # control: the sign of Ω, 5.4


# Energy and forces ---------------------------------------------------------------------------


def test_the_kinetic_energy_is_that_of_point_masses() -> None:
    """Section 2: T = mv²/2 + (ω, Iω)/2 + (k, ω), without the part independent of v and ω."""

    def errors(sign: float) -> Errors:
        for moment in moments(22):
            ball, n, w, v = moment.ball, moment.ball.numbers, moment.omega, moment.v
            T = ball.momenta(v, w)[2] - ball.momenta(0 * v, 0 * w)[2]
            yield T - (ball.mass * v @ v / 2 + w @ n.I @ w / 2 + sign * n.k @ w)

    assert worst(errors(+1)) <= 3e-14  # J; measured 5e-15: rounding
    assert worst(errors(-1)) > 0.5  # control: the sign of k, 1.7


def test_the_gyrostatic_momentum_is_that_of_point_masses() -> None:
    """Section 2: Σ r×mu = Iω + k with k = Σ jφ̇n - J_sΩ."""

    def errors(sign: float) -> Errors:
        for moment in moments(23):
            ball, n = moment.ball, moment.ball.numbers
            k = -sign * ball.shell.moment(ball.shell.axis) * n.Omega
            k += sum(r.moment(r.axis) * r.rate * r.axis for r in ball.rotors)
            yield ball.momenta(moment.v, moment.omega)[1] - (n.I @ moment.omega + k)

    assert worst(errors(+1)) <= 9e-15  # kg m²/s; measured 9e-16: rounding
    assert worst(errors(-1)) > 0.2  # control: the sign of J_s, 0.69


def plane_force(ball: BallMotion) -> Array:
    """Return λ (n, 3) of MuJoCo's contact without the weight, in principal axes."""
    in_space = ball.motion.loads.contact_force.copy()
    in_space[:, 2] = 0.0  # the centre stays at its height
    return np.einsum("nij,ni->nj", ball.axes, in_space)


def test_the_poincare_suslov_equations_hold_with_the_contacts_force_and_torque() -> None:
    """(2.3), both lines: the rates of mv and of Iω + k, with MuJoCo's λ at -aγ and λ₀."""

    def errors(sign: float) -> Errors:
        for ball in map(mujoco_ball, EACH):
            n, force, inner = ball.numbers[0], plane_force(ball), slice(4, -4)
            v, k_omega = n.d / n.a**2 * ball.centre_velocity, ball.of(lambda n, w, _: n.I @ w + n.k)
            yield rate(v) + np.cross(ball.omega[inner], v[INNER]) - force[inner]
            torque = -sign * n.a * np.cross(ball.gamma, force)
            torque += ball.motion.loads.spin_torque[:, None] * ball.gamma
            yield rate(k_omega) + (np.cross(ball.omega, k_omega) - torque)[INNER]

    assert worst(errors(+1)) <= 2e-4  # N and N m; measured 2.6e-5: differences
    assert worst(errors(-1)) > 5.0  # control: the sign of ∂f/∂ω, 53


def test_gravity_does_not_change_the_motion_of_a_balanced_ball() -> None:
    """Remark 3, from MuJoCo's paths at 9.81 and 3.7 m/s²."""
    scene, times = paper_scene(RUBBER), sample_times(5.0)

    def difference(offset: float) -> float:
        frame = Frame(scene.ball.frame.mass, scene.ball.frame.inertia, offset * f.E[2])
        ball = scene.with_hinges(body={"frame": frame})
        one, other = (simulate(replace(ball, gravity=g), times) for g in (9.81, 3.7))
        return largest(one.contact_point - other.contact_point)

    assert difference(offset=0.0) <= 1e-11  # m; measured 1.0e-13: rounding
    assert difference(offset=1e-5) > 1e-5  # control: a centre of mass 10 µm off, 8.2e-5


def test_the_reaction_is_the_force_of_the_contact() -> None:
    """After (2.3): λ = -ma(γ×(ω̇ - Ω̇) + (γ×ω)×(ω - Ω) + ω×(γ×(ω - Ω)))."""

    def errors(sign: float) -> Errors:
        for ball in map(mujoco_ball, EACH):
            rows = zip(ball.numbers[INNER], ball.omega[INNER], ball.gamma[INNER], strict=True)
            for (n, w, g), w_rate, force in zip(
                rows, rate(ball.omega), plane_force(ball)[INNER], strict=True
            ):
                shell = w - n.Omega
                turning = cross(g, w_rate - n.Omega_rate) + cross(cross(g, w), shell)
                yield -n.d / n.a * (turning + sign * cross(w, cross(g, shell))) - force

    assert worst(errors(+1)) <= 3e-5  # N; measured 7.0e-6: differences
    assert worst(errors(-1)) > 5.0  # control: the sign of the last term, 65


# Equations of motion -------------------------------------------------------------------------


def accelerated(seed: int, rubber: bool) -> Iterator[tuple[Moment, Numbers, Array, Array, float]]:
    """Yield random point-mass balls, their numbers, ω, and dω/dt and λ₀ by Newton and Euler."""
    for moment in moments(seed):
        n, omega = moment.ball.numbers, moment.omega
        if rubber:  # the state must satisfy (2.2)
            omega = f.level(omega, moment.gamma) + (n.Omega @ moment.gamma) * moment.gamma
        yield moment, n, omega, *rolled(moment.ball, omega, moment.gamma, rubber)


@pytest.mark.parametrize("rubber", [True, False])
def test_the_angular_acceleration_is_that_of_point_masses(rubber: bool) -> None:
    """(2.4), with the λ₀ of Newton and Euler."""

    def errors(sign: float) -> Errors:
        for moment, n, omega, omega_rate, spin_torque in accelerated(24, rubber):
            torque = f.gyroscopic_torque(n, omega, moment.gamma) + spin_torque * moment.gamma
            torque += sign * f.drive_torque(n, omega, moment.gamma)
            yield np.linalg.solve(f.contact_inertia(n, moment.gamma), torque) - omega_rate

    assert worst(errors(+1)) <= 2e-13  # rad/s²; measured 3.4e-14: rounding
    assert worst(errors(-1)) > 1.0  # control: the sign of W, 4.4


def by_robotball(n: Numbers, omega: Array, gamma: Array) -> Array:
    """Return robotball's dω/dt and λ₀ (4,) of a rubber ball."""
    w, vertical, I = map(as_vector, (omega, gamma, np.diag(n.I)))
    Omega, Omega_rate, k, k_rate = map(as_vector, (n.Omega, n.Omega_rate, n.k, n.k_rate))
    omega_rate, spin_torque = eq.full_angular_acceleration(
        w, vertical, Omega, Omega_rate, k, k_rate, I, n.d, spin_free=True
    )
    return np.array([*omega_rate, spin_torque])


def test_the_angular_acceleration_is_that_of_mujoco_while_the_rates_change() -> None:
    """(2.4) with λ₀ of (2.5); robotball's formula too."""
    ball = mujoco_ball(DRIVEN)

    def error(sign: float) -> float:
        return largest(
            rate(ball.omega) - ball.of(lambda n, w, g: f.full_rates(n, w, g, sign)[0])[INNER]
        )

    assert error(+1) <= 3e-5  # rad/s²; measured 3.9e-6: differences
    assert error(-1) > 5.0  # control: the sign of λ₀, 61
    assert largest(rate(ball.omega) - ball.of(by_robotball)[INNER, :3]) <= 3e-5


def test_the_contact_inertia_has_the_unit_matrix() -> None:
    """(2.4), E4: Ĩ = I + ma²(γ²E - γ⊗γ). The paper prints γ² - γ⊗γ and calls it I."""

    def errors(sign: float, unit_matrix: Array) -> Errors:
        for moment in moments(26):
            ball, n, gamma = moment.ball, moment.ball.numbers, moment.gamma
            tilde = n.I + n.d * (sign * gamma @ gamma * unit_matrix - np.outer(gamma, gamma))
            yield ball.inertia(-ball.a * gamma) - tilde

    assert worst(errors(+1, f.E)) <= 1e-14  # kg m²; measured 1.3e-15: rounding
    assert worst(errors(+1, np.ones((3, 3)))) > 1.0  # printed: 2.5
    assert worst(errors(-1, f.E)) > 1.0  # control: the sign of γ², 4.9


def test_the_multiplier_is_the_spin_torque_of_point_masses() -> None:
    """(2.5), with Ω and k changing."""

    def errors(sign: float) -> Errors:
        for moment, n, omega, _, spin_torque in accelerated(25, rubber=True):
            changed = replace(n, Omega_rate=sign * n.Omega_rate)
            yield f.full_rates(changed, omega, moment.gamma)[1] - spin_torque

    assert worst(errors(+1)) <= 4e-14  # N m; measured 6.1e-15: rounding
    assert worst(errors(-1)) > 0.5  # control: the sign of Ω̇, 1.9


def test_the_multiplier_is_the_spin_torque_of_mujocos_contact() -> None:
    """(2.5), with Ω and k changing; robotball's formula too."""
    ball = mujoco_ball(DRIVEN)
    torque, multiplier = ball.motion.loads.spin_torque, ball.of(lambda *s: f.full_rates(*s)[1])
    assert largest(multiplier - torque) <= 6e-8  # N m; measured 5.6e-9: MuJoCo's contact
    assert largest(-multiplier - torque) > 5.0  # control: the sign of λ₀, 37
    assert largest(ball.of(by_robotball)[:, 3] - torque) <= 6e-8


def test_the_rate_of_the_spin_constraint_has_minus_the_rate_of_omega() -> None:
    """Before (2.5), E3: (Ĩω̇, Ĩ⁻¹γ) - (Ω, γ×ω) - (Ω̇, γ) = 0. The paper prints + (Ω̇, γ)."""

    def errors(sign: float) -> Errors:
        for moment, n, omega, omega_rate, _ in accelerated(27, rubber=True):
            tilde, gamma = f.contact_inertia(n, moment.gamma), moment.gamma
            first = tilde @ omega_rate @ np.linalg.solve(tilde, gamma)
            yield first - n.Omega @ cross(gamma, omega) - sign * n.Omega_rate @ gamma

    assert worst(errors(+1)) <= 4e-14  # rad/s²; measured 5.9e-15: rounding
    assert worst(errors(-1)) > 1.0  # printed, and the control: 2.8


# Reconstruction ------------------------------------------------------------------------------


def test_the_space_axes_rotate_with_the_angular_velocity() -> None:
    """(2.6): dα/dt = α×ω, dβ/dt = β×ω, and robotball's quaternion, along MuJoCo's motions."""

    def errors(sign: float) -> Errors:
        for ball in map(mujoco_ball, EACH):
            for axis in (ball.axes[:, 0], ball.axes[:, 1]):
                yield rate(axis) - sign * np.cross(axis, ball.omega)[INNER]

    assert worst(errors(+1)) <= 3e-5  # rad/s; measured 4.4e-6: differences
    assert worst(errors(-1)) > 1.0  # control: the sign, 16
    for ball in map(mujoco_ball, EACH):
        q, omega = ball.motion.attitude, ball.motion.angular_velocity
        ours = np.stack(eq.attitude_rate(tuple(q.T), tuple(omega.T)), axis=1)
        assert largest(rate(q) - ours[INNER]) <= 3e-5
        axes: Array = np.array(eq.space_axes(tuple(q.T))).transpose(2, 0, 1)
        assert worst(axes @ ball.motion.scene.principal_axes - ball.axes) <= 1e-14


def test_the_velocity_of_the_contact_point_is_a_times_that_of_the_shell() -> None:
    """(2.7): Ẋ = a(β, ω - Ω), Ẏ = -a(α, ω - Ω), along MuJoCo's motions; robotball's too."""

    def errors(sign: float) -> Errors:
        for ball in map(mujoco_ball, EACH):
            shell = ball.of(lambda n, w, _: n.a * (w - n.Omega))
            alpha, beta, _ = ball.axes.transpose(1, 0, 2)
            yield ball.path_error((beta * shell).sum(axis=1), -sign * (alpha * shell).sum(axis=1))

    assert worst(errors(+1)) <= 6e-6  # m/s; measured 1.0e-6: differences
    assert worst(errors(-1)) > 1.0  # control: the sign of Ẏ, 11
    for ball in map(mujoco_ball, EACH):
        rows = (*ball.axes.transpose(1, 0, 2)[:2], ball.omega, ball.of(lambda n, *_: n.Omega))
        X, Y, omega, Omega = (tuple(vectors.T) for vectors in rows)
        assert ball.path_error(*eq.contact_velocity(X, Y, omega, Omega, ball.numbers[0].a)) <= 6e-6


def test_a_rotation_about_the_vertical_is_a_symmetry() -> None:
    """Remark 4: ω and γ of MuJoCo's ball stay the same, and the path is rotated."""

    def errors(axis: int, names: Sequence[str]) -> Errors:
        turn = f.turned_about(f.E[axis], 0.7)
        for name in names:
            scene, ball = paper_scene(name), mujoco_ball(name)
            attitude = multiply(from_matrix(turn), scene.start.attitude)
            start = Start(attitude, turn @ scene.start.momentum)
            other = mujoco_ball_of(replace(scene, start=start), 10.0)
            path = ball.motion.contact_point @ turn[:2, :2].T
            yield from (other.omega - ball.omega, other.gamma - ball.gamma)
            yield other.motion.contact_point - path

    assert worst(errors(2, (RUBBER, CLASSICAL))) <= 3e-10  # measured 2.1e-11: rounding, growing
    # Control: about OX. A rubber ball cannot, because its M must be horizontal.
    assert worst(errors(0, (CLASSICAL,))) > 1.0  # 10
