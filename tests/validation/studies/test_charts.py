"""Charts of the largest exponent over two numbers."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import robotball as rb
from robotball.dynamics.long_run import exponents_of
from robotball.dynamics.motion_branches import varied
from robotball.robot import formulas as eq
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.theory.ensembles.orbits import Integers, kernel_start
from robotball.theory.ensembles.steppers import ball_of, row_of
from tests.conftest import Robotball
from tests.messages import naming
from validation.options import Sweep
from validation.studies import charts
from validation.studies.charts import chart_study, measure, refined
from validation.sweeps import Result

TIMES = (4.0, 7.0)  # s, the interval of λ₁


def cell(scene: str, over: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Return a cell with a grid of points; TIMES is the second half of its motions."""
    points = np.stack(np.meshgrid(*over.values()), axis=-1).reshape(-1, len(over)).tolist()
    times = {"duration": 6.0, "transient": 1.0}
    return {"scene": scene, "over": [*over], "points": points} | times | more


def growths(scene: str, cell: dict[str, Any]) -> Array:
    """Return λ₁ (n,) over TIMES from SciPy's DOP853 and neighbours at ±1e-5 rad [1/s]."""
    first, (attitude,), (momentum,) = kernel_start(rb.load_scene(scene))
    pairs = [
        varied(first, momentum, dict(zip(cell["over"], point, strict=True)))
        for point in cell["points"]
    ]
    numbers = np.array([row_of(ball) for ball, _ in pairs * 2]).T
    balls, momenta = ball_of(first.rolling, [*numbers]), np.array([M for _, M in pairs * 2])

    def rate(t: float, state: Array) -> Array:
        x = state.reshape(6, -1)
        gamma, M = (x[0], x[1], x[2]), (x[3], x[4], x[5])
        omega = balls.angular_velocity(M, gamma)
        return np.concatenate([*eq.cross(gamma, omega), *eq.cross(M, omega)])

    # `exponents` begins with the same rotation.
    turns = np.repeat([[1e-5], [-1e-5]], len(pairs), axis=0) * [0.6, 0.48, 0.64]
    axes = rotation_matrix(
        multiply(attitude, Rotation.from_rotvec(turns).as_quat(scalar_first=True))
    )
    start = np.concatenate([axes[:, 2], np.einsum("nij,ni->nj", axes, momenta)], axis=1).T
    times: Any = {"t_eval": TIMES, "rtol": 1e-11, "atol": 1e-12}
    found = solve_ivp(rate, (0.0, TIMES[1]), start.ravel(), "DOP853", **times).y
    ahead, behind = found.reshape(6, 2, -1, 2).transpose(1, 2, 3, 0)  # (pair, time, number)
    # Vectors at rest in space rotate in the frame: δγ = γ×ξ, δM = M×ξ.
    vectors = np.split((ahead + behind)[..., None, :] / 2, 2, axis=-1)
    turned = [np.cross(v, np.eye(3)).swapaxes(-1, -2) for v in vectors]
    matrix = np.concatenate(turned, axis=-2)
    xi = np.linalg.pinv(matrix) @ (ahead - behind)[..., None]
    lengths = np.linalg.norm(xi[..., 0], axis=-1)
    return np.log(lengths[:, 1] / lengths[:, 0]) / (TIMES[1] - TIMES[0])


@pytest.mark.parametrize(
    ("scene", "over"),
    [
        ("fig14", {"K": np.linspace(1, 5, 4), "Omega": np.linspace(-1, 4, 4)}),
        ("classical_chaotic", {"f": np.linspace(10, 40, 4), "c": np.linspace(-2, 3, 4)}),
    ],
)
def test_the_exponents_of_a_chart_agree_with_another_integrator(
    scene: str, over: dict[str, Array]
) -> None:
    """λ₁ over 3 s at 4 x 4 points; in reversed order it differs."""
    example_cell = cell(scene, over)
    expected, measured = (
        growths(scene, example_cell),
        [row["largest"] for row in measure(example_cell)["rows"]],
    )
    # Measured 3.1e-7 (classical): the distance of the neighbours is finite.
    assert measured == pytest.approx(expected, abs=3e-6)
    assert np.abs(measured - expected[::-1]).max() > 0.1


@pytest.mark.parametrize("scene", ["fig14", "classical_chaotic"])
def test_twice_as_fast_a_motion_has_twice_the_exponent(scene: str) -> None:
    """K, Ω and M are doubled and times halved. Results agree to a few of the last bits."""
    ball, attitudes, momenta = kernel_start(rb.load_scene(scene))
    fast = replace(ball, K=eq.scale(2, ball.K), Omega=eq.scale(2, ball.Omega))
    slow = exponents_of(ball, attitudes, momenta, 40.0, 10.0)
    exponents = exponents_of(fast, attitudes, 2 * momenta, 20.0, 5.0)
    assert exponents.largest == pytest.approx(2 * slow.largest, abs=1e-9)  # measured 0


