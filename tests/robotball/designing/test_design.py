"""From requested A, Ω and K to bodies that have them, or to the reason why there are none."""

import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball import Design, Limits, design
from robotball.bodies import thick_shell_inertia, thin_shell_inertia
from robotball.designing.decompose import two_rings
from robotball.designing.design import WIDER, describe
from robotball.rotations import Array
from tests.random_balls import RandomBall, random_axis, random_ball, ring_ball
from validation import compare

A12, OMEGA12, K12 = np.diag([0.7, 0.6, 0.8]), np.array([0.0, 0.0, 2.0]), np.array([2.0, 2.0, 0.0])
UNBUILDABLE = "can be simulated, not be built: mass would lie outside the shell"


def fig12(**changes: Any) -> Design:
    """The design of Fig. 12's ball, with other arguments."""
    return design(**{"A": A12, "Omega": OMEGA12, "K": K12, "radius": 1.0, **changes})


def numbers(made: Design) -> tuple[Array, Array, Array]:
    """A (3, 3), Ω (3,) and K (3,) of the designed bodies and rates."""
    ball = made.ball
    Omega = made.frame_rate * ball.shell.axis
    rates = np.array([made.frame_rate, *made.rotor_rates])
    return ball.A, Omega, ball.gyrostatic_inertia @ rates - ball.d * Omega


def error(made: Design, A: Array, Omega: Array, K: Array) -> float:
    """The largest error of A, Ω and K: of A to A's size, of Ω to its own, of K to |K| + d|Ω|."""
    got_A, got_Omega, got_K = numbers(made)
    turning = float(np.linalg.norm(Omega))
    momentum = float(np.linalg.norm(K)) + made.ball.d * turning
    return max(
        float(np.abs(got_A - A).max() / np.abs(A).max()),
        float(np.abs(got_Omega - Omega).max() / (turning or 1)),
        float(np.abs(got_K - K).max() / (momentum or 1)),
    )


def check_bodies(made: Design, mass: float | None) -> None:
    """The bodies are what a design says they are, and keep its limits; Ball checks the rest."""
    ball, limits = made.ball, made.limits
    shell, thickness = ball.shell, limits.shell_thickness
    frame_radius, rotor_radius = limits.radii(ball.radius)
    rounding = 1 + 1e-12
    assert mass is None or ball.mass == pytest.approx(mass, rel=1e-14)
    assert shell.axial_inertia == shell.transverse_inertia
    assert shell.axial_inertia == pytest.approx(
        thick_shell_inertia(ball.radius, shell.mass, thickness)
        if thickness
        else thin_shell_inertia(ball.radius, shell.mass),
        rel=1e-14,
    )
    assert limits.shell_mass <= shell.mass * rounding
    assert limits.frame_mass <= ball.frame.mass * rounding
    for rotor, rate in zip(ball.rotors, made.rotor_rates, strict=True):
        assert limits.rotor_mass <= rotor.mass * rounding
        assert rotor.axial_inertia <= rotor.mass * rotor_radius**2 * rounding
        assert rotor.transverse_inertia == rotor.axial_inertia / 2
        assert 0 < rate <= limits.rotor_speed * rounding
    # The frame's mass as six points, pairs at c √(3/m), of equal distance from the centre.
    second = np.trace(ball.frame.inertia) / 2 * np.eye(3) - ball.frame.inertia
    assert np.linalg.eigvalsh(second)[0] > 0
    assert made.reach == pytest.approx(math.sqrt(np.trace(second) / ball.frame.mass), rel=1e-12)
    assert made.buildable == (made.reach <= frame_radius * rounding)


