"""Requests that no ball can meet are refused: the line names the reason and by how much."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball import Limits, design
from robotball.rotations import Array
from tests.random_balls import random_axis

# What the refusal must say, with a group for a number, that number, and the request.
Refused = tuple[str, float, dict[str, Any]]
NUMBER = r"(-?[\d.]+(?:e[+-]\d+)?)"


def symmetric(rng: np.random.Generator, b: Array) -> Array:
    """A (3, 3) in axes turned at random, with the eigenvalues 1/b."""
    Q = Rotation.random(random_state=rng).as_matrix()
    A = Q @ np.diag(1 / b) @ Q.T
    return (A + A.T) / 2


def buildable_b(rng: np.random.Generator) -> Array:
    """b (3,) with max b <= 0.39 Σb."""
    b = np.array([1.0, *rng.uniform(0.8, 0.99, 2)])
    return 10 ** rng.uniform(-3, 3) * b


def no_mass_at_all(rng: np.random.Generator) -> Refused:
    x, y = rng.uniform(0.1, 1, 2)
    excess = (x + y) * rng.uniform(0.001, 2)
    A = symmetric(rng, np.array([x, y, x + y + excess]))
    return f"triangle inequality: .* {NUMBER} kg m² too large, whatever", excess, {"A": A}


def too_heavy_for_the_triangle_inequality(rng: np.random.Generator) -> Refused:
    b = buildable_b(rng)
    most = b.sum() - 2 * b.max()
    mass = most + rng.uniform(0.001, 0.999) * (b.min() - most)
    request = {"A": symmetric(rng, b), "mass": mass}
    return f"triangle inequality: .* breaks it by {NUMBER} kg m²", mass - most, request


def too_heavy_for_a_positive_inertia(rng: np.random.Generator) -> Refused:
    b = buildable_b(rng)
    mass = b.min() * rng.uniform(1.001, 5)
    request = {"A": symmetric(rng, b), "mass": mass}
    return f"inertia not positive: .* principal moment {NUMBER} kg m²", b.min() - mass, request


def least_masses_too_large(rng: np.random.Generator) -> Refused:
    b = buildable_b(rng)
    most = b.sum() - 2 * b.max()
    mass = rng.choice([None, rng.uniform(0.3, 0.99) * most])
    parts = rng.uniform(0.1, 1, 3)
    parts *= (mass or most) * rng.uniform(1.001, 2) / parts.sum()
    limits = Limits(shell_mass=parts[0], frame_mass=parts[1], rotor_mass=parts[2])
    excess = parts.sum() - mass if mass else parts.sum() + 2 / 3 * parts[0] - most
    request = {"A": symmetric(rng, b), "mass": mass, "limits": limits}
    return f"masses: .* {NUMBER} kg too much", excess, request


def mass_outside_the_shell(rng: np.random.Generator) -> Refused:
    if rng.integers(2):
        b = buildable_b(rng)
        mass = heaviest = b.sum() / 5 * rng.uniform(0.1, 0.999)
    else:
        x, y = rng.uniform(0.5, 1, 2)
        b = np.array([x, y, (x + y) * rng.uniform(0.67, 0.99)])
        mass, heaviest = None, b.sum() - 2 * b.max()
    request = {"A": symmetric(rng, b), "mass": mass, "limits": Limits(buildable=True)}
    return f"mass inside the shell: .* {NUMBER} kg too little", b.sum() / 5 - heaviest, request


def rotors_too_slow(rng: np.random.Generator) -> Refused:
    """All of tr P/2 = (Σb - 3s)/2 in the rotors cannot make h at this rate, for any s."""
    b = buildable_b(rng)
    K = b.sum() * rng.uniform(0.1, 10) * random_axis(rng)
    speed = 2 * float(np.linalg.norm(K)) / b.sum() * rng.uniform(0.3, 1)
    request = {
        "A": symmetric(rng, b),
        "K": K,
        "Omega": np.zeros(3),
        "limits": Limits(rotor_speed=speed),
    }
    return f"rotor speed: at most {NUMBER} rad/s is allowed, .* needs .* more", speed, request


INFEASIBLE: dict[Callable[[np.random.Generator], Refused], int] = {
    no_mass_at_all: 200,
    too_heavy_for_the_triangle_inequality: 200,
    too_heavy_for_a_positive_inertia: 200,
    least_masses_too_large: 200,
    mass_outside_the_shell: 180,
    rotors_too_slow: 20,
}


def test_a_thousand_requests_are_infeasible() -> None:
    """Of which each reason has its share."""
    assert sum(INFEASIBLE.values()) == 1000


@pytest.mark.slow
@pytest.mark.parametrize("make", INFEASIBLE, ids=lambda make: make.__name__)
def test_infeasible_requests_are_all_refused_with_the_right_reason(
    make: Callable[[np.random.Generator], Refused],
) -> None:
    """Each breaks one condition by construction; the line names it and by how much."""
    rng = np.random.default_rng(3)
    for _ in range(INFEASIBLE[make]):
        reason, amount, request = make(rng)
        others = {"Omega": rng.normal(size=3), "K": rng.normal(size=3), "radius": 1.0}
        with pytest.raises(rb.InputError) as refusal:
            design(**{**others, **request})
        said = re.fullmatch(f"{reason}.*", str(refusal.value))
        assert said, str(refusal.value)
        # Numbers are printed to six digits; of b.min() - m and the like some cancel.
        assert float(said[1]) == pytest.approx(amount, rel=1e-5)
