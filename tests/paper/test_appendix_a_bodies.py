"""Appendix A: the constraints in the shell's axes, and the kinetic energy of the bodies."""

from dataclasses import replace

import numpy as np

from robotball.ball import Solid, composed
from robotball.rotations import Array, rotation_matrix
from tests.paper import formulas as f
from tests.paper.claim import Errors, Section, by
from tests.paper.engine_ball import INNER, MOTION, RUBBER, largest, rate, seen
from tests.paper.formulas import cross, paper_scene
from tests.paper.point_masses import MASSES, Ball, Body, moments
from tests.paper.test_section_3_momentum import MOMENTUM

SECTION = Section("Appendix A")
claim = SECTION.claim

_CENTRE = np.zeros(3)


# Constraints ---------------------------------------------------------------------------------


def _shell_axes(angle: float) -> Array:
    """Return Φ(t): from the shell's axes at φ = 0 to those of the frame."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


@claim("(A.1)", "u + aΓ×w = 0, (w, Γ) = 0, where P = RΦ(t)")
@by(MOTION, "the sense of Φ", bound=4e-6, unit="m/s, rad/s")
def _in_the_shells_axes(twist: float = 1.0) -> Errors:
    """Compute u + aΓ×w and (w, Γ) of (A.1), with w by differences of the shell's attitude.

    That attitude is MuJoCo's frame's, turned by P = RΦ of its hinge's angle; R = E, for the axis
    is e_z.
    """
    scene, ball = paper_scene(RUBBER), seen(RUBBER)
    P = np.array([_shell_axes(twist * angle) for angle in ball.motion.hinge_angles[:, 0]])
    shell = rotation_matrix(ball.motion.attitude) @ P
    turning = shell[INNER].transpose(0, 2, 1) @ rate(shell)  # ŵ transposed
    w = np.stack([turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]], axis=1)
    Gamma = shell[INNER, 2]
    u = np.einsum("nij,ni->nj", shell[INNER], ball.path_velocity)
    yield largest(u + scene.ball.radius * np.cross(Gamma, w))
    yield largest((w * Gamma).sum(axis=1))


@claim("E19, (A.2)", "ω̂ = PŵPᵀ + ṖPᵀ, where ω̂α = α×ω", "ω̂ = PᵀŵP + PᵀṖ")
@by("random rotations", "the sign of Ṗ", bound=2e-15, unit="1/s", printed={"printed": True})
def _turned_angular_velocity(twist: float = 1.0, printed: bool = False) -> Errors:
    """Compare ω̂α with dα/dt in the frame's axes, with ω̂ = PŵPᵀ + ṖPᵀ of random rates.

    As printed, PᵀŵP + PᵀṖ is tried for either sense of P, and the better one counts.
    """
    random = np.random.default_rng(4)
    P, shell = (np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(2))
    w, turning = f.hat(random.normal(size=3)), f.hat(random.normal(size=3))
    P_rate = turning @ P
    frame, frame_rate = P @ shell, P_rate @ shell + P @ w @ shell

    hats = [P @ w @ P.T + twist * P_rate @ P.T]
    if printed:  # the misprint could be one of P's definition; (A.2) fails for either
        hats = [P.T @ w @ P + P.T @ P_rate, P @ w @ P.T + P @ P_rate.T]
    yield min(np.abs(omega_hat @ frame - frame_rate).max() for omega_hat in hats)


# Energy --------------------------------------------------------------------------------------


def _without(ball: Ball, *kept: str) -> Ball:
    """Return the ball with the mass of all bodies but those kept taken away."""

    def light(body: Body, name: str) -> Body:
        # Its mass goes and the body stays, as its axis and rate are asked for all the same.
        return body if name in kept else replace(body, masses=0 * body.masses)

    rotors = tuple(light(rotor, "rotors") for rotor in ball.rotors)
    return Ball(light(ball.shell, "shell"), light(ball.frame, "frame"), rotors, ball.a)


@claim("App. A", "T_s = m_sv²/2 + … - J_s(ω, Ω)")
@by(MASSES, "the sign of J_s", bound=4e-15, unit="J")
def _shell_energy(twist: float = 1.0) -> Errors:
    """Compare Σ mu²/2 of the shell with m_sv²/2 + (ω, RI_sRᵀω)/2 - J_s(ω, Ω).

    Less their values at v = ω = 0.
    """
    for moment in moments(81):
        w, v, shell = moment.omega, moment.v, _without(moment.ball, "shell")
        T = shell.momenta(v, w)[2] - shell.momenta(_CENTRE, _CENTRE)[2]
        J_s, I_s = shell.shell.moment(shell.shell.axis), shell.inertia(_CENTRE)
        formula = shell.mass * v @ v / 2 + w @ I_s @ w / 2 - twist * J_s * w @ shell.Omega
        yield T - formula


@claim("App. A", "T_f and T_i")
@by(MASSES, "the sign of φ̇", bound=3e-14, unit="J")
def _frame_and_rotor_energy(twist: float = 1.0) -> Errors:
    """Compare Σ mu²/2 of frame and rotors with mv²/2 + (ω, I_fω)/2 + Σ (ω + φ̇n, j(ω + φ̇n))/2.

    The rotors' centres are the ball's, as the paper has them.
    """
    for moment in moments(82, centred=True):
        w, v, ball = moment.omega, moment.v, _without(moment.ball, "frame", "rotors")
        formula = ball.mass * v @ v / 2 + w @ _without(ball, "frame").inertia(_CENTRE) @ w / 2
        for rotor in ball.rotors:
            alone = _without(replace(ball, rotors=(rotor,)), "rotors").inertia(_CENTRE)
            turning = w + twist * rotor.rate * rotor.axis
            formula += turning @ alone @ turning / 2
        yield ball.momenta(v, w)[2] - formula


SECTION.unchecked("E20, App. A", "μ_i is the rotor's mass, not m_i", "a name: nothing to compute")


@claim("(A.3)", "k = Σ jφ̇n - J_sΩ, of three rotors")
@by(MOTION, "one rotor", {"third": 0.0}, bound=2e-7, unit=MOMENTUM)
def _gyrostatic_momentum(third: float = 1.0) -> Errors:
    """Compare M of (3.1), where k is by (A.3) of three rotors, with that of MuJoCo's bodies.

    third: times the rate of the third rotor.
    """
    scene, ball = paper_scene("three_rotors"), seen("three_rotors")
    drives = [float(drive.rate(0.0)) for drive in scene.drives]
    drives[-1] *= third
    shell = scene.ball.shell
    Omega = drives[0] * shell.axis
    k = -shell.axial_inertia * Omega
    for rotor, rate_ in zip(scene.ball.rotors, drives[1:], strict=True):
        k = k + rotor.axial_inertia * rate_ * rotor.axis
    K = scene.principal_axes.T @ (k - scene.ball.d * Omega)
    yield K - scene.parameters.K
    M = ball.of(lambda n, w, gamma: cross(gamma, f.contact_inertia(n, gamma) @ w + K))
    yield largest(M - ball.momentum)


@claim("E21, (A.3)", "I = RI_sRᵀ + I_f + Σ j + Steiner's terms", "I = RI_sRᵀ + I_f + Σ j")
@by(MASSES, "the sign of c²", bound=3e-15, unit="kg m²", printed={"steiner": 0.0})
def _steiner_terms(twist: float = 1.0, steiner: float = 1.0) -> Errors:
    """Compare Σ m(r²E - r⊗r) of all points with the sum over the bodies' own centres.

    With μ(c²E - c⊗c) of the rotors' centres, and without as printed.
    """
    for moment in moments(83):
        ball = moment.ball
        rest, far = _without(ball, "shell", "frame"), np.zeros((3, 3))
        centre, own = ball.frame.masses @ ball.frame.points / rest.mass, rest.inertia(_CENTRE)
        ours = [Solid(rest.mass, centre, rest.inertia(centre))]
        for rotor in ball.rotors:
            alone = replace(ball, rotors=(replace(rotor, centre=_CENTRE),))
            c = rotor.centre
            ours.append(Solid(rotor.mass, c, _without(alone, "rotors").inertia(_CENTRE)))
            own = own + ours[-1].inertia
            far += rotor.mass * (twist * c @ c * f.E - np.outer(c, c))
        yield ball.inertia(_CENTRE) - own - steiner * far
        yield ball.inertia(_CENTRE) - composed(ours).inertia