# The paper's balls -------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["fig12", "fig13", "fig14"])
def test_the_balls_of_figs_11_to_14_can_be_built_and_run_in_both_engines(name: str) -> None:
    """Designed from the numbers alone, each rolls as the equations say."""
    scene = rb.load_scene(name)
    p = scene.parameters
    made = design(p.A, p.Omega, p.K, p.a)
    check_bodies(made, None)
    assert made.buildable
    assert made.verdict.startswith("can be built")
    assert len(made.ball.rotors) == 1
    # Measured at most 2e-16: rounding.
    assert error(made, np.diag(p.A), np.array(p.Omega), np.array(p.K)) < 2e-15
    designed = replace(
        scene, ball=made.ball, frame_rate=made.frame_rate, rotor_rates=made.rotor_rates
    )
    agreement = compare(designed, "balanced")
    assert agreement.agrees
    # Measured at most 5.5e-9 (fig14): RK4's error at 5 ms.
    assert agreement.path_error is not None
    assert agreement.path_error < 1e-7


@pytest.mark.parametrize(
    ("name", "radius"),
    [*((f"fig{n}", 1.3628) for n in ("05b", "05c", "05d", "06", "07", "08")), ("fig10", 3.0)],
)
def test_the_balls_of_figs_5_to_10_run_in_mujoco_only(name: str, radius: float) -> None:
    """The frame needs a radius of √((3 max b - Σb)/(Σb - 2 max b)) at least, for a = 1."""
    p = rb.load_scene(name).parameters
    made = design(p.A, p.Omega, p.K, p.a)
    check_bodies(made, None)
    assert made.verdict.startswith(UNBUILDABLE)
    b = 1 / np.array(p.A)
    assert math.sqrt((3 * b.max() - b.sum()) / (b.sum() - 2 * b.max())) == pytest.approx(
        radius, rel=1e-4
    )
    # It is searched to four digits.
    assert made.needed_radius == pytest.approx(radius, rel=3e-4)
    assert f"needs a radius of {made.needed_radius:.4g} m" in made.verdict
    assert made.needed_radius <= made.reach <= WIDER * made.needed_radius
    assert made.masses[0] > made.masses[1]
    assert error(made, np.diag(p.A), np.array(p.Omega), np.array(p.K)) < 2e-15


@pytest.mark.parametrize("name", ["fig06", "fig10"])
def test_a_ball_that_no_workshop_can_build_rolls_in_mujoco(name: str) -> None:
    """Only the place of the mass is impossible, not the inertia."""
    scene = rb.load_scene(name)
    p = scene.parameters
    made = design(p.A, p.Omega, p.K, p.a)
    designed = replace(
        scene, ball=made.ball, frame_rate=made.frame_rate, rotor_rates=made.rotor_rates
    )
    assert compare(designed, "balanced", rb.sample_times(2.0)).agrees


# All of them -------------------------------------------------------------------------------


def request_of(rng: np.random.Generator, real: RandomBall) -> tuple[float | None, Limits]:
    """A mass or none, and limits that the ball `real` keeps by 1 %, or none but its shell."""
    ball, rates = real.ball, np.abs(real.rotor_rates)
    mass = None if rng.integers(2) else ball.mass
    limits = Limits(buildable=True, shell_thickness=real.thickness)
    if rng.integers(2):
        return mass, limits
    return mass, replace(
        limits,
        rotor_speed=1.01 * float(rates.max()) if len(rates) else math.inf,
        frame_radius=real.frame_radius,
        rotor_radius=real.rotor_radius,
        shell_mass=0.99 * ball.shell.mass,
        frame_mass=0.99 * ball.frame.mass,
        rotor_mass=0.99 * ball.rotors[0].mass if len(rates) == 1 else 0.0,
    )


@pytest.mark.slow
def test_a_thousand_random_feasible_requests_are_all_solved() -> None:
    """Each asks for the numbers of a ball made of points and rings, which can be built."""
    rng = np.random.default_rng(1)
    worst, rotors = 0.0, Counter[int]()
    for _ in range(1000):
        real = random_ball(rng, int(rng.integers(4)))
        mass, limits = request_of(rng, real)
        made = design(real.ball.A, real.Omega, real.K, real.ball.radius, mass, limits)
        assert made.buildable
        check_bodies(made, mass)
        worst = max(worst, error(made, real.ball.A, real.Omega, real.K))
        rotors[len(made.ball.rotors)] += 1
    # Measured 5e-16: rounding of one inverse and of sums of four bodies.
    assert worst < 1e-14
    assert min(rotors[0], rotors[1]) > 200


