"""Appendix A, and which balls exist."""

from dataclasses import replace

import numpy as np

from robotball import InputError, Scene, load_scene
from robotball.bodies import Ball, Frame, Rotor, beyond_the_shell, check_inertia
from robotball.designing.feasibility import masses_allowed
from robotball.parameters import as_vector
from robotball.rotations import Array
from robotball.start import along_momentum, section_state
from validation.paper.claim import Claim, Residual
from validation.paper.engine import seen, seen_of

BUILDABLE = ("fig12", "fig13", "fig14")
UNBUILDABLE = ("fig05b", "fig05c", "fig05d", "fig06", "fig07", "fig08", "fig10", "fig10_stable")


# Appendix A --------------------------------------------------------------------------------


def turned_angular_velocity() -> Residual:
    """ω̂ = PŵPᵀ + ṖPᵀ, with ω̂α = α×ω as in dα/dt = α×ω, and P from the shell's to frame axes.

    A vector fixed in space is α_s in the shell's axes and α = Pα_s in the frame's. What the paper
    calls P and ^ is lost; its dα/dt = α×ω is taken for ^. As printed, PᵀŵP + PᵀṖ, it is tried for
    either sense of P, and the better one counts.
    """
    random = np.random.default_rng(4)
    P, shell = (np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(2))
    w, turning = hat(random.normal(size=3)), hat(random.normal(size=3))
    P_rate, shell_rate = turning @ P, w @ shell
    frame, frame_rate = P @ shell, P_rate @ shell + P @ shell_rate

    def off(omega_hat: Array) -> float:
        return float(np.abs(omega_hat @ frame - frame_rate).max())

    corrected = P @ w @ P.T + P_rate @ P.T
    printed = P.T @ w @ P + P.T @ P_rate
    transposed = P @ w @ P.T + P @ P_rate.T
    return Residual(
        off(corrected), bound=1e-14, printed=min(off(printed), off(transposed)), unit="1/s"
    )


def hat(w: Array) -> Array:
    """ŵ (3, 3), with ŵα = α×w."""
    return np.array([[0.0, w[2], -w[1]], [-w[2], 0.0, w[0]], [w[1], -w[0], 0.0]])


def gyrostatic_momentum() -> Residual:
    """M by (3.1) with k = Σ j φ̇ n - J_s Ω of (A.3), in space, of a ball with three rotors."""
    ball = seen("three_rotors")
    return Residual(ball.drift(ball.momentum), bound=2e-7, unit="kg m²/s")


def off_centre() -> Scene:
    """Fig. 14's shell with two rotors on either side of the centre, chosen; principal axes."""
    scene = load_scene("classical_chaotic")
    side, axis = np.array([0.0, 0.5, 0.0]), np.array([1.0, 0.0, 0.0])
    rotors = tuple(Rotor(0.1, 0.01, 0.006, axis, sign * side) for sign in (1, -1))
    frame = Frame(0.6, np.diag([0.25, 0.6, 0.35]))
    gamma, M = section_state(0.0, 0.6, 0.0, 25.0, 3.0)
    return replace(
        scene,
        ball=Ball(scene.ball.shell, frame, rotors),
        rotor_rates=(150.0, 100.0),
        start=along_momentum(gamma, M),
    )


def steiner_terms() -> Residual:
    """M of section 3.2 in space, with the rotors' Steiner terms in I, and without as printed."""
    scene = off_centre()
    ball = seen_of(scene, 5.0)
    p, rotors = ball.parameters, scene.ball.rotors
    steiner = sum(
        each.mass * (each.centre @ each.centre * np.eye(3) - np.outer(each.centre, each.centre))
        for each in rotors
    )
    without = replace(p, I=as_vector(np.array(p.I) - np.diag(steiner)))
    printed = ball.drift(without.momentum(ball.omega, ball.gamma))
    return Residual(ball.drift(ball.momentum), bound=2e-7, printed=printed, unit="kg m²/s")


# Which balls exist -------------------------------------------------------------------------


def triangle_inequality() -> Residual:
    """d ≤ Σb - 2 max b, b = 1/a, says for how many of 1000 I = b - d wrongly if a body has it."""
    random = np.random.default_rng(5)
    wrong = 0
    for _ in range(1000):
        b = random.uniform(1.0, 3.0, 3)
        d = random.uniform(0.0, b.min())
        wrong += (d <= masses_allowed(np.diag(b), 1.0)[1]) != is_an_inertia(np.diag(b - d))
    return Residual(wrong, bound=0, unit="of 1000 wrong")


