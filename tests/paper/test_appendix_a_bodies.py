"""Appendix A: the constraints in the shell's axes, and energy and momentum of the bodies."""

from dataclasses import replace

import numpy as np

from robotball.robot.ball import Solid, composed
from robotball.rotations import Array, rotation_matrix
from tests.paper import formulas as f
from tests.paper.engine_ball import INNER, RUBBER, mujoco_ball, rate
from tests.paper.formulas import Errors, cross, paper_scene, worst
from tests.paper.point_masses import Ball, Body, moments

CENTRE = np.zeros(3)


# Constraints ---------------------------------------------------------------------------------


def test_the_constraints_hold_in_the_shells_axes() -> None:
    """(A.1): u + aΓ×w = 0, (w, Γ) = 0 with P = RΦ(t); the attitude of MuJoCo's shell."""
    scene, ball = paper_scene(RUBBER), mujoco_ball(RUBBER)

    def errors(sense: float) -> Errors:
        # R = E, because the shell's axis is e_z.
        P = [f.turned_about(f.E[2], -sense * angle) for angle in ball.motion.hinge_angles[:, 0]]
        shell = rotation_matrix(ball.motion.attitude) @ np.array(P)
        turning = shell[INNER].transpose(0, 2, 1) @ rate(shell)  # ŵ transposed
        w = np.stack([turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]], axis=1)
        Gamma = shell[INNER, 2]
        u = np.einsum("nij,ni->nj", shell[INNER], ball.path_velocity)
        yield from (u + scene.ball.radius * np.cross(Gamma, w), (w * Gamma).sum(axis=1))

    assert worst(errors(+1)) <= 4e-6  # m/s and rad/s; measured 5.3e-7: differences
    assert worst(errors(-1)) > 1.0  # control: the sense of Φ, 4.0


def test_the_angular_velocity_in_the_frames_axes() -> None:
    """(A.2), E19: ω̂ = PŵPᵀ + ṖPᵀ, where ω̂α = α×ω. The paper prints PᵀŵP + PᵀṖ."""
    random = np.random.default_rng(4)
    P, shell = (np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(2))
    w, turning = f.hat(random.normal(size=3)), f.hat(random.normal(size=3))
    P_rate = turning @ P
    frame, frame_rate = P @ shell, P_rate @ shell + P @ w @ shell

    def error(omega_hat: Array) -> float:
        return float(np.abs(omega_hat @ frame - frame_rate).max())

    assert error(P @ w @ P.T + P_rate @ P.T) <= 2e-15  # 1/s; measured 2.2e-16: rounding
    assert error(P.T @ w @ P + P.T @ P_rate) > 0.1  # printed: 0.37
    assert error(P @ w @ P.T + P @ P_rate.T) > 0.1  # printed, if P is its transpose: 1.1
    assert error(P @ w @ P.T - P_rate @ P.T) > 0.1  # control: the sign of Ṗ, 1.1


# Energy and momentum -------------------------------------------------------------------------


def only(ball: Ball, *kept: str) -> Ball:
    """Return the ball without the mass of the bodies that are not kept."""

    def light(body: Body, name: str) -> Body:
        return body if name in kept else replace(body, masses=0 * body.masses)

    rotors = tuple(light(rotor, "rotors") for rotor in ball.rotors)
    return Ball(light(ball.shell, "shell"), light(ball.frame, "frame"), rotors, ball.a)


def test_the_kinetic_energy_of_the_shell() -> None:
    """Appendix A: T_s = m_sv²/2 + (ω, RI_sRᵀω)/2 - J_s(ω, Ω), less its value at rest."""

    def errors(sign: float) -> Errors:
        for moment in moments(81):
            w, v, shell = moment.omega, moment.v, only(moment.ball, "shell")
            T = shell.momenta(v, w)[2] - shell.momenta(CENTRE, CENTRE)[2]
            J_s, I_s = shell.shell.moment(shell.shell.axis), shell.inertia(CENTRE)
            yield T - (shell.mass * v @ v / 2 + w @ I_s @ w / 2 - sign * J_s * w @ shell.Omega)

    assert worst(errors(+1)) <= 4e-15  # J; measured 2.2e-16: rounding
    assert worst(errors(-1)) > 0.2  # control: the sign of J_s, 1.0


