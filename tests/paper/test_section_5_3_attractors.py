"""Section 5.3: the attractors of Figs 11a and 11b, their exponents, and Figs 12 to 14.

Here six neighbours of a motion give all six Lyapunov exponents of (3.2) in (M, γ), of which four
must be 0; robotball computes the first from one neighbour and the last from the divergence. Chaotic
numbers are means over 16 starts and 1e5 s, with standard errors of 2.3e-4 (Λ₁), 2.7e-4 (Λ₆) and
9.5e-4 (D); their bounds are at least five of these.
"""

from dataclasses import replace
from functools import cache

import numba
import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from robotball import preset
from robotball.dynamics.cycles import Cycle, fixed_point, monodromy_of
from robotball.dynamics.long_run import (
    CHAOS,
    TORUS,
    Basins,
    Exponents,
    basins,
    exponents_of,
)
from robotball.dynamics.sections import section_starts, sections_of
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.robot.formulas import Parameters
from robotball.robot.scene import Start
from robotball.rotations import Array, ComplexArray, from_matrix, rotation_matrix, tangents
from robotball.theory.compiled import inlined
from robotball.theory.ensembles.orbits import kernel_start, orbit
from tests.paper import formulas as f
from tests.paper.captions import CAPTIONS, PERIOD, F
from tests.paper.drifts import Drift, drift
from tests.paper.engine_ball import CLASSICAL, mujoco_ball
from tests.paper.formulas import Numbers, paper_scene

LONG = 1e5  # s


def regular() -> Parameters:
    """Return the ball of Figs 11a, 12 and 13."""
    return paper_scene("fig12").parameters


def chaotic() -> Parameters:
    """Return the ball of Figs 11b and 14."""
    return paper_scene("fig14").parameters


def starts(number: int, c: float = 0.0) -> tuple[Array, Array]:
    """Return random attitudes (n, 4) and momenta (n, 3) on the section g = 0."""
    random = np.random.default_rng(2)
    L, l = random.uniform(-4.5, 4.5, number), random.uniform(0, 2 * np.pi, number)
    return section_starts(L, l, F, c=c)


# Fig. 11a: one cycle, one torus --------------------------------------------------------------


@cache
def settled() -> tuple[Cycle, Array]:
    """Return the cycle that Fig. 12's motion reaches, and M, γ at three crossings (3, 6)."""
    # 200 crossings come near the cycle; Newton's method does the rest.
    runs = sections_of(regular(), *section_starts(3.6, 0.6, F), count=200)
    cycle = fixed_point(regular(), runs.L[0, -1], runs.l[0, -1], F)
    through = sections_of(regular(), cycle.attitude[None], cycle.momentum[None], count=3)
    axes = rotation_matrix(through.attitudes[0])
    return cycle, np.concatenate([cycle.momentum @ axes, axes[:, 2]], axis=1)


def flow() -> f.Field:
    """Return d/dt of (M, γ) of Fig. 11a's ball by (3.2)."""
    return f.reduced(f.rubber_velocity, f.numbers(regular()))


def test_the_two_concentrations_of_fig_11a_are_one_periodic_motion() -> None:
    """Fig. 11a, E23: (3.2) leads from one to the other, and after a period back to the first."""
    cycle, (one, other, again) = settled()

    def miss(part: float) -> float:
        path = f.followed(flow(), one, np.linspace(0.0, part * cycle.period, 401))
        reach = np.linalg.norm(path - other, axis=1).min()
        spacing = np.linalg.norm(np.diff(path, axis=0), axis=1).max()
        back = np.linalg.norm(path[-1] - one) + np.linalg.norm(again - one)
        return float(back + max(reach - spacing, 0.0))  # it passes the other between two samples

    assert miss(1.0) <= 1e-10  # measured 1.1e-11: scipy
    assert miss(0.5) > 1.0  # control: half the period, 10


