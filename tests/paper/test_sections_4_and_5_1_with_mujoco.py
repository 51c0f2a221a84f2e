"""Sections 4 and 5.1 with MuJoCo: rates of motion at equilibria and straight lines, and basins.

Near an equilibrium a small displacement x obeys dx/dt = Jx. A displacement along an eigenvector of
J grows as exp(λt): the logarithm of its component, taken with the left eigenvector, has the slope
Re λ, and its phase the slope Im λ. Half the difference of the motions from opposite displacements
is free of even powers of x. MuJoCo's steps are the dominant error of the rates.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from robotball import Motion, Scene, sample_times, simulate
from robotball.dynamics import equilibria
from robotball.dynamics import straight_motions as straight
from robotball.dynamics.equilibria import flow_near, linear_part
from robotball.dynamics.sections import own_start
from robotball.robot.scene import Start, along_momentum
from robotball.robot.variations import gyrostat
from robotball.rotations import Array, multiply, normalised, tangents, turn_between, turned
from tests.paper.formulas import paper_scene, spread_points
from validation.study import compiled_motion

SMALL = 1e-5  # rad, of a displacement: its cube changes a rate by less than the steps do
FOLDS, TURNS = 3.0, 60.0  # growth by e, or rad of rotation, over which a rate is fitted
ROOM = 5.0  # folds of the fastest growth, which magnify the error of a step
NO_RATE = 1e-9  # 1/s: an eigenvalue below it is along a family of equilibria

Run = Callable[[Scene, Array], Motion]
Rate = tuple[complex, complex]  # an eigenvalue and the measured rate [1/s]


def rates(linear: Array, displaced: Callable[[Array, Array], Array]) -> Iterator[Rate]:
    """Yield each eigenvalue of J (k, k), the upper one of a pair, and the measured rate [1/s].

    displaced: returns the displacements (n, k) at times (n,) that a first one (k,) becomes.
    """
    values, vectors = np.linalg.eig(linear)
    for value, vector, dual in zip(values, vectors.T, np.linalg.inv(vectors), strict=True):
        if value.imag < 0 or abs(value) < NO_RATE:
            continue
        rotation, fastest = abs(value.imag) * FOLDS / TURNS, values.real.max() * FOLDS / ROOM
        times = np.linspace(0.0, FOLDS / max(abs(value.real), rotation, fastest), 201)
        x = SMALL * normalised(vector.real)
        part = (displaced(x, times) - displaced(-x, times)) @ dual / 2
        logarithm, phase = np.log(np.abs(part)), np.unwrap(np.angle(part))
        # A fit over all times, not a quotient of two, so that the errors of steps average.
        slopes = [float(np.polyfit(times, curve, 1)[0]) for curve in (logarithm, phase)]
        yield complex(value), complex(slopes[0], slopes[1] if value.imag else 0.0)


def beside_point(scene: Scene, gamma: Array, run: Run, x: Array, times: Array) -> Array:
    """Return the displacements (n, 2) of γ from an equilibrium in a motion from rest."""
    attitude = equilibria.attitude_at(normalised(gamma + x @ tangents(gamma)))
    motion = run(replace(scene, start=own_start(scene, attitude, np.zeros(3))), times)
    return motion.gamma @ scene.principal_axes @ tangents(gamma).T


def beside_line(scene: Scene, start: Start, turn: Array, times: Array) -> Array:
    """Return the rotations (n, 3) of the frame from a straight motion."""
    aside = turned(start.attitude, turn)
    beside = replace(scene, start=own_start(scene, aside, start.momentum))
    attitudes = multiply(simulate(beside, times).attitude, scene.principal_quaternion)
    return turn_between(start.attitude, attitudes)


def worst(rates: list[Rate]) -> float:
    """Return the largest difference of a rate from its eigenvalue."""
    assert rates
    return max(abs(value - measured) for value, measured in rates)


EQUILIBRIA = [
    (name, sign, point)
    for name, sign, points in (
        ("fig06", 1, ("Γ₅", "δ₁", "δ₃", "θ₁", "θ₃")),
        ("fig06", -1, ("Γ₅", "δ₁", "δ₃", "θ₁", "θ₃")),
        ("fig05b", 1, ("Γ₁", "Γ₃", "Γ₅", "Σ_s", "Σ_u")),
        ("fig07", 1, ("Γ₅", "θ₁", "θ₃")),
        ("fig08", 1, ("Γ₅",)),
    )
    for point in points
]


@pytest.mark.parametrize(
    ("name", "sign", "point"),
    [
        pytest.param(*case, marks=() if case[2] == "θ₃" else pytest.mark.study)
        for case in EQUILIBRIA
    ],
)
def test_mujoco_stays_at_an_equilibrium_and_leaves_it_at_its_eigenvalues(
    name: str, sign: int, point: str
) -> None:
    """With Ω and K reversed, a sign of -1, the flow (4.1) runs back in time."""
    scene = paper_scene(name)
    ball = scene.parameters
    places = equilibria.closed_form_points(ball)
    if circle := equilibria.fixed_circle(ball):
        angles = np.array([np.pi / 4, 3 * np.pi / 4])
        places |= dict(zip(("Σ_s", "Σ_u"), circle.at(angles), strict=True))
    gamma = places[point]
    commands = [sign * drive.rate(0.0) for drive in scene.drives]
    moving, still = scene.with_hinges(command=commands), np.zeros(2)
    near = partial(beside_point, moving, gamma, simulate)
    left = np.linalg.norm(near(still, np.linspace(0.0, 10.0, 101)), axis=1)
    assert left.max() < 1e-5  # measured 2.5e-6 at most, at δ₃, magnified by exp(λt)
    jacobian = equilibria.jacobian(moving.parameters, gamma)
    assert worst([*rates(jacobian, near)]) < 1e-6  # measured 2.4e-7 at most
    # Control: the eigenvalues of the ball that runs the other way.
    if point == "θ₃":
        assert worst([*rates(-jacobian, near)]) > 0.01


@pytest.mark.study
@pytest.mark.parametrize("name", ["fig06", "fig07", "fig08"])
def test_mujoco_approaches_a_slow_focus_as_the_equations_do(name: str) -> None:
    """Γ₅ attracts only through its first Lyapunov value."""
    scene = paper_scene(name)
    gamma = equilibria.closed_form_points(scene.parameters)["Γ₅"]
    first, last = np.array([0.2, 0.0]), np.array([0.0, 100.0])
    ends = [
        float(np.linalg.norm(beside_point(scene, gamma, run, first, last)[1]))
        for run in (compiled_motion, simulate)
    ]
    assert ends[1] == pytest.approx(ends[0], abs=1e-5)  # rad; measured 4e-7 at most
    assert ends[1] < 0.16  # measured 0.153 at most, from 0.2


@pytest.mark.parametrize(
    ("f", "name"),
    [
        pytest.param(f, name, marks=() if (f, name) == (2.0, "σ₊") else pytest.mark.study)
        for f in (2.0, 3.0)
        for name in ("σ₊", "σ₋", "δ₊", "δ₋")
    ],
)
def test_mujoco_leaves_a_straight_line_of_fig_10_at_the_roots_of_5_2(f: float, name: str) -> None:
    """The measured rates also give the coefficients of P₃, by which (5.4) decides."""
    scene = paper_scene("fig10")
    rates_of_line = line_rates(scene, f, name)
    assert worst(rates_of_line) < 1e-6  # measured 3.1e-8 at most at f = 2
    (line,) = (line for line in lines(scene, f) if line[0] == name)
    roots = [measured for _, measured in rates_of_line]
    roots += [root.conjugate() for root in roots if root.imag]
    ours, exact = np.real(np.poly(roots)), line[1].polynomial
    assert ours == pytest.approx(exact, abs=1e-5)  # measured 3.2e-7
    stable = min(ours[1], ours[3], ours[1] * ours[2] - ours[3]) > 0  # Routh and Hurwitz
    assert stable == (f == 2.0 and name in ("σ₋", "δ₊"))


def lines(scene: Scene, f: float) -> list[tuple[str, straight.StraightMotion]]:
    """Return the straight motions with M² = f and their names."""
    ball = scene.parameters
    return [
        (straight.name_of_line(ball, motion.gamma), motion)
        for motion in straight.straight_motions(ball, f)
    ]


def line_rates(scene: Scene, f: float, name: str) -> list[Rate]:
    """Return the rates beside a straight motion."""
    line = dict(lines(scene, f))[name]
    linear = linear_part(flow_near(scene.parameters, line.gamma, line.momentum), 3)
    start = along_momentum(line.gamma, line.momentum)
    return [*rates(linear, partial(beside_line, scene, start))]


@pytest.mark.slow
def test_in_mujoco_sigma_minus_loses_its_stability_at_the_limit_of_5_4() -> None:
    """The growth on both sides of f*; a chord between them is zero at f*."""
    scene = paper_scene("fig10")
    limit = float(straight.stability_limit(scene.parameters) or np.nan)
    sides = limit - 2e-3, limit + 2e-3
    growth = [max(m.real for v, m in line_rates(scene, f, "σ₋") if v.imag) for f in sides]
    assert growth[0] < 0 < growth[1]
    assert float(np.interp(0.0, growth, sides)) == pytest.approx(limit, abs=1e-5)  # measured 3e-7


@pytest.mark.study
@pytest.mark.parametrize("name", ["fig06", "fig07", "fig08"])
def test_mujocos_ball_reaches_the_equilibrium_that_the_equations_reach(name: str) -> None:
    """From 30 starts at rest: the nearest equilibrium after 100 s; a focus attracts slowly."""
    scene = paper_scene(name)
    points = equilibria.fixed_points(scene.parameters)
    attract = np.array([point.gamma for point in points if "stable" in point.kind.split()])
    times = np.array([0.0, 100.0])
    fast: Run = partial(simulate, settings="fast")
    for attitude in equilibria.attitude_at(spread_points(30)):
        begun = replace(scene, start=own_start(scene, attitude, np.zeros(3)))
        ends = [run(begun, times).gamma[1] for run in (compiled_motion, fast)]
        reached = [int(np.argmax(attract @ scene.principal_axes.T @ end)) for end in ends]
        assert reached[0] == reached[1]


@pytest.mark.study
def test_in_mujoco_delta_1_meets_delta_3_where_kappa_1_is_one() -> None:
    """There a rate of each is 0. Their product is linear in K₃."""
    scene, fold, products = paper_scene("fig06"), 0.51502832, []
    sides = fold - 4e-4, fold - 2e-4
    for K3 in sides:
        ball = gyrostat(scene, K=np.array([0.0, 0.0, K3]))
        places, slow = equilibria.closed_form_points(ball.parameters), []
        for gamma in (places["δ₁"], places["δ₃"]):
            linear = equilibria.jacobian(ball.parameters, gamma)
            measured_rates = rates(linear, partial(beside_point, ball, gamma, simulate))
            slow.append(min((measured.real for _, measured in measured_rates), key=abs))
        products.append(np.prod(slow))
    at = float(np.roots(np.polyfit(sides, products, 1))[0])
    assert at == pytest.approx(fold, abs=1e-5)  # measured 3.2e-7: a chord for the product


def closed(run: Run, scene: Scene, period: float) -> tuple[float, float]:
    """Return the period near a given one [s], and the final distance of γ from its start [rad].

    Newton's method makes the component of this distance along the motion zero.
    """
    for _ in range(6):
        motion = run(scene, np.array([0.0, period]))
        gap = motion.gamma[1] - motion.gamma[0]
        rate = np.cross(motion.gamma[1], motion.angular_velocity[1])
        period -= float(gap @ rate / (rate @ rate))
    return period, float(np.linalg.norm(gap))


@pytest.mark.slow
def test_in_mujoco_an_orbit_from_rest_without_rotation_of_the_frame_is_closed() -> None:
    """Its period, and (AK,γ)²/(Aγ,γ), which is constant."""
    scene = paper_scene("rubber_chaplygin_gyrostat")
    attitude = equilibria.attitude_at(normalised(np.array([0.3, 0.5, 0.8])))
    scene = replace(scene, start=own_start(scene, attitude, np.zeros(3)))
    (period, _), (ours, missed) = (closed(run, scene, 2.6) for run in (compiled_motion, simulate))
    assert ours == pytest.approx(period, abs=1e-7)  # s; measured 4.5e-10
    assert missed < 1e-7  # rad; measured 4e-10
    A, K = np.array(scene.parameters.A), np.array(scene.parameters.K)
    gamma = simulate(scene, sample_times(20.0)).gamma @ scene.principal_axes
    kept = (gamma @ (A * K)) ** 2 / (gamma**2 @ A)
    assert np.ptp(kept) / kept[0] < 1e-6  # measured 2.5e-8 over 100 s
