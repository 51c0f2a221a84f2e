"""What is ours and not the paper's: the numbers of its figures' motions."""

from dataclasses import replace
from functools import cache, partial

import numpy as np

from robotball.engines.reduced.compiled.kernels import kernel_start
from robotball.qualitative.basins import CHAOS, TORUS, Basins, basins
from robotball.qualitative.drift import Drift, drift
from robotball.qualitative.lyapunov import exponents
from validation.paper import formulas as f
from validation.paper.captions import line_ball
from validation.paper.claim import Check, Claim, Residual, Value
from validation.paper.engine import CLASSICAL
from validation.paper.scenes import paper_scene
from validation.paper.section_4_2_points import cycle, with_K3
from validation.paper.section_5_1_lines import line
from validation.paper.section_5_3 import LONG, chaotic, regular, settled, starts


def vanishing(K3: float, more: int, twist: float) -> Residual:
    """How far the numbers of fixed points 1e-4 below and above K₃ are from `more` and four less."""
    counts = [len(f.zeros(f.from_rest(with_K3(twist * K3 + side)), 200)) for side in (-1e-4, 1e-4)]
    return Residual(abs(counts[0] - more) + abs(counts[1] - more + 4), bound=0, unit="points off")


def cycle_period(K3: float, stated: float, twist: float) -> Value:
    """The period of the only limit cycle of a figure."""
    found = cycle(K3, 2 * stated)
    period = found.period if found else float("nan")
    return Value(
        float(period), twist * stated, bound=10 ** (np.floor(np.log10(stated)) - 5), unit="s"
    )


def saddle_foci(twist: float) -> Residual:
    """How many of the four lines at f = 3 are no saddle-foci: a real rate, a pair of other sign.

    Twisted, at f = 2.
    """
    off = 0
    for name in ("σ₊", "σ₋", "δ₊", "δ₋"):
        rates = line(line_ball(), 3.0 if twist == 1 else 2.0, name).rates
        real, pair = rates[np.abs(rates.imag) < 1e-9].real, rates[np.abs(rates.imag) > 1e-9].real
        off += not (len(real) == 1 and len(pair) == 2 and real[0] * pair[0] < 0)
    return Residual(off, bound=0, unit="of 4 off")


def limit_for_any_turning(twist: float) -> Residual:
    """Whether σ₋ is stable below and unstable above 16/7.69, at Ω₃ = 0.5, 1, 2 and 4."""
    wrong = 0
    for Omega3 in (0.5, 1.0, 2.0, 4.0):
        n = line_ball(Omega3)
        n = replace(n, K=n.K * [twist, 1.0, 1.0])
        rates = [line(n, 16 / 7.69 * side, "σ₋").rates.real.max() for side in (0.999, 1.001)]
        wrong += not rates[0] < 0 < rates[1]
    return Residual(wrong, bound=0, unit="of 4 wrong")


def period(twist: float) -> Value:
    """The period of Fig. 11a's periodic orbit."""
    return Value(float(settled()[0].period), twist * 8.74326, bound=1e-5, unit="s")


def multiplier(twist: float) -> Value:
    """The modulus of its multipliers, a complex pair."""
    found = float(np.abs(settled()[0].multipliers).max())
    return Value(found, twist * 0.92816, bound=1e-5)


@cache
def reached() -> Basins:
    """Where 64 starts of Fig. 11a end up."""
    return basins(regular(), *starts(64))


def attracting_cycles(twist: float) -> Value:
    """How many periodic orbits attract, of 64 starts; what else attracts must be a torus.

    Twisted, of 8 starts of Fig. 11b.
    """
    found = reached() if twist == 1 else basins(chaotic(), *starts(8))
    number = len(found.cycles) if found.share(CHAOS) == 0 else float("nan")
    return Value(number, corrected=1, bound=0, unit="cycle")


def one_torus(twist: float) -> Residual:
    """How far the mean velocities of all starts that reach a torus are apart; twisted, of all."""
    attitudes, momenta = starts(64)
    chosen = reached().labels == TORUS if twist == 1 else slice(None)
    along = drift(regular(), attitudes[chosen], momenta[chosen], 2e4, 3000.0).velocities
    # Means over T = 2e4 s of a motion with two frequencies are off by some 1/T.
    return Residual(float(np.ptp(along[:, 0])), bound=1e-3, unit="m/s")


