"""Branches over a whole range, compared with all equilibria at each of 400 values.

From rest a fixed point has ω = sγ with s = (Ω, γ), so A⁻¹sγ + K = λγ. With t = λ/s and b = 1/a, γ
~ K/(t - b), where t is a real zero of the quintic Σ K²/(t - b)² = Σ ΩK/(t - b). Straight lines at
each value are given by the closed form.
"""

from collections.abc import Callable

import numpy as np
import pytest

from robotball.dynamics import motion_branches
from robotball.dynamics.continuation import BRANCH, FOLD, HOPF
from robotball.dynamics.motion_branches import Family, resting
from robotball.dynamics.straight_motions import straight_motions
from robotball.robot import formulas as eq
from robotball.robot.formulas import Rolling
from tests.figures import ball

BALLS = 20
VALUES = 400
# Numbers of equilibria: all, with a possibly imaginary pair, and with a positive real part.
Counts = tuple[int, int, int]


def at_rest(family: Family, s: float) -> Counts:
    """Return the numbers of fixed points: all, with det > 0, and of these with a trace above 0."""
    p = family.at(s)[0]
    K, Omega, b = np.array(p.K), np.array(p.Omega), 1 / np.array(p.A)
    quintic = np.poly1d([0.0])
    for i in range(3):
        others = np.poly1d(np.delete(b, i), r=True) ** 2
        quintic += others * (np.poly1d([b[i]], r=True) * (-Omega[i] * K[i]) + K[i] ** 2)
    t = quintic.roots
    gamma = K[:, None] / (t[t.imag == 0].real - b[:, None])
    gamma /= np.linalg.norm(gamma, axis=0)
    out = gamma[:, None] + 1e-30j * np.eye(3)[:, :, None]  # component, direction, point
    rate = np.array(eq.cross(tuple(out), p.angular_velocity((0.0, 0.0, 0.0), tuple(out))))
    across = np.eye(3)[:, :, None] - gamma[:, None] * gamma
    linear = np.einsum("ijn,jkn,kln->nil", across, rate.imag / 1e-30, across)
    trace = np.trace(linear, axis1=1, axis2=2)
    positive = trace**2 > np.trace(linear @ linear, axis1=1, axis2=2)
    # Both of each pair γ, -γ.
    return 2 * len(trace), 2 * int(positive.sum()), 2 * int((positive & (trace > 0)).sum())


def lines(family: Family, s: float) -> Counts:
    """Return the numbers of lines: all, with c₁ > 0, and of these with c₂c₁ < c₀."""
    p, size, c = family.at(s)
    of = [line.polynomial for line in straight_motions(p, size * size, c * size)]
    return (
        len(of),
        sum(c1 > 0 for _, _, c1, _ in of),
        sum(c1 > 0 and c2 * c1 < c0 for _, c2, c1, c0 in of),
    )


def random_family(seed: int, moving: bool) -> Family:
    """Return a random ball over one of its six numbers, -6 to 6; half with M ≠ 0 are classical."""
    rng = np.random.default_rng(seed)
    A, Omega, K = rng.uniform(0.3, 1.0, 3), rng.normal(size=3) * 2, rng.normal(size=3) * 2
    name = f"{rng.choice(['K', 'Omega'])}{rng.integers(1, 4)}"
    rolling: Rolling = "classical" if moving and seed % 2 else "rubber"
    c = rng.uniform(-1.0, 1.0) if rolling == "classical" else 0.0
    M = np.array([-rng.uniform(1.0, 4.0), 0.0, c]) * moving
    return Family(ball(tuple(A), tuple(Omega), tuple(K), rolling), M, name, -6.0, 6.0)


def missed(family: Family, counts: Callable[[Family, float], Counts]) -> list[str]:
    """Return the intervals of values whose counts show a bifurcation missing on the branches."""
    points = [point for branch in resting(family) for point in branch.special(FOLD, BRANCH, HOPF)]
    s = (np.arange(VALUES) + 0.5) / VALUES
    seen = [counts(family, value) for value in s]
    lacking = []
    for low, high, one, other in zip(s, s[1:], seen, seen[1:], strict=False):
        within = [p.kind == HOPF for p in points if low <= p.x[-1] <= high]
        folds, hopf = abs(other[0] - one[0]) // 2, abs(other[2] - one[2])
        hopf *= other[:2] == one[:2]
        if folds > len(within) - sum(within):
            lacking.append(f"{folds} folds from {family.value(low)} to {family.value(high)}")
        if hopf > sum(within):
            lacking.append(f"{hopf} Hopf points from {family.value(low)} to {family.value(high)}")
    return lacking


QUICK = {False: 1, True: 3}  # of fixed points and of lines: balls with folds and Hopf points


@pytest.mark.parametrize(
    ("seed", "moving"),
    [
        pytest.param(seed, moving, marks=() if seed == quick else pytest.mark.study)
        for moving, quick in QUICK.items()
        for seed in range(BALLS)
    ],
)
def test_every_fold_and_hopf_point_between_values_is_on_a_branch(seed: int, moving: bool) -> None:
    """Between two of 400 values with different counts there are at least as many special points."""
    assert missed(random_family(seed, moving), lines if moving else at_rest) == []


def test_starting_only_at_the_ends_misses_branches_inside(monkeypatch: pytest.MonkeyPatch) -> None:
    """A classical ball has a closed branch of lines that covers an eightieth of the range.

    It has at least two Hopf points, and is missed from twenty interior values as well.
    """
    monkeypatch.setattr(motion_branches, "_LINES", 0)
    lacking = missed(random_family(3, True), lines)
    assert any("Hopf points from -1.9" in line for line in lacking)
