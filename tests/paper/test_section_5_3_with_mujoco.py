"""Section 5.3 with MuJoCo: the attractors of Figs 11a and 11b, their exponents and drifts.

The long forms measured: the torus within 1e-6, a cloud of 2000 points at p = 0.92 among 199 of the
equations, λ₁ = 0.1182 ± 0.0011 1/s (0.1157 from the equations).
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import robotball as rb
from robotball import design, sample_times
from robotball.dynamics import long_run
from robotball.dynamics.cycles import Cycle, fixed_point, limit_cycles
from robotball.dynamics.sections import own_start, sections_of
from robotball.engines.mujoco.model import build
from robotball.robot.formulas import speed_bound
from robotball.robot.scene import Scene, Start
from robotball.rotations import Array
from robotball.theory.ensembles.orbits import LONG_RUN_TOLERANCE, orbits
from tests.paper.captions import PERIOD
from tests.paper.clouds import (
    COARSE,
    Recipe,
    Torus,
    cloud_by_contact,
    cloud_by_equations,
    distance,
    distance_to_curve,
    rank_probability,
)
from tests.paper.drifts import drift
from tests.paper.engine_cycles import by_equations, contact_cycle, cycle_crossings, ends_of, rolled
from tests.paper.formulas import paper_scene
from validation.studies.contact_sections import level_starts, sound_run
from validation.studies.long_runs import growths
from validation.study import compiled_motion

F = 25.0  # (kg m²/s)²
BALANCED = rb.preset("balanced")
STRETCH = 10.0  # s: the fastest deviations grow by e^3.4
CLOUD = Recipe(f=F, starts=25, skipped=8, count=20)  # 500 points


def cycle_of(scene: Scene) -> Cycle:
    """Return the limit cycle of a scene with the equations."""
    if scene.start.momentum.any():
        return fixed_point(scene.parameters, 3.6, 0.6, F)
    (cycle,) = limit_cycles(scene.parameters)
    return cycle


@pytest.mark.parametrize(
    ("name", "parts", "settings", "bound"),
    [
        ("fig12", 1, "balanced", 1e-6),
        ("fig08", 4, "balanced", 1e-6),
        # Slow: the error of a step delays it by 1300 s for one of K₃.
        pytest.param("fig07", 12, "accurate", 1e-5, marks=pytest.mark.study),
    ],
)
def test_mujoco_has_the_limit_cycles_of_the_figures(
    name: str, parts: int, settings: str, bound: float
) -> None:
    """Closed on MuJoCo's own map, so that it is known to rounding."""
    scene = paper_scene(name)
    cycle = cycle_of(scene)
    ours = contact_cycle(build(scene, rb.preset(settings)), cycle, parts)
    # Measured 6.9e-8 in Figs 8 and 11a, 2.2e-6 (multiplier) in Fig. 7: the steps of MuJoCo.
    assert ours.period == pytest.approx(cycle.period, abs=bound)
    multipliers = [abs(closed.multipliers[0]) for closed in (ours, cycle)]
    assert multipliers[0] == pytest.approx(multipliers[1], rel=bound)


def test_mujocos_cycle_of_fig_11a_crosses_and_drifts_as_that_of_the_equations() -> None:
    scene = paper_scene("fig12")
    model, cycle = build(scene, BALANCED), cycle_of(scene)
    ours = contact_cycle(model, cycle)
    q, M = cycle.attitude[None], cycle.momentum[None]
    exact = sections_of(scene.parameters, q, M, 1, direction=-1)
    through = cycle_crossings(model, ours).only(-1)
    assert ours.period == pytest.approx(PERIOD, abs=1e-5)
    assert through.L[0] == pytest.approx(exact.L[0, 0], abs=1e-6)
    assert through.l[0] == pytest.approx(exact.l[0, 0], abs=1e-6)
    start = own_start(scene, cycle.attitude, cycle.momentum)
    moved = sound_run(model, start, sample_times(cycle.period, 5e-3)).contact_point[-1]
    # OX is against M by (3.3), and |M| is 5.
    along = -float(moved @ cycle.momentum[:2]) / 5 / cycle.period
    periods = drift(scene.parameters, q, M, 100 * cycle.period, cycle.period)
    assert along == pytest.approx(float(periods.mean[0]), abs=1e-5)


