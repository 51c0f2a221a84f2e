"""More friction than the recipe has: rolling friction takes |M|, torsional friction is rubber."""

import json
from pathlib import Path
from typing import Any

import pytest

import robotball as rb
from tests.conftest import Robotball
from validation.studies.friction import HARD, ROLLING, SOFT, TORSIONAL, friction_cells, friction_run
from validation.study import scene_cell


def measured(
    scene: str, kind: str, length: float, rows: str = SOFT, duration: float = 2.0
) -> dict[str, Any]:
    """The record of one run of the study."""
    cell = {**scene_cell(scene, duration), "friction": kind, "rows": rows, "length": length}
    return friction_run(cell)


@pytest.mark.parametrize(
    ("scene", "length", "off"),
    [
        # Off by what the soft contact gives way; by more where the rolling is stopped with a jerk.
        ("fig12", 1e-3, 0.025),  # measured 0.015
        ("fig12", 1e-2, 0.003),  # measured -0.0015
        ("classical_regular", 1e-3, 0.008),  # measured 0.0046
        ("classical_regular", 1e-2, 0.008),  # measured -0.0046
        ("classical_regular", 1e-1, 0.015),  # measured 0.0096
    ],
)
def test_rolling_friction_takes_momentum_at_its_length_times_the_weight(
    scene: str, length: float, off: float
) -> None:
    """d|M|/dt = -μ_roll m g, as far as the rolling torque is along M."""
    record = measured(scene, ROLLING, length, HARD)
    assert record["loss"] / record["expected_loss"] == pytest.approx(1.0, abs=off)
    # Measured 0.78 (classical_regular) to 0.90 (fig12): the part of the torque that is along M.
    assert 0.7 * record["most_loss"] < record["loss"] < record["most_loss"]


def test_high_rolling_friction_is_not_the_rubber_model() -> None:
    """At 1 m it stops the ball, which by the equations keeps all of its |M|."""
    record = measured("fig12", ROLLING, 1.0, HARD)
    assert record["left"] < 0.5  # measured 0.45, after 2 s
    assert record["path_error"] > 0.5  # measured 0.71


def test_under_the_recipe_rolling_friction_gives_way_before_its_limit() -> None:
    """Its rows are softer by (μ_slide/μ_roll)²: 1e-4 m takes a ten-thousandth of its due."""
    record = measured("fig12", ROLLING, 1e-4, SOFT)
    assert record["loss"] < 2e-4 * record["most_loss"]  # measured 9.6e-5


def test_torsional_friction_is_rubber_from_where_the_motion_needs_it() -> None:
    """Just below the demand, 1.873 m in 10 s, the ball turns on the spot; just above it never."""
    needed = float(rb.integrate(rb.load_scene("fig12")).loads.torsional_friction.max())
    below = measured("fig12", TORSIONAL, 0.85 * needed, duration=10.0)
    above = measured("fig12", TORSIONAL, 1.02 * needed, duration=10.0)
    assert below["relative_spin"] > 0.05  # measured 0.13
    assert below["path_error"] > 0.03  # measured 0.070
    # Measured 1.33e-9 and 1.65e-9: RK4's error at 5 ms.
    assert above["relative_spin"] < 2e-9
    assert above["path_error"] < 2.5e-9
    assert above["faults"] == []


def test_too_little_torsional_friction_is_a_drag() -> None:
    """MuJoCo's default lets the ball spin nearly freely, and its path is wrong by a third."""
    record = measured("fig12", TORSIONAL, 0.005, duration=10.0)
    assert record["relative_spin"] > 1.0  # measured 1.79
    assert record["path_error"] == pytest.approx(0.325, abs=0.01)
    assert record["faults"][0] == "friction cone saturated at t = 0 s"


def test_the_study_spans_six_decades() -> None:
    """Rolling friction from 1e-6 to 1 m, torsional from 5e-3 to 1e3 m."""
    for quick in (False, True):
        cells = friction_cells("fig12", 1.0, quick)
        lengths = {
            kind: [cell["length"] for cell in cells if cell["friction"] == kind]
            for kind in (ROLLING, TORSIONAL)
        }
        assert (min(lengths[ROLLING]), max(lengths[ROLLING])) == (1e-6, 1.0)
        assert (min(lengths[TORSIONAL]), max(lengths[TORSIONAL])) == (5e-3, 1e3)


@pytest.mark.slow
def test_the_quick_study_writes_its_files(robotball: Robotball, tmp_path: Path) -> None:
    """A picture of two panels, a table and the data of every run."""
    arguments = ("tradeoff", "fig12", "--friction", "--quick", "--duration", 0.2, "--out", ".")
    assert robotball(*arguments)[0] == 0
    stem = "fig12-mujoco-friction-0.2s-quick"
    names = {f"{stem}{kind}" for kind in (".png", ".json", ".csv")}
    assert {path.name for path in tmp_path.iterdir()} == names | {"fig12-friction.jsonl"}
    record = json.loads((tmp_path / f"{stem}.json").read_text())
    assert record["torsional_friction_needed"] == pytest.approx(1.873, abs=1e-3)
    assert len(record["runs"]) == len(friction_cells("fig12", 0.2, quick=True))