def classical_exponent(twist: float) -> Value:
    """λ₁ of the classical ball with Fig. 14's numbers and c = 3; twisted, of the rubber one."""
    ball = paper_scene(CLASSICAL).parameters if twist == 1 else chaotic()
    found = exponents(ball, *starts(16, c=3.0 if twist == 1 else 0.0), 1e4)
    return Value(found.mean[0], corrected=0.34, bound=5e-3, unit="1/s")  # ± 0.001


@cache
def drift_of(name: str) -> Drift:
    """The mean motion of a figure's contact point; of Fig. 12 over whole periods."""
    if name == "fig14":
        return drift(chaotic(), *starts(16), LONG)
    duration = 1000 * settled()[0].period if name == "fig12" else LONG
    return drift(*kernel_start(paper_scene(name)), duration, 3000.0)


def drift_along(name: str, stated: float, bound: float, twist: float) -> Value:
    """Along OX = -M/√f."""
    return Value(float(drift_of(name).mean[0]), twist * stated, bound=bound, unit="m/s")


def drift_across(twist: float) -> Residual:
    """Along OY, in Figs 12, 13 and 14, the largest; twisted, along OX."""
    index = 1 if twist == 1 else 0
    across = [float(drift_of(name).mean[index]) for name in ("fig12", "fig13", "fig14")]
    # Fig. 14's is a mean of chaos: the standard error is 1.3e-3.
    return Residual(max(across, key=abs), bound=8e-3, unit="m/s")


def number(place: str, statement: str, check: Check, means: str) -> Claim:
    """A row whose statement is a number; twisted, the number by a hundredth."""
    return Claim(place, statement, check, means, "the number, by a hundredth", control=1.01)


CLAIMS = (
    number(
        "4.2",
        "|κ₁| = 1 at K₃ = 0.51503: Δ disappears",
        partial(vanishing, 0.51503, 10),
        "search",
    ),
    number(
        "4.2", "|κ₂| = 1 at K₃ = 2.08207: Θ disappears", partial(vanishing, 2.08207, 6), "search"
    ),
    number(
        "Fig. 7", "the period of its limit cycle", partial(cycle_period, 0.52, 60.0086), "Newton"
    ),
    number(
        "Fig. 8", "the period of its limit cycle", partial(cycle_period, 3.0, 6.09094), "Newton"
    ),
    Claim(
        "Fig. 10",
        "16/7.69 does not depend on Ω₃",
        limit_for_any_turning,
        "eigenvalues",
        "K₁, by a tenth",
        control=1.1,
    ),
    Claim("Fig. 10", "at f = 3 all four are saddle-foci", saddle_foci, "eigenvalues", "f = 2"),
    number("Fig. 11a", "the period of its periodic orbit", period, "Newton"),
    number("Fig. 11a", "|multiplier|", multiplier, "the monodromy"),
    Claim(
        "Fig. 11a",
        "one periodic orbit attracts, and else a torus",
        attracting_cycles,
        "64 starts",
        "Fig. 11b",
    ),
    Claim("Fig. 11a", "one torus: all on it have the same drift", one_torus, "2e4 s", "all starts"),
    Claim(
        "5.3",
        "the classical ball is chaotic too: λ₁",
        classical_exponent,
        "16 runs of 1e4 s",
        "rubber",
    ),
    number(
        "Fig. 12", "drift along X", partial(drift_along, "fig12", 3.65907, 1e-5), "1000 periods"
    ),
    number("Fig. 13", "drift along X", partial(drift_along, "fig13", 3.665, 1e-3), "1e5 s"),
    number(
        "Fig. 14", "drift along X", partial(drift_along, "fig14", 3.276, 1e-2), "16 runs of 1e5 s"
    ),
    Claim("Figs 12-14", "no drift along Y", drift_across, "1e5 s", "along OX"),
)
