"""Charts of the largest exponent, diagrams of the section, and the same points by MuJoCo."""

import csv
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball import equations as eq
from robotball.engines.ensembles.orbits import kernel_start
from robotball.equations import Parameters
from robotball.qualitative.families import varied
from robotball.qualitative.long_run import exponents
from robotball.qualitative.sections import section
from robotball.rotations import Array, multiply, rotation_matrix
from tests.conftest import Robotball
from validation.studies.charts import measure, measure_contact, refined, word_of

XI = np.array([0.6, 0.48, 0.64])  # the neighbour's turn at the start, as in `exponents`
TIMES = (2.0, 10.0)  # s, over which λ₁ is compared


def cell(scene: str, over: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A cell of the points on the grid of these values."""
    points = np.stack(np.meshgrid(*over.values()), axis=-1).reshape(-1, len(over)).tolist()
    times = {"duration": TIMES[1] - TIMES[0], "transient": TIMES[0]}
    return {"scene": scene, "over": [*over], "points": points} | times | more


def growth(ball: Parameters, attitude: Array, momentum: Array) -> float:
    """λ₁ from 2 to 10 s, by SciPy's DOP853 and two neighbours 1e-5 rad from the start [1/s]."""

    def rate(t: float, state: Array) -> list[float]:
        g1, g2, g3, *M = state.tolist()
        gamma, (M1, M2, M3) = (g1, g2, g3), M
        omega = ball.angular_velocity((M1, M2, M3), gamma)
        return [*eq.cross(gamma, omega), *eq.cross((M1, M2, M3), omega)]

    ends = []
    for side in (1e-5, -1e-5):
        turn = Rotation.from_rotvec(side * XI).as_quat(scalar_first=True)
        axes = rotation_matrix(multiply(attitude, turn))
        start = np.concatenate([axes[2], momentum @ axes])
        times: Any = {"t_eval": TIMES, "rtol": 1e-11, "atol": 1e-12}
        ends.append(solve_ivp(rate, (0.0, TIMES[-1]), start, "DOP853", **times).y.T)
    lengths = []
    for middle, apart in zip((ends[0] + ends[1]) / 2, ends[0] - ends[1], strict=True):
        # What is at rest in space turns in the frame: δγ = γ×ξ, δM = M×ξ.
        matrix = np.concatenate([np.cross(v, np.eye(3)).T for v in (middle[:3], middle[3:])])
        lengths.append(np.linalg.norm(np.linalg.lstsq(matrix, apart)[0]))
    return float(np.log(lengths[1] / lengths[0]) / (TIMES[1] - TIMES[0]))


@pytest.mark.parametrize(
    ("scene", "over"),
    [
        ("fig14", {"K": np.linspace(1, 5, 4), "Omega": np.linspace(-1, 4, 4)}),
        ("classical_chaotic", {"f": np.linspace(10, 40, 4), "c": np.linspace(-2, 3, 4)}),
    ],
)
def test_a_chart_s_numbers_are_those_of_neighbours_by_another_integrator(
    scene: str, over: dict[str, Array]
) -> None:
    """λ₁ from 2 to 10 s at 4 x 4 points, each of its own ball; with K₂'s sign changed it is not."""
    some = cell(scene, over)
    rows = measure(some)["rows"]
    ball, (attitude,), (momentum,) = kernel_start(rb.load_scene(scene))
    expected = []
    for point in some["points"]:
        each, M = varied(ball, momentum, dict(zip(over, point, strict=True)))
        expected.append(growth(each, attitude, M))
    assert [row["largest"] for row in rows] == pytest.approx(expected, abs=1e-6)
    each, M = varied(each, M, {"K2": -each.K[1]})
    assert abs(growth(each, attitude, M) - expected[-1]) > 1e-2


@pytest.mark.parametrize("scene", ["fig14", "classical_chaotic"])
def test_twice_as_fast_a_motion_has_twice_the_exponent(scene: str) -> None:
    """K, Ω and M doubled, times halved: so only ratios of them count. To the last bit but a few."""
    ball, attitudes, momenta = kernel_start(rb.load_scene(scene))
    fast = replace(ball, K=eq.scale(2, ball.K), Omega=eq.scale(2, ball.Omega))
    slow = exponents(ball, attitudes, momenta, 40.0, 10.0)
    found = exponents(fast, attitudes, 2 * momenta, 20.0, 5.0)
    assert found.largest == pytest.approx(2 * slow.largest, abs=1e-9)


def test_balls_that_are_one_ball_turned_move_alike() -> None:
    """Side by side: K₁, K₂ turned round, and the start by π about e₃; but not without that."""
    ball, (attitude,), momenta = kernel_start(rb.load_scene("fig14"))
    turned = replace(ball, K=(-ball.K[0], -ball.K[1], ball.K[2]))
    half = multiply(attitude, np.array([0.0, 0.0, 0.0, 1.0]))
    starts = np.array([attitude, half, attitude])
    found = exponents([ball, turned, turned], starts, np.repeat(momenta, 3, axis=0), 40.0, 10.0)
    assert found.largest[1] == pytest.approx(found.largest[0], abs=1e-9)
    assert abs(found.largest[2] - found.largest[0]) > 1e-3


@pytest.mark.parametrize("dimensions", [1, 2])
def test_refining_only_adds_points_and_finds_the_whole_border(dimensions: int) -> None:
    """Of a disc, chaotic inside: each place of the finest grid has its kind, by fewer points."""
    asked: list[tuple[int, ...]] = []
    size = 8 * 2**2 + 1

    def measured(places: Array) -> Array:
        asked.extend(map(tuple, places.tolist()))
        return 0.7 - np.hypot.reduce(4 * places / size - 2, axis=1, initial=0.0)

    shape = (size,) * dimensions
    plain, grid = {*asked}, refined(shape, 2, 0.2, measured)
    assert len(asked) == len({*asked}) < 0.6 * size**dimensions
    assert plain <= {*asked}
    everywhere = measured(np.argwhere(np.ones(shape))).reshape(shape)
    assert np.array_equal(np.abs(grid) > 0.2, np.abs(everywhere) > 0.2)


def test_a_followed_motion_begins_where_the_one_before_ended() -> None:
    """At three equal values: their crossings are those of one motion; of others, all the same."""
    ball, attitudes, momenta = kernel_start(rb.load_scene("fig12"))
    whole = section(ball, attitudes, momenta, 300, direction=1).L[0] / 5
    for follow, expected in ((True, whole), (False, np.tile(whole[:100], 3))):
        some = cell("fig12", {"Omega": [2.0, 2.0, 2.0]}, follow=follow, skipped=0)
        crossings = np.array([row["crossings"] for row in measure(some)["rows"]])
        assert crossings[..., 0].ravel() == pytest.approx(expected, abs=1e-5)


def test_a_regular_motion_is_named_by_its_crossings() -> None:
    """Of three in turn, though l jumps by 2π; of a circle wound by the golden ratio; by growth."""
    three = [[0.1, -3.1], [0.2, 0.5], [0.1, 0.4]] * 10
    three[3] = [0.1, -3.1 + 2 * math.pi]
    assert word_of(5.0, three) == "cycle of 3"
    assert word_of(5.0, [[math.cos(n * 3.883), n * 3.883] for n in range(100)]) == "torus"
    assert [word_of(each, []) for each in (31.0, -31.0, 5.0)] == [
        "chaotic", "straight line", "regular"
    ]  # fmt: skip


@pytest.mark.parametrize("scene", ["fig14", "classical_chaotic"])
def test_mujoco_repeats_a_point_of_a_chart(scene: str) -> None:
    """With bodies designed for it, neighbours part as by the equations along the same motion."""
    some = cell(scene, {"K": [3.0], "Omega": [1.5]}, preset="fast", duration=40.0, transient=10.0)
    (row,) = measure_contact(some)["rows"]
    assert row["contact"] == pytest.approx(row["alongside"], abs=1e-4)
    assert row["contact"] == pytest.approx(measure(some)["rows"][0]["largest"], abs=0.05)


@pytest.mark.slow
def test_a_chart_goes_on_where_it_was_ended(robotball: Robotball, tmp_path: Path) -> None:
    """Half of its journal is lost: the next run makes the same table, and a picture."""
    command = "chart classical_chaotic --over f=1:30,c=0:4 --count 30 --duration 300 --quick"
    status, out, _ = robotball(*command.split(), "--workers", 1)
    assert status == 0
    assert "minutes of processor time" in " ".join(out.split())
    (table,), (journal,) = tmp_path.glob("out/*.csv"), tmp_path.glob("out/*.jsonl")
    first, lines = table.read_bytes(), journal.read_text().splitlines(keepends=True)
    journal.write_text("".join(lines[:-1]))
    table.unlink()
    assert robotball(*command.split(), "--workers", 1)[0] == 0
    assert table.read_bytes() == first
    # No start has an f below c².
    rows = [*csv.DictReader(table.read_text().splitlines())]
    assert all(float(row["f"]) > float(row["c"]) ** 2 for row in rows)
    assert len(rows) < 5 * 5
    assert table.with_suffix(".png").read_bytes()[:4] == b"\x89PNG"