@pytest.mark.slow
def test_no_number_of_rotors_does_what_two_cannot() -> None:
    """Balls of two to five heavy rings at one rate: its limit is enough for one or two."""
    rng = np.random.default_rng(2)
    worst, rotors = 0.0, Counter[int]()
    for _ in range(200):
        real = ring_ball(rng, int(rng.integers(2, 6)))
        limits = Limits(
            buildable=True,
            rotor_speed=real.rotor_rates[0] * (1 + 1e-6),
            rotor_radius=real.rotor_radius,
            shell_thickness=real.thickness,
        )
        mass = real.ball.mass
        made = design(real.ball.A, real.Omega, real.K, real.ball.radius, mass, limits)
        check_bodies(made, mass)
        worst = max(worst, error(made, real.ball.A, real.Omega, real.K))
        rotors[len(made.ball.rotors)] += 1
    assert worst < 1e-14  # measured 4e-16: rounding
    assert rotors[1] + rotors[2] == 200
    assert rotors[2] >= 20


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


# Rotors ------------------------------------------------------------------------------------


def test_a_ball_whose_momentum_is_that_of_shell_and_mass_needs_no_rotor() -> None:
    """K = -(J_s + d)Ω for some J_s and d; a K beside it needs one."""
    made = fig12(K=(0.0, 0.0, -1.9))
    assert made.rotor_rates == ()
    assert made.ball.shell.axial_inertia + made.ball.d == pytest.approx(0.95, rel=1e-14)
    assert numbers(made)[2] == pytest.approx([0.0, 0.0, -1.9], rel=1e-14)
    for K in ((0.0, 0.0, -1.5), (0.0, 0.0, 1.9), (1e-6, 0.0, -1.9), (0.0, 0.0, 0.0)):
        assert len(fig12(K=K).rotor_rates) == 1


def test_the_one_rotor_lies_along_the_momentum_that_shell_and_mass_leave() -> None:
    """Its axis is that of K + (J_s + d)Ω and j φ̇ its length."""
    made = fig12()
    (rotor,) = made.ball.rotors
    h = K12 + (made.ball.shell.axial_inertia + made.ball.d) * OMEGA12
    assert rotor.axial_inertia * made.rotor_rates[0] * rotor.axis == pytest.approx(h, rel=1e-14)


def test_without_a_turning_frame_the_shells_axis_is_z() -> None:
    """Ω = 0 leaves the axis free; K = 0 as well leaves no rotor."""
    made = fig12(Omega=(0, 0, 0))
    assert made.frame_rate == 0
    assert made.ball.shell.axis.tolist() == [0, 0, 1]
    assert len(made.rotor_rates) == 1
    assert fig12(Omega=(0, 0, 0), K=(0, 0, 0)).rotor_rates == ()


def test_slower_rotors_are_heavier_and_at_last_two() -> None:
    """Where one at the largest rate would break the frame's triangle inequality, two do not."""
    slow, slower = (
        fig12(limits=Limits(rotor_speed=speed, rotor_radius=0.9)) for speed in (19.5, 18.5)
    )
    assert len(slow.ball.rotors) == 1
    assert len(slower.ball.rotors) == 2
    assert slower.rotor_rates == (18.5, 18.5)
    for made in (slow, slower):
        check_bodies(made, None)
        assert made.buildable
        assert error(made, A12, OMEGA12, K12) < 1e-14


