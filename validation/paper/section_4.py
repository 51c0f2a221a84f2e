"""Section 4, motion from rest for the rubber model, up to 4.1."""

from dataclasses import replace

import numpy as np

from robotball.rotations import Array
from validation.paper import formulas as f
from validation.paper.claim import Claim, Residual
from validation.paper.engine import INNER, MOTION, largest, rate, seen
from validation.paper.formulas import Numbers, cross
from validation.paper.section_3_1 import MOMENTUM

SPIN_UP = "spin_up_from_rest"


def stays_at_rest(twist: float) -> Residual:
    """|M| of MuJoCo's bodies, while Ω and K ramp up from 0; twisted, the classical M."""
    ball = seen(SPIN_UP)
    M = ball.momentum
    if twist != 1:
        M = ball.of(lambda n, omega, gamma: f.contact_inertia(n, gamma) @ omega + n.K)
    return Residual(largest(M), bound=2e-7, unit=MOMENTUM)


def field_on_the_sphere(twist: float) -> Residual:
    """dγ/dt by differences of MuJoCo's γ, beside (4.1)."""
    ball = seen("fig06")
    found = ball.of(lambda n, _, gamma: f.from_rest(replace(n, K=twist * n.K))(gamma))
    return Residual(largest(rate(ball.gamma) - found[INNER]), bound=2e-7, unit="1/s")


def path_from_rest(twist: float) -> Residual:
    """dα/dt, dβ/dt, Ẋ and Ẏ of (4.2), with ω = A(Zγ - K), by differences of MuJoCo's motion."""
    ball = seen("fig06")

    def velocity(n: Numbers, _: Array, gamma: Array) -> Array:
        Z = (n.Omega + n.A @ n.K) @ gamma / (n.A @ gamma @ gamma)
        return n.A @ (Z * gamma - twist * n.K)

    omega = ball.of(velocity)[INNER]
    shell = omega - ball.numbers[0].Omega
    alpha, beta = ball.axes[INNER, 0], ball.axes[INNER, 1]
    path = np.stack([(beta * shell).sum(axis=1), -(alpha * shell).sum(axis=1)], axis=1)
    worst = largest(ball.path_velocity[:, :2] - ball.numbers[0].a * path)
    for axis, start in ((ball.axes[:, 0], alpha), (ball.axes[:, 1], beta)):
        worst = max(worst, largest(rate(axis) - np.cross(start, omega)))
    return Residual(worst, bound=2e-7, unit="1/s, m/s")


# Ω = 0 -------------------------------------------------------------------------------------


def gyrostats(seed: int) -> list[tuple[Numbers, Array]]:
    """Five random balls with Ω = 0, and a γ each."""
    zero = np.zeros(3)
    return [
        (replace(f.still(each.n), Omega=zero, K=2 * each.n.K), each.gamma)
        for each in f.states(seed, 5)
    ]


def integral_without_turning(twist: float) -> Residual:
    """The change of (AK,γ)²/(Aγ,γ) over 20 s by (2.4)-(2.5), which know no M and no (4.1)."""
    worst = 0.0
    for n, gamma in gyrostats(41):

        def rate_of(x: Array, n: Numbers = n) -> Array:
            spin = f.spin_torque(n, x[:3], x[3:])
            return np.append(f.acceleration(n, x[:3], x[3:], spin), cross(x[3:], x[:3]))

        start = np.append(f.rubber_velocity(n, np.zeros(3), gamma), gamma)
        path = f.followed(rate_of, start, np.linspace(0.0, 20.0, 41), rtol=1e-10)[:, 3:]
        kept = (path @ n.A @ n.K) ** 2 / ((path @ n.A * path).sum(axis=1)) ** twist
        worst = max(worst, float(np.ptp(kept)))
    return Residual(worst, bound=5e-8)


def closed(twist: float) -> Residual:
    """How near γ of (4.1) comes back to its start in 60 s, for Ω = 0; twisted, for Ω ≠ 0."""
    worst = 0.0
    for (n, gamma), other in zip(gyrostats(42), f.states(43), strict=False):
        n = n if twist == 1 else replace(n, Omega=other.n.Omega)
        field = f.from_rest(n)
        passed = f.returns(field, gamma, field(gamma), 60.0, rtol=1e-11)
        back = np.linalg.norm(passed - gamma, axis=1).min() if len(passed) else 2.0
        worst = max(worst, float(back))
    return Residual(worst, bound=2e-11)


def opposite_points(twist: float) -> Residual:
    """dγ/dt at -γ is minus that at γ; twisted, at γ with one part reversed."""
    worst = 0.0
    for state in f.states(44):
        field, gamma = f.from_rest(state.n), state.gamma
        image = np.array([-1.0, -twist, -1.0])
        worst = max(worst, float(np.abs(field(image * gamma) - image * field(gamma)).max()))
    return Residual(worst, bound=1e-14, unit="1/s")


CLAIMS = (
    Claim("4", "from rest M stays 0 as Ω and K grow", stays_at_rest, MOTION, "γ× of (3.1)"),
    Claim("(4.1)", "dγ/dt = γ×A(Zγ - K)", field_on_the_sphere, MOTION, "the sign of K"),
    Claim("(4.2)", "dα/dt, dβ/dt, Ẋ and Ẏ", path_from_rest, MOTION, "the sign of K"),
    Claim("4", "(4.1) has no chaos", "a theorem: two dimensions have none"),
    Claim(
        "4",
        "Ω = 0: (AK,γ)²/(Aγ,γ) stays",
        integral_without_turning,
        "(2.4)-(2.5) by scipy",
        "the power of (Aγ,γ)",
    ),
    Claim("4", "Ω = 0: all trajectories are closed", closed, "(4.1) by scipy", "Ω ≠ 0"),
    Claim("Remark 6", "γ → -γ is a symmetry", opposite_points, "(4.1) at random γ", "one index"),
)