def is_an_inertia(tensor: Array) -> bool:
    """Whether a rigid body can have the inertia (3, 3)."""
    try:
        check_inertia("body", tensor)
    except InputError:
        return False
    return True


def mass_inside() -> Residual:
    """d ≥ Σb/5 and max b ≤ (2/5) Σb: for how many of 1000 clouds of masses within a not so."""
    random = np.random.default_rng(6)
    wrong = 0
    for _ in range(1000):
        masses, r = random.uniform(size=20), random.normal(size=(20, 3))
        r *= random.uniform(0.3, 1.0) / np.linalg.norm(r, axis=1, keepdims=True)
        r *= [1.0, 1.0, random.uniform()]
        d = masses.sum()  # a = 1
        I = np.eye(3) * (masses @ (r * r).sum(axis=1)) - np.einsum("n,ni,nj->ij", masses, r, r)
        least, most = masses_allowed(I + d * np.eye(3), 1.0)
        b = np.linalg.eigvalsh(I) + d
        wrong += not (least <= d <= most and b.max() <= 0.4 * b.sum())
    return Residual(wrong, bound=0, unit="of 1000 wrong")


def limits(name: str, share: float, least: float, most: float) -> Residual:
    """max b/Σb, Σb/5 and Σb - 2 max b of a figure's A, beside what is stated."""
    b = 1 / np.array(load_scene(name).parameters.A)
    found = np.array([b.max() / b.sum(), *masses_allowed(np.diag(b), 1.0)])
    # The numbers are stated to three or four digits.
    return Residual(float(np.abs(found - [share, least, most]).max()), bound=5e-4)


def buildable() -> Residual:
    """Of how many of the catalog's balls it is wrong which can be built."""
    wrong = sum(bool(beyond_the_shell(load_scene(name).ball)) for name in BUILDABLE)
    wrong += sum(not beyond_the_shell(load_scene(name).ball) for name in UNBUILDABLE)
    return Residual(wrong, bound=0, unit="of 11 wrong")


def one_rotor() -> Residual:
    """jφ̇ n of the only rotor, beside K + (J_s + d)Ω; nothing where there is no rotor."""
    worst = 0.0
    for name in (*BUILDABLE, *UNBUILDABLE, "zero_rotor"):
        scene = load_scene(name)
        p, shell, rates = scene.parameters, scene.ball.shell, scene.rotor_rates
        wanted = np.array(p.K) + (shell.axial_inertia + p.d) * np.array(p.Omega)
        given = np.zeros(3)
        for rotor, drive in zip(scene.ball.rotors, scene.drives[1:], strict=True):
            given += rotor.axial_inertia * float(drive.rate(0.0)) * rotor.axis
        alone = len(rates) == (np.linalg.norm(wanted) > 1e-12)
        worst = max(worst, float(np.abs(wanted - given).max()) if alone else np.inf)
    return Residual(worst, bound=1e-12, unit="kg m²/s")


CLAIMS = (
    Claim("E19, (A.2)", "PŵPᵀ + ṖPᵀ, not PᵀŵP + PᵀṖ, where ω̂α = α×ω", turned_angular_velocity),
    Claim("E20, App. A", "μ_i, not m_i", "a name: nothing to compute"),
    Claim("(A.3)", "k = Σ jφ̇n - J_sΩ, K = k - dΩ: M stays", gyrostatic_momentum),
    Claim("E21, (A.3)", "plus Steiner terms where a rotor is off centre", steiner_terms),
    Claim("App. A", "b = 1/a: a body has I iff d ≤ Σb - 2 max b", triangle_inequality),
    Claim("App. A", "mass inside needs d ≥ Σb/5, max b ≤ (2/5)Σb", mass_inside),
    Claim("Figs 11-14", "0.3836; 0.869 ≤ m ≤ 1.012", lambda: limits("fig14", 0.3836, 0.869, 1.012)),
    Claim(
        "Figs 5-8", "0.4255; m ≤ 7/6, below Σb/5", lambda: limits("fig06", 0.4255, 1.5667, 7 / 6)
    ),
    Claim("Figs 9-10", "0.4762; m ≤ 1/3, below Σb/5", lambda: limits("fig10", 0.4762, 1.4, 1 / 3)),
    Claim("Figs 5-14", "only the balls of 11 to 14 can be built", buildable),
    Claim("App. A", "one rotor is enough, along K + (J_s + d)Ω", one_rotor),
)