@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.01, 0.99),
)
def test_two_rings_have_the_moments_asked_of_them(seed: int, cosine: float) -> None:
    """Σ j = T, Σ j n = g and Σ j n nᵀ = g gᵀ/T + τ e eᵀ, to rounding."""
    rng = np.random.default_rng(seed)
    T, e = rng.uniform(0.1, 10), random_axis(rng)
    g = T * cosine * random_axis(rng)
    tau = float(T - g @ g / T)
    j_n = two_rings(T, g, e, tau)
    j = np.linalg.norm(j_n, axis=1)
    N = np.einsum("ra,rb->ab", j_n, j_n / j[:, None])
    request = np.outer(g, g) / T + tau * np.outer(e, e)
    # Measured at most 6e-16 T over 2e4 draws.
    assert j.sum() == pytest.approx(T, rel=1e-14)
    assert np.abs(j_n.sum(axis=0) - g).max() < 1e-14 * T
    assert np.abs(N - request).max() < 1e-14 * T


def test_the_speed_that_a_refusal_names_is_enough() -> None:
    """To four digits, and no less is."""
    slow = Limits(rotor_speed=5.0, rotor_radius=0.9, buildable=True)
    with pytest.raises(rb.InputError, match="rotor speed: at most 5 rad/s is allowed") as refusal:
        fig12(limits=slow)
    needed = re.search(r"needs ([\d.]+) rad/s: ([\d.]+) rad/s more", str(refusal.value))
    assert needed is not None
    speed = float(needed[1])
    assert float(needed[2]) == pytest.approx(speed - 5, abs=6e-3)
    assert len(fig12(limits=replace(slow, rotor_speed=speed * 1.001)).ball.rotors) == 2
    with pytest.raises(rb.InputError, match="rotor speed"):
        fig12(limits=replace(slow, rotor_speed=speed * 0.999))


# Masses and radii --------------------------------------------------------------------------


def test_a_heavier_or_lighter_ball_has_the_same_numbers() -> None:
    """Any mass below 1.0119 kg will do for Fig. 12; from 0.8690 kg on it can be built."""
    for mass, buildable in (
        (0.01, False),
        (0.5, False),
        (0.869, False),
        (0.8695, True),
        (1.01, True),
    ):
        made = fig12(mass=mass)
        check_bodies(made, mass)
        assert made.buildable is buildable
        assert error(made, A12, OMEGA12, K12) < 1e-14
    assert made.masses == pytest.approx((0.869048, 1.011905), abs=1e-6)


def test_axes_need_not_be_principal() -> None:
    """A turned request gives the same bodies, turned."""
    Q = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    plain = fig12()
    A, Omega, K = Q @ A12 @ Q.T, Q @ OMEGA12, Q @ K12
    turned = design(A, Omega, K, 1.0)
    assert error(turned, A, Omega, K) < 2e-15  # measured 2e-16: rounding
    assert turned.ball.mass == pytest.approx(plain.ball.mass, rel=1e-6)
    assert Q.T @ turned.ball.rotors[0].axis == pytest.approx(plain.ball.rotors[0].axis, abs=1e-6)


@pytest.mark.parametrize(
    "limits",
    [
        Limits(shell_thickness=0.05),
        Limits(frame_radius=0.9, rotor_radius=0.3),
        Limits(shell_mass=0.07, frame_mass=0.5, rotor_mass=0.2),
        Limits(rotor_speed=40, rotor_radius=0.9, frame_radius=0.97, shell_mass=0.02),
    ],
)
@pytest.mark.parametrize("mass", [None, 0.95])
def test_limits_are_kept(limits: Limits, mass: float | None) -> None:
    """Each alone, and several together."""
    made = fig12(limits=limits, mass=mass)
    check_bodies(made, mass)
    assert made.buildable


def test_a_frame_too_small_is_told_what_it_needs() -> None:
    """Fig. 12's frame cannot lie within 0.7 m, though within the shell."""
    small = Limits(frame_radius=0.7)
    made = fig12(limits=small)
    assert made.verdict.startswith(
        "can be simulated, not be built: mass would lie outside the frame's radius: "
        f"the frame needs a radius of {made.needed_radius:.4g} m"
    )
    refusal = (
        f"the frame may reach 0.7 m, and within the limits it needs {made.needed_radius:.4g} m"
    )
    with pytest.raises(rb.InputError, match=f"mass inside the shell: {re.escape(refusal)}"):
        fig12(limits=replace(small, buildable=True))
    enough = replace(small, frame_radius=made.needed_radius * 1.001, buildable=True)
    assert fig12(limits=enough).buildable


