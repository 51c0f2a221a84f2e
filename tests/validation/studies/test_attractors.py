"""The attractors of Fig. 11 as the contact model has them: by its own map and by clouds.

`robotball attractors` measures the same at full length. It found: period
8.7432614 s off by 1e-8, torus off by 1e-6, the cloud of 2000 points at p = 0.92 among 199 of the
equations' own, λ₁ = 0.1182 ± 0.0011 1/s (0.1157 by the equations).
"""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.qualitative.sections import crossings_of_motion, section
from robotball.rotations import Array, multiply
from validation.studies.contact_sections import (
    COARSE,
    Recipe,
    Torus,
    cloud_by_contact,
    cloud_by_equations,
    distance,
    distance_to_curve,
    rank_probability,
)

F = 25.0  # (kg m²/s)²
BALANCED = rb.preset("balanced")
CLOUD = Recipe(f=F, starts=25, skipped=8, count=20)  # 500 points


@pytest.mark.parametrize(
    ("name", "g"), [("fig12", 0.0), ("fig14", 0.3), ("classical_chaotic", -0.5)]
)
def test_a_sampled_motion_crosses_where_the_equations_do(name: str, g: float) -> None:
    """Cubics through samples 5 ms apart find time and place; the compiled section is the reference.

    Their error is that of the cubics, h⁴/384 of a fourth derivative of some 1000 1/s⁴.
    """
    scene = rb.load_scene(name)
    found = crossings_of_motion(rb.integrate(scene, rb.sample_times(20.0, 5e-3)), scene, g)
    attitude = multiply(scene.start.attitude, scene.principal_quaternion)
    momentum = scene.start.momentum
    exact = section(scene.parameters, attitude[None], momentum[None], len(found.times), g)
    assert len(found.times) >= 4
    assert np.array_equal(found.directions, exact.directions[0])
    # Measured 7e-10 s, 1.7e-8 kg m²/s and 3e-9 at most (classical_chaotic).
    assert np.abs(found.times - exact.times[0]).max() < 1e-8
    assert np.abs(found.L - exact.L[0]).max() < 1e-7
    assert np.abs(np.sin((found.l - exact.l[0]) / 2)).max() < 1e-7


@pytest.mark.study
def test_mujocos_limit_torus_is_the_equations() -> None:
    """Every crossing lies on the curve of the equations' torus, once the start is forgotten."""
    scene = rb.load_scene("fig13")
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
    """500 section points cannot be told from as many of the equations, at the level of 2 %.

    By rank among 49 clouds drawn by the same recipe, which needs no independent points. The same
    test tells a ball with K off by 10 %.
    """
    scene = rb.load_scene("fig14")
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


def energy_distance(first: Array, second: Array) -> float:
    """2E|x - y| - E|x - x'| - E|y - y'|: 0 only for equal laws."""
    return distance(first, second) - distance(second, second)


def test_energy_distance_of_points_is_twice_their_distance() -> None:
    """For single points it is 2|x - y|; of samples of one law it is little."""
    cloud, other = np.random.default_rng(0).normal(size=(2, 500, 3))
    assert energy_distance(np.zeros((1, 2)), np.array([[3.0, 4.0]])) == pytest.approx(10)
    assert 0 < energy_distance(cloud, other) < 0.02  # measured 0.010
    assert energy_distance(cloud, other + 0.5) > 0.1  # measured 0.25


def test_rank_probability_is_exact() -> None:
    """Among 9 peers drawn alike every tenth has each rank, whatever the law."""
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
    # Measured 1.0e-6 off: the sagitta of the eight neighbours that a line is laid through.
    assert distance_to_curve(points, circle) == pytest.approx(1e-4, abs=2e-6)
