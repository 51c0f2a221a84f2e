"""Many random starts have the errors of single comparisons, on one machine or a cluster."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.processes import at_most
from tests.messages import naming
from tests.robotball.scene_files.scene_texts import PLATE
from validation import ManyRuns, compare, compare_many, random_starts
from validation.study import scene_cell
from validation.sweeps import Result, sweep

TIMES = rb.sample_times(1.0)


def starts_of(scene: rb.Scene, count: int) -> list[rb.Start]:
    randoms = (np.random.default_rng([7, i]) for i in range(count))
    return [random_starts.random_start(scene, random) for random in randoms]


# Compiled steps of both models; single integrations with a changing drive, and of general robots.
@pytest.mark.parametrize(
    "name", ["fig12", "classical_regular", "wobbling_drive", "offset_routh_sphere"]
)
def test_errors_equal_the_errors_of_single_comparisons(name: str) -> None:
    """They agree to 3e-8; measured 5e-9, because the references have other steps."""
    scene = rb.load_scene(name)
    starts = starts_of(scene, 3)
    with at_most(1):  # or what goes to processes would take seconds
        rows = compare_many(scene, starts, TIMES, settings="fast").rows
    for row, start in zip(rows, starts, strict=True):
        one = compare(replace(scene, start=start), TIMES, settings="fast")
        for error in random_starts.ERRORS:
            assert row[error] == pytest.approx(getattr(one, error), rel=3e-8)
        assert (row["fault"], row["agrees"]) == (None, True)


def test_a_broken_run_is_counted_and_has_no_error() -> None:
    """Weak friction ends a run. Percentiles use the runs with errors."""
    scene, slippery = rb.load_scene("fig12"), replace(rb.preset("fast"), sliding_friction=0.05)
    found = compare_many(scene, starts_of(scene, 3), TIMES, settings=slippery)
    none = found.summary("path_error")
    assert none["faulty"] == 3
    assert {none[name] for name in random_starts.PERCENTILES} == {None}
    row = {"path_error": 1.0, "fault": None, "agrees": True, "seconds": 1.0}
    rows = tuple(row | {"path_error": float(i)} for i in range(101))
    broken = row | {"path_error": None, "fault": "SLIPPED"}
    counts = {"runs": 102, "faulty": 1, "runs_per_second": 1.0}
    percentiles = {"p5": 5.0, "p50": 50.0, "p95": 95.0, "worst": 100.0}
    assert ManyRuns((*rows, broken)).summary("path_error") == counts | percentiles


def whole() -> dict[str, Any]:
    more = {"engine": "mujoco", "preset": "fast", "keep_going": False, "environments": None}
    return scene_cell("fig12", 0.5) | more | {"seed": 3, "device": None}


def test_a_cell_depends_on_the_values_of_its_controls(tmp_path: Path) -> None:
    """So a journal cannot mix results of two tables with the same name."""
    robot, table = tmp_path / "mybot.xml", tmp_path / "fly.csv"
    robot.write_text(PLATE)
    cells = []
    for end in (20, 30):
        table.write_text(f"t,value\n0,0\n1,{end}\n")
        cells.append(scene_cell(str(robot), 0.5, [f"fly={table}"]))
    first, other = cells
    assert first["control"] == [f"fly={table}"]
    assert first | {"digest": other["digest"]} == other != first
    assert "control" not in scene_cell("fig12", 0.5)


def without_seconds(rows: Any) -> list[dict[str, Any]]:
    return [{**row, "seconds": 0.0} for row in rows]


def test_cells_are_parts_of_the_whole() -> None:
    """A start depends on its number alone, so cells on a cluster have the same runs."""
    alone = random_starts.of_cell(whole() | {"first": 0, "count": 5})["rows"]
    parts = [whole() | {"first": i, "count": count} for i, count in ((0, 2), (2, 3))]
    rows = [row for each in parts for row in random_starts.of_cell(each)["rows"]]
    assert without_seconds(rows) == without_seconds(alone)


def test_a_cell_finds_its_engine_in_the_environments(monkeypatch: pytest.MonkeyPatch) -> None:
    """It works like `compare --environments` for a single run."""
    looked: list[Path] = []
    monkeypatch.setattr("robotball.engines.adapter.find_spec", lambda _: None)
    monkeypatch.setattr("robotball.engines.adapter.interpreter_of", looked.append)
    cell = whole() | {"engine": "dart", "preset": "best", "environments": "elsewhere"}
    with pytest.raises(rb.InputError, match=naming("DART")):
        random_starts.of_cell(cell | {"first": 0, "count": 1})
    assert looked == [Path("elsewhere/dart")]


@pytest.mark.slow
def test_a_cluster_gives_the_same_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells have two starts; a failed cell is refused with its reason.

    A process of this machine replaces the cluster.
    """
    addresses: list[str] = []

    def local(*of: Any, cluster: str, **more: Any) -> list[Result]:
        addresses.append(cluster)
        return sweep(*of, workers=1, **more)

    monkeypatch.setattr(random_starts, "sweep", local)
    monkeypatch.setattr(random_starts, "_CELL", 2)
    here, there = (random_starts.many_runs(whole(), 5, at, tmp_path) for at in (None, "tcp://a:1"))
    assert without_seconds(there.rows) == without_seconds(here.rows)
    assert len((tmp_path / "starts.jsonl").read_text().splitlines()) == 1 + 3
    with pytest.raises(rb.InputError, match=naming("scene 'nowhere'")):
        random_starts.many_runs(whole() | {"scene": "nowhere"}, 1, "tcp://a:1", tmp_path)
    assert addresses == ["tcp://a:1"] * 2