def test_the_kinetic_energy_of_the_frame_and_the_rotors() -> None:
    """Appendix A: mv²/2 + (ω, I_fω)/2 + Σ (ω + φ̇n, j(ω + φ̇n))/2, of centred rotors."""

    def errors(sign: float) -> Errors:
        for moment in moments(82, centred=True):
            w, v, ball = moment.omega, moment.v, only(moment.ball, "frame", "rotors")
            formula = ball.mass * v @ v / 2 + w @ only(ball, "frame").inertia(CENTRE) @ w / 2
            for rotor in ball.rotors:
                alone = only(replace(ball, rotors=(rotor,)), "rotors").inertia(CENTRE)
                turning = w + sign * rotor.rate * rotor.axis
                formula += turning @ alone @ turning / 2
            yield ball.momenta(v, w)[2] - formula

    assert worst(errors(+1)) <= 3e-14  # J; measured 3.6e-15: rounding
    assert worst(errors(-1)) > 0.5  # control: the sign of φ̇, 1.9


def test_every_rotor_adds_to_the_gyrostatic_momentum() -> None:
    """(A.3): k = Σ jφ̇n - J_sΩ of three rotors; with it (3.1) gives M of MuJoCo's bodies."""
    scene, ball = paper_scene("three_rotors"), mujoco_ball("three_rotors")
    shell, rates = scene.ball.shell, [float(drive.rate(0.0)) for drive in scene.drives]

    def errors(third: float) -> Errors:
        Omega = rates[0] * shell.axis
        k = -shell.axial_inertia * Omega
        for rotor, speed in zip(scene.ball.rotors, [*rates[1:-1], third * rates[-1]], strict=True):
            k = k + rotor.axial_inertia * speed * rotor.axis
        K = scene.principal_axes.T @ (k - scene.ball.d * Omega)
        yield K - scene.parameters.K
        yield ball.of(lambda n, w, g: cross(g, f.contact_inertia(n, g) @ w + K)) - ball.momentum

    assert worst(errors(third=1.0)) <= 2e-7  # kg m²/s; measured 1.5e-8: MuJoCo's contact
    assert worst(errors(third=0.0)) > 0.5  # control: without the third rotor, 1.9


def test_the_inertia_has_steiners_terms() -> None:
    """(A.3), E21: I = RI_sRᵀ + I_f + Σ j + Σ μ(c²E - c⊗c). The paper prints no such terms."""

    def errors(sign: float, steiner: float = 1.0) -> Errors:
        for moment in moments(83):
            ball = moment.ball
            rest, terms = only(ball, "shell", "frame"), np.zeros((3, 3))
            centre, total = ball.frame.masses @ ball.frame.points / rest.mass, rest.inertia(CENTRE)
            solids = [Solid(rest.mass, centre, rest.inertia(centre))]
            for rotor in ball.rotors:
                alone = only(replace(ball, rotors=(replace(rotor, centre=CENTRE),)), "rotors")
                c = rotor.centre
                solids.append(Solid(rotor.mass, c, alone.inertia(CENTRE)))
                total = total + solids[-1].inertia
                terms += rotor.mass * (sign * c @ c * f.E - np.outer(c, c))
            yield ball.inertia(CENTRE) - total - steiner * terms
            yield ball.inertia(CENTRE) - composed(solids).inertia  # robotball's

    assert worst(errors(+1)) <= 3e-15  # kg m²; measured 4.4e-16: rounding
    assert worst(errors(+1, steiner=0.0)) > 0.05  # printed: 0.15
    assert worst(errors(-1)) > 0.1  # control: the sign of c², 0.37