# Bad input ---------------------------------------------------------------------------------

NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    ("message", "request_"),
    [
        ("A must be 3 or 3 x 3 finite numbers, not [1.0, 2.0]", {"A": [1.0, 2.0]}),
        ("A must be 3 or 3 x 3 finite numbers, not [nan, 1.0, 1.0]", {"A": [NAN, 1.0, 1.0]}),
        ("A is not symmetric", {"A": [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]}),
        (
            "A is not positive: its least eigenvalue is -0.7 1/(kg m²)",
            {"A": (0.7, 0.6, -0.7)},
        ),
        ("A is not positive: its least eigenvalue is 0 1/(kg m²)", {"A": (0.7, 0.6, 0.0)}),
        ("Omega must be 3 finite numbers, not [1.0, inf, 0.0]", {"Omega": [1.0, INF, 0.0]}),
        ("K must be 3 finite numbers, not [1.0]", {"K": [1.0]}),
        ("radius must be positive and finite, not -1 m", {"radius": -1.0}),
        ("mass must be positive and finite, not 0 kg", {"mass": 0.0}),
        ("rotor_speed must be positive, not 0 rad/s", {"limits": Limits(rotor_speed=0)}),
        ("rotor_speed must be positive, not nan rad/s", {"limits": Limits(rotor_speed=NAN)}),
        (
            "shell_mass must be finite and not negative, not -1 kg",
            {"limits": Limits(shell_mass=-1)},
        ),
        (
            "shell_thickness must be at least 0 and less than the radius 1 m, not 1 m",
            {"limits": Limits(shell_thickness=1.0)},
        ),
        (
            "frame_radius must be positive and at most 0.9 m, not 0.95 m",
            {"limits": Limits(shell_thickness=0.1, frame_radius=0.95)},
        ),
        (
            "rotor_radius must be positive and at most 0.5 m, not 0.6 m",
            {"limits": Limits(frame_radius=0.5, rotor_radius=0.6)},
        ),
    ],
)
def test_requests_that_make_no_sense_are_refused(message: str, request_: dict[str, Any]) -> None:
    """One line each, with the value and the limit."""
    with pytest.raises(rb.InputError) as refusal:
        fig12(**request_)
    assert str(refusal.value).startswith(message)


# What the reader is told -------------------------------------------------------------------


def test_a_description_lists_bodies_rates_and_the_verdict() -> None:
    """A line for the ball, for each body, and for the verdict; thickness where there is one."""
    made = fig12(limits=Limits(rotor_speed=18.5, rotor_radius=0.9, shell_thickness=0.001))
    lines = describe(made).splitlines()
    heads = ["ball ", "shell ", "frame ", "rotor1 ", "rotor2 ", "can be built"]
    assert [line.startswith(head) for line, head in zip(lines, heads, strict=True)] == [True] * 6
    assert f"mass {made.ball.mass:.6g} kg" in lines[0]
    assert "0.001 m thick" in lines[1]
    assert "2 rad/s" in lines[2]
    assert "ring of radius 0.9 m" in lines[3]
    assert "18.5 rad/s" in lines[4]
    assert UNBUILDABLE in describe(fig12(A=(0.5, 0.4, 0.3)))


def test_a_designed_scene_survives_its_file(tmp_path: Any) -> None:
    """Written and read again it is the same ball."""
    made, scene = fig12(), rb.load_scene("fig12")
    designed = replace(
        scene, ball=made.ball, frame_rate=made.frame_rate, rotor_rates=made.rotor_rates
    )
    path = tmp_path / "designed.toml"
    path.write_text(rb.scene_toml(designed))
    assert rb.load_scene(path).parameters == designed.parameters