def test_the_periodic_motion_of_fig_11a_attracts() -> None:
    """Fig. 11a: what remains of a neighbour's distance after ten periods of (3.2)."""
    cycle, (one, _, _) = settled()
    turn = f.turned_about(tangents(one[3:])[0], 1e-4)  # of both, which keeps f and (M, γ)
    beside = np.concatenate([turn @ one[:3], turn @ one[3:]])

    def remainder(sense: float) -> float:
        field, times = flow(), np.array([0.0, 10 * cycle.period])
        away = f.followed(lambda x: sense * field(x), beside, times, 1e-9)[-1] - one
        along = f.unit(field(one))
        return float(np.linalg.norm(away - (away @ along) * along)) / (1e-4 * np.sqrt(F))

    assert remainder(+1) <= 0.8  # measured 0.58
    assert remainder(-1) > 1.5  # control: back in time, 2.4


def test_the_period_and_the_multiplier_of_the_cycle_of_fig_11a() -> None:
    """Not printed in the paper: 8.74326 s and a pair of multipliers of size 0.92816."""
    cycle, _ = settled()
    assert abs(cycle.period - PERIOD) <= 1e-5  # s; measured 1.4e-6: its last digit
    assert abs(np.abs(cycle.multipliers).max() - 0.92816) <= 1e-5  # measured 7.7e-7


def test_the_exponents_of_the_cycle_add_up_to_the_mean_divergence() -> None:
    """Not in the paper: ln det of the monodromy is ∫ -(Aγ, γ×Ω)/(Aγ,γ) dt over the period."""
    cycle, _ = settled()
    _, monodromy, volume = monodromy_of(regular(), cycle.attitude, cycle.momentum, cycle.period)
    growth = np.log(np.linalg.det(monodromy))
    assert abs(growth - volume) <= 2e-13  # measured 2.7e-14: rounding
    assert abs(growth + volume) > 0.1  # control: the sign, 0.30


def test_the_cycle_of_fig_11a_is_its_own_mirror_image() -> None:
    """Not in the paper: -γ, -M cross g = π where γ, M cross g = 0."""
    cycle, _ = settled()

    def crossings(g: float) -> Array:
        start = cycle.attitude[None], cycle.momentum[None]
        return sections_of(regular(), *start, count=4, g=g).states[0]

    assert cdist(-crossings(0.0), crossings(np.pi)).min(axis=1).max() <= 3e-13  # measured 1.3e-14
    assert (
        cdist(crossings(0.0), crossings(0.3)).min(axis=1).max() > 0.3
    )  # control: sign and g, 0.95


@cache
def torus_points(L: float, l: float) -> Array:
    """Return (l, L/√f) (n, 2) of 2000 crossings of g = 0 after as many, with 0 ≤ l < 2π."""
    crossings = sections_of(regular(), *section_starts(L, l, F), count=4000)
    return np.stack(
        [crossings.l[0, 2000:] % (2 * np.pi), crossings.L[0, 2000:] / np.sqrt(F)], axis=1
    )


def test_another_start_reaches_the_torus_of_fig_13() -> None:
    """Fig. 11a: a limit torus."""
    tree = cKDTree(torus_points(0.0, 1.96))
    assert np.max(tree.query(torus_points(0.3, 1.8))[0]) <= 0.05  # measured 0.026: their spacing
    assert np.max(tree.query(torus_points(3.6, 0.6))[0]) > 0.2  # control: Fig. 12's start, 0.43


def test_the_curve_of_the_torus_has_two_parts_on_the_involute() -> None:
    """Fig. 11a, whose edges l = 0 and 2π cut a curve that runs around the annulus."""

    def pieces(cut: float) -> int:
        l, height = torus_points(0.0, 1.96).T
        tree = cKDTree(np.stack([(l - cut) % (2 * np.pi), height], axis=1))
        near = tree.sparse_distance_matrix(tree, 0.2, output_type="coo_matrix")
        return int(connected_components(near)[0])

    assert pieces(0.0) == 2
    assert pieces(1.05) != 2  # control: edges in the middle of a piece, 6