@pytest.mark.parametrize(("scene", "axis"), [("fig14", 1), ("classical_chaotic", 0)])
def test_symmetric_starts_have_equal_exponents(scene: str, axis: int) -> None:
    """(γ, M) and (-γ, -M), rubber, or (-γ, M), classical, with c and -c. K₂ and -K₂ differ.

    M is along the world's X, about which or across which the start is turned over.
    """
    ball, (attitude,), (momentum,) = kernel_start(rb.load_scene(scene))
    other = replace(ball, K=(ball.K[0], -ball.K[1], ball.K[2]))
    over = multiply(np.eye(4)[1 + axis], attitude)
    starts, momenta = np.array([attitude, over, over]), np.tile(momentum, (3, 1))
    momenta[1:, 2] *= -1
    largest = exponents_of([ball, ball, other], starts, momenta, 10.0, 5.0).largest
    # Measured 1.2e-10 (classical): rounding, grown by e^5; with K₂ as -K₂ 0.036 and more.
    assert largest[1] == pytest.approx(largest[0], abs=1e-8)
    assert abs(largest[2] - largest[0]) > 1e-2


@pytest.mark.parametrize("dimensions", [1, 2])
def test_refining_only_adds_points_and_finds_the_whole_border(dimensions: int) -> None:
    """Every place of the finest grid has its kind, from fewer points; the border is a circle."""
    asked: list[tuple[int, ...]] = []
    size = 8 * 2**2 + 1

    def measured(places: Integers) -> Array:
        asked.extend(map(tuple, places.tolist()))
        return 0.7 - np.hypot.reduce(4 * places / size - 2, axis=1, initial=0.0)

    shape = (size,) * dimensions
    plain, grid = {*asked}, refined(shape, 2, 0.2, measured)
    assert len(asked) == len({*asked}) < 0.6 * size**dimensions
    assert plain <= {*asked}
    everywhere = measured(np.argwhere(np.ones(shape)).astype(np.int64)).reshape(shape)
    assert np.array_equal(np.abs(grid) > 0.2, np.abs(everywhere) > 0.2)


@pytest.mark.parametrize(
    ("growths", "kind"),
    [
        ((31.0, 31.0), "chaotic"),
        ((31.0, 5.0), "transient chaos"),
        ((5.0, -31.0), "straight line"),
        ((5.0, 5.0), "regular"),
    ],
)
def test_the_growth_of_a_neighbour_decides_the_kind(
    growths: tuple[float, float], kind: str
) -> None:
    assert charts._kind_of(*growths) == kind


def test_a_chart_goes_on_where_it_was_ended(robotball: Robotball, tmp_path: Path) -> None:
    """Half of its journal is lost: the next run makes the same table, and a picture."""
    command = (
        "dynamics chart classical_chaotic --over f=1:30,c=0:4 --points 30 --duration 300 --quick"
    )
    status, out, _ = robotball(*command.split(), "--workers", 1, "--json", "a.json")
    assert status == 0
    record = json.loads((tmp_path / "a.json").read_text())
    assert record["over"] == ["f", "c"]
    assert "minutes" in " ".join(out.split())
    (table,), (journal,) = tmp_path.glob("out/*.csv"), tmp_path.glob("out/*.jsonl")
    first, lines = table.read_bytes(), journal.read_text().splitlines(keepends=True)
    journal.write_text("".join(lines[:-1]))
    table.unlink()
    assert robotball(*command.split(), "--workers", 1)[0] == 0
    assert table.read_bytes() == first
    # f ≥ c² for all starts.
    rows = [*csv.DictReader(table.read_text().splitlines())]
    assert all(float(row["f"]) > float(row["c"]) ** 2 for row in rows)
    assert len(rows) == record["points"] < 5 * 5
    assert table.with_suffix(".png").read_bytes()[:4] == b"\x89PNG"


def test_cells_without_a_result_are_reported_with_a_reason(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """If all cells fail, the command is refused; otherwise they are listed below the chart."""
    lost: list[int] = [*range(9)]

    def results(sweep: Sweep, work: Any, cells: Any, *of: Any) -> list[Result]:
        return [
            Result(cell, None, "it took [3] s") if i in lost else Result(cell, work(cell), None)
            for i, cell in enumerate(cells)
        ]

    monkeypatch.setattr(Sweep, "results", results)
    monkeypatch.setattr(charts, "_CHUNK", 1)
    sweep = Sweep(out=tmp_path)
    options: Any = "fig14", "K=2:4,Omega=2:2.1", sweep, 3, 0, 20.0, 10.0
    with pytest.raises(rb.InputError, match=naming("[3]~s")):
        chart_study(*options)
    lost[:] = [1]
    assert sweep.present(chart_study(*options)) == 0
    printed = capsys.readouterr().out
    assert "motions: 8, " in printed
    assert "[3] s" in printed