@pytest.mark.study
def test_mujocos_limit_torus_is_the_equations() -> None:
    """Every crossing lies on the curve of the equations' torus, once the start is forgotten."""
    scene = paper_scene("fig13")
    torus = Torus(L=0.0, l=1.96, spread=0.2, f=F, starts=24, skipped=250, count=1000)
    curve = cloud_by_equations(scene.parameters, torus, seed=0)
    short = Torus(L=0.0, l=1.96, spread=0.0, f=F, starts=1, skipped=50, count=15)
    contact, _ = cloud_by_contact(scene, BALANCED, short, seed=0)
    apart = distance_to_curve(contact.states, curve.states)
    # Measured 1e-6 of vectors of length one: the way from the start, dying out by e in 57 s.
    assert apart.max() < 1e-5
    assert np.ptp(contact.L) > 4  # and they are all along it


@pytest.mark.study
def test_mujocos_strange_attractor_is_the_equations() -> None:
    """500 section points do not differ from 500 of the equations at the level of 2 %.

    By rank among 49 clouds drawn by the same recipe, which needs no independent points. The same
    test detects a ball with K off by 10 %.
    """
    scene = paper_scene("fig14")
    ball = scene.parameters
    contact, velocities = cloud_by_contact(scene, COARSE, CLOUD, seed=0)
    reference, *peers = (cloud_by_equations(ball, CLOUD, seed).states for seed in range(1, 51))
    assert len(contact.states) == 500
    # Measured 0.34; of right clouds, uniform between 0.02 and 1.
    assert rank_probability(contact.states, peers, reference) > 0.02
    K1, K2, K3 = ball.K
    other = replace(ball, K=(1.1 * K1, 1.1 * K2, 1.1 * K3))
    wrong = energy_distance(cloud_by_equations(other, CLOUD, seed=0).states, reference)
    # Measured 0.037, and 0.011 at most.
    assert wrong > 2 * max(energy_distance(peer, reference) for peer in peers[:20])
    # Drift 3.276 m/s: measured 3.339 ± 0.027, the error from the scatter of the starts.
    mean, scatter = velocities.mean(axis=0), velocities.std(axis=0, ddof=1)
    assert np.all(np.abs(mean - [3.276, 0.0]) < 4 * scatter / np.sqrt(CLOUD.starts))


@pytest.mark.study
@pytest.mark.parametrize(
    ("name", "last", "count", "settings", "bound"),
    [
        ("fig12", 4, 1, rb.preset("fast"), 1e-5),
        ("fig13", 5, 1, rb.preset("fast"), 1e-5),
        ("fig14", 5, 16, COARSE, 1e-4),
        # A classical ball slips at COARSE's steps.
        ("classical_chaotic", 5, 12, rb.preset("fast"), 1e-4),
    ],
)
def test_mujoco_has_the_exponents_of_the_equations(
    name: str, last: int, count: int, settings: rb.Settings, bound: float
) -> None:
    """All six over 1000 s, of starts that the equations brought to the attractor in 3000 s."""
    scene = paper_scene(name)
    ball, (attitudes, momenta) = scene.parameters, level_starts(scene, count, seed=0)
    times = np.array([0.0, 3000.0])
    brought = orbits(ball, attitudes, momenta, times, LONG_RUN_TOLERANCE).attitudes[:, -1]
    flow = partial(rolled, build(scene, settings), STRETCH)
    growth = growths(scene, flow, STRETCH, 20, 100, (brought, momenta))
    logarithms, divergence = by_equations(growth, ball, momenta)
    along, ours = (logs.mean(axis=(0, 1)) / STRETCH for logs in (logarithms, growth.logarithms))
    # Measured 4e-7 to 7e-7 (regular) and 2.1e-5 (chaotic): MuJoCo's steps.
    assert np.abs(ours - along).max() < bound
    # Measured 7.5e-4: the sum ends within ln(0.8/0.6)/2 of the divergence, over 1000 s.
    assert ours.sum() == pytest.approx(divergence, abs=2e-3)
    if count > 1:
        exact = long_run.exponents_of(ball, *level_starts(scene, 64, seed=1), 1e4)
        ends = ends_of(growth, last)
        for mean, error, other in zip(ends.mean, ends.error, exact.mean, strict=True):
            assert abs(mean - other) < 5 * error  # measured 1.7 standard errors


@pytest.mark.study
def test_the_classical_section_does_not_differ_from_sections_of_the_equations() -> None:
    """By its rank among 99 clouds of the same recipe."""
    scene = paper_scene("classical_chaotic")
    recipe = Recipe(f=F, starts=50, skipped=8, count=20, c=3.0)
    reference, *peers = (
        cloud_by_equations(scene.parameters, recipe, seed).states for seed in range(1, 101)
    )
    points, _ = cloud_by_contact(scene, rb.preset("fast"), recipe, seed=0)
    # Measured 0.38; uniform between 0.01 and 1 if the law is the same.
    assert rank_probability(points.states, peers, reference) > 0.01