@cache
def reached() -> Basins:
    """Find what 64 starts of Fig. 11a reach."""
    return basins(regular(), *starts(64))


def test_the_attractors_of_fig_11a_are_one_cycle_and_a_torus() -> None:
    """Not in the paper, which shows one of each; from 64 starts."""
    assert (len(reached().cycles), reached().share(CHAOS)) == (1, 0)
    assert basins(chaotic(), *starts(8)).share(CHAOS) > 0  # control: Fig. 11b


def test_all_starts_that_reach_a_torus_drift_alike() -> None:
    """Not in the paper: so there is one torus in Fig. 11a."""
    attitudes, momenta = starts(64)

    @cache
    def velocities(on_torus: bool) -> Array:
        chosen = (reached().labels == TORUS) == on_torus
        return drift(regular(), attitudes[chosen], momenta[chosen], 2e4, 3000.0).velocities[:, 0]

    everywhere = np.concatenate([velocities(True), velocities(False)])
    assert np.ptp(velocities(True)) <= 1e-3  # m/s; measured 4.1e-4: the mean over 2e4 s
    assert np.ptp(everywhere) > 3e-3  # control: those that reach the cycle too, 6.5e-3


# Fig. 11b: exponents -------------------------------------------------------------------------

STEP = 0.02  # s, of RK4
STEPS_PER_QR = 50


@inlined
def rate(
    x: ComplexArray, a: Array, Omega: Array, K: Array, omega: ComplexArray, result: ComplexArray
) -> None:
    """Find d/dt of (M, γ) (6,) and ω (3,) by (3.2); x (6,) may be complex."""
    M, gamma = x[:3], x[3:]
    along, Z = 0.0 * x[0], 0.0 * x[0]
    for i in range(3):
        along += a[i] * gamma[i] * gamma[i]
        Z += (Omega[i] + a[i] * K[i]) * gamma[i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across = M[j] * a[k] * gamma[k] - M[k] * a[j] * gamma[j]
        omega[i] = a[i] * ((across + Z * gamma[i]) / along - K[i])
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        result[i] = M[j] * omega[k] - M[k] * omega[j]
        result[3 + i] = gamma[j] * omega[k] - gamma[k] * omega[j]


def move_six(state: Array, bundle: Array, a: Array, Omega: Array, K: Array) -> None:
    """Move a state (6,) and its six neighbours, the columns of a bundle (6, 6), by STEPS_PER_QR.

    Complex steps give the derivative of RK4 itself, without cancellation.
    """
    # Element by element: each sum of arrays would take a second to compile.
    tiny, (begin, x, end, omega, result) = 1e-30, np.zeros((5, 6), np.complex128)
    for _ in range(STEPS_PER_QR):
        for i in range(6):
            for j in range(6):
                begin[j] = x[j] = end[j] = state[j] + 1j * tiny * bundle[j, i]
            for part, weight in ((0.5, 1 / 6), (0.5, 1 / 3), (1.0, 1 / 3), (0.0, 1 / 6)):
                rate(x, a, Omega, K, omega, result)
                for j in range(6):
                    x[j] = begin[j] + part * STEP * result[j]
                    end[j] += weight * STEP * result[j]
            for j in range(6):
                bundle[j, i] = end[j].imag / tiny
        for j in range(6):
            state[j] = end[j].real


def six_exponents(n: Numbers, M: Array, gamma: Array, duration: float) -> Array:
    """Return the exponents (6,) over a duration [s] after a tenth of it, largest first [1/s]."""
    move = numba.njit(cache=True)(move_six)
    rounds = int(duration / (STEP * STEPS_PER_QR))
    state, bundle, growths = np.concatenate([M, gamma]), np.eye(6), np.zeros(6)
    # In the first tenth the neighbours align with their directions.
    for i in range(-(rounds // 10), rounds):
        move(state, bundle, n.moments.copy(), n.Omega, n.K)
        # Without this all six would align with the fastest direction.
        bundle, R = np.linalg.qr(bundle)
        growths += np.log(np.abs(np.diag(R))) * (i >= 0)
    return np.sort(growths / (rounds * STEP * STEPS_PER_QR))[::-1]


@cache
def six() -> Array:
    """Return Λ₁ … Λ₆ of Fig. 14's motion over 6000 s."""
    caption = CAPTIONS["fig14"]
    return six_exponents(caption.n, caption.M, caption.axes[2], 6000.0)


@pytest.mark.slow
def test_the_first_and_the_last_of_six_exponents_are_those_of_robotball() -> None:
    """Section 5.3: Λ₁ and Λ₆ from six neighbours."""
    assert np.abs(six()[[0, 5]] - [0.116, -0.139]).max() <= 0.02  # 1/s; measured 5.0e-3: 6000 s
    assert abs(six()[5] - 0.139) > 0.1  # control: the sign of Λ₆


@pytest.mark.slow
def test_the_other_four_exponents_are_zero() -> None:
    """Section 5.3: Λ₂ ≈ Λ₃ ≈ Λ₄ ≈ Λ₅ ≈ 0."""
    assert np.abs(six()[1:5]).max() <= 4e-3  # 1/s; measured 3.7e-4
    assert np.abs(six()[0:4]).max() > 0.05  # control: Λ₁ … Λ₄, 0.11


@cache
def ensemble() -> Exponents:
    """Return the exponents of Fig. 11b from 16 starts."""
    return exponents_of(chaotic(), *starts(16), duration=LONG)


def test_the_exponents_and_the_dimension_are_those_printed_to_a_unit_of_their_last_digit() -> None:
    """Section 5.3, E26: Λ₁ ≈ 0.11, Λ₆ ≈ -0.13 and D = 1 + Λ₁/|Λ₆| ≈ 1.84, cut short."""
    first, last = ensemble().mean
    numbers = np.array([first, last, 1 + first / abs(last)])  # measured 0.1163, -0.1396, 1.8329
    assert np.abs(numbers - [0.11, -0.13, 1.84]).max() <= 0.01
    assert np.abs(np.roll(numbers, 1) - [0.11, -0.13, 1.84]).min() > 0.1  # control: exchanged


def test_the_exponents_and_the_dimension_to_a_further_digit() -> None:
    """Not in the paper: 0.116, -0.139 and 1.832."""
    (first, last), dimension = ensemble().mean, ensemble().dimension
    assert abs(first - 0.116) <= 2e-3  # 1/s; measured 2.9e-4
    assert abs(last + 0.139) <= 2e-3  # 1/s; measured 6.2e-4
    assert abs(dimension - 1.832) <= 5.5e-3  # measured 9.1e-4


def test_the_classical_ball_is_chaotic_too() -> None:
    """Not in the paper: λ₁ = 0.34 of Fig. 14's numbers with (M, γ) = 3."""
    ball = paper_scene(CLASSICAL).parameters
    mean = exponents_of(ball, *starts(16, c=3.0), 1e4).mean[0]
    assert abs(mean - 0.34) <= 5e-3  # 1/s; measured 1.6e-3, with a standard error of 1e-3
    assert abs(ensemble().mean[0] - 0.34) > 0.1  # control: the rubber ball, 0.116


@pytest.mark.slow
def test_neighbours_of_fig_14_part_as_on_a_strange_attractor() -> None:
    """Fig. 14, E22: in MuJoCo at 0.116 1/s. The paper prints "the stable limit cycle"."""
    piece, apart = 20.0, 1e-5

    def rate(name: str, pieces: int) -> float:
        """Return the mean rate of growth of a neighbour's distance, by Benettin's method."""
        scene = paper_scene(name)
        attitude, momentum = scene.start.attitude, scene.start.momentum
        model, times = build(scene, preset("balanced")), np.array([0.0, piece])
        turn, total = f.E[0], 0.0
        for _ in range(pieces):
            beside = from_matrix(rotation_matrix(attitude) @ f.turned_about(turn, apart))
            ends = [
                run(model, times, scene=replace(scene, start=Start(q, momentum))).attitude[-1]
                for q in (attitude, beside)
            ]
            first, second = map(rotation_matrix, ends)
            away = first.T @ second - second.T @ first
            vector = np.array([away[2, 1], away[0, 2], away[1, 0]])
            total += np.log(np.linalg.norm(vector) / 2 / apart)
            attitude, turn = ends[0], f.unit(vector)
        return float(total / (pieces * piece))

    assert abs(rate("fig14", pieces=12) - 0.116) <= 0.08  # 1/s; measured 0.104, scatter 0.02
    assert abs(rate("fig12", pieces=3)) < 0.036  # printed, and the control: a cycle, 0.007


# Figs 12 to 14: the contact point ------------------------------------------------------------


@pytest.mark.parametrize("name", ["fig12", "fig13", "fig14"])
def test_the_contact_point_moves_along_OX_on_average(name: str) -> None:
    """Figs 12 to 14: MuJoCo, 150 s."""
    X, Y = mujoco_ball(name, 150.0, 0.05).motion.contact_point[-1] / 150.0
    assert abs(X) >= 1.0  # m/s; measured 3.64, 3.67 and 3.18
    assert abs(Y) < 0.5  # control: along OY, 0.0015, 0.013 and 0.22


@pytest.mark.parametrize("name", ["fig12", "fig13"])
def test_the_deviation_along_OY_stays_bounded(name: str) -> None:
    """Figs 12 and 13: the ratio of Y's ranges in 150 s and in 75 s of MuJoCo's motion."""

    def growth(name: str) -> float:
        Y = mujoco_ball(name, 150.0, 0.05).motion.contact_point[:, 1]
        return float(np.ptp(Y) / np.ptp(Y[: len(Y) // 2]))

    assert growth(name) <= 1.03  # measured 1.000 and 1.005
    assert growth("fig14") > 1.5  # control: Fig. 14, 2.6


def test_the_deviation_of_fig_14_along_OY_grows() -> None:
    """Fig. 14: the ratio of Y's ranges in 4000 s and in 100 s of (3.2)."""

    def growth(name: str) -> float:
        parameters, attitude, momentum = kernel_start(paper_scene(name))
        times = np.arange(0.0, 4000.0, 0.05)
        Y = orbit(parameters, attitude[0], momentum[0], times, 1e-10)[:, 5]
        return float(np.ptp(Y) / np.ptp(Y[:2000]))

    assert growth("fig14") >= 2.0  # measured 6.1
    assert growth("fig13") < 1.2  # control: Fig. 13, 1.02


@cache
def drift_of(name: str) -> Drift:
    """Return the mean motion of a figure's contact point; Fig. 12's over whole periods."""
    if name == "fig14":
        return drift(chaotic(), *starts(16), LONG)
    duration = 1000 * settled()[0].period if name == "fig12" else LONG
    return drift(*kernel_start(paper_scene(name)), duration, 3000.0)


@pytest.mark.parametrize(
    ("name", "speed", "bound", "sideways"),
    [("fig12", 3.65907, 1e-5, 1e-8), ("fig13", 3.665, 1e-3, 1e-5), ("fig14", 3.276, 1e-2, 8e-3)],
)
def test_the_drift_is_along_OX_alone(
    name: str, speed: float, bound: float, sideways: float
) -> None:
    """Not printed in the paper: over 1000 periods or 1e5 s."""
    X, Y = drift_of(name).mean
    assert abs(X - speed) <= bound  # m/s; measured 3.1e-6, 3.1e-4 and 2.1e-3
    # Measured 2.6e-12, 1.0e-6, and 1.4e-3 with a standard error of 1.3e-3.
    assert abs(Y) <= sideways