# Drift and speed ---------------------------------------------------------------------------


@pytest.mark.slow
def test_the_drift_along_OX_over_omega_is_that_of_the_equations() -> None:
    """The ball of Fig. 11a with other |Ω|; the equations start where MuJoCo is after 50 s."""
    scene = paper_scene("fig12")
    ball = scene.parameters
    for speed in (0.5, 2.25, 4.0):
        bodies = design(ball.A, (0.0, 0.0, speed), ball.K, ball.a, scene.ball.mass)
        other = replace(scene, ball=bodies.ball)
        for start in zip(*level_starts(other, 2, seed=0), strict=True):
            begun = replace(other, start=own_start(other, *start))
            motion = rb.simulate(begun, np.array([0.0, 50.0, 100.0]), settings="fast")
            # M as at the start: its drift over the transient would lead to another level.
            late = replace(other, start=Start(motion.attitude[1], begun.start.momentum))
            theory = compiled_motion(late, np.array([0.0, 50.0])).contact_point[1, 0]
            ours = motion.contact_point[2, 0] - motion.contact_point[1, 0]
            # Measured 3.5e-3 m/s at most: MuJoCo's steps, half of it the loss of M.
            assert ours / 50 == pytest.approx(theory / 50, abs=1e-2)


@pytest.mark.study
@pytest.mark.parametrize(("name", "seconds"), [("fig14", 4000.0), ("wobbling_drive", 1000.0)])
def test_in_long_runs_the_momentum_is_kept_and_bounds_the_speed(name: str, seconds: float) -> None:
    scene, times = paper_scene(name), sample_times(seconds)
    motion = rb.simulate(scene, times, settings="fast")
    size = np.array([np.linalg.norm(scene.start.momentum)])
    balls = map(scene.parameters_at, times[: 1 if scene.steady else 1000])
    # By (2.1) the contact point moves at a|ω - Ω| at most.
    bound = max(b.a * (float(speed_bound(b, size)[0]) + np.linalg.norm(b.Omega)) for b in balls)
    speeds = np.linalg.norm(np.diff(motion.contact_point, axis=0), axis=1) / times[1]
    assert speeds.max() < bound
    assert np.linalg.norm(motion.momentum[-1]) == pytest.approx(size[0], rel=1e-2)


# How clouds are compared -------------------------------------------------------------------


def energy_distance(first: Array, second: Array) -> float:
    """Return 2E|x - y| - E|x - x'| - E|y - y'|, 0 only for equal distributions."""
    return distance(first, second) - distance(second, second)


def test_energy_distance_of_points_is_twice_their_distance() -> None:
    """For single points it is 2|x - y|; of samples of one law it is little."""
    cloud, other = np.random.default_rng(0).normal(size=(2, 500, 3))
    assert energy_distance(np.zeros((1, 2)), np.array([[3.0, 4.0]])) == pytest.approx(10)
    assert 0 < energy_distance(cloud, other) < 0.02  # measured 0.010
    assert energy_distance(cloud, other + 0.5) > 0.1  # measured 0.25


def test_rank_probability_is_exact() -> None:
    """Among 9 peers from the same distribution, each rank has probability 1/10."""
    random = np.random.default_rng(1)
    ranks = []
    for _ in range(100):
        reference, cloud, *peers = random.normal(size=(11, 20, 2)).cumsum(axis=1)
        ranks.append(round(10 * rank_probability(cloud, peers, reference)))
    counts = np.bincount(ranks, minlength=11)[1:]
    assert counts.sum() == 100
    assert 1 < counts.min() < counts.max() < 25  # measured 5 to 19, of 10 ± 3


def test_distance_to_a_curve_is_from_between_its_points() -> None:
    """A point 1e-4 off a circle of 10,000 points is 1e-4 off, wherever it is."""
    turn = np.linspace(0, 2 * np.pi, 10_000, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = (1 + 1e-4) * np.stack([np.cos(turn + 2e-4), np.sin(turn + 2e-4)], axis=1)
    # Measured 1.0e-6 off: the sagitta of the eight neighbours of the fitted line.
    assert distance_to_curve(points, circle) == pytest.approx(1e-4, abs=2e-6)
