"""An engine of another package works in every command."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import robotball as rb
from robotball.engines.engine import OURS
from robotball.engines.mujoco.mujoco_engine import MUJOCO
from tests.conftest import Robotball
from tests.messages import unnamed
from tests.off_engine import ERROR, OFF
from validation import compare
from validation.plots import momentum_picture, path_picture

FIG12 = rb.load_scene("fig12")
OFF_LABEL = "Off, as it comes"  # with default settings


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install the engine `off` as an entry point of a package."""
    info = tmp_path / "off-3.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: off\nVersion: 3.1\n")
    (info / "entry_points.txt").write_text(
        "[robotball.engines]\noff = tests.off_engine:OFF\ntorn = tests.off_engine:NOWHERE\n"
    )
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])


def test_an_engine_is_compared_with_the_equations() -> None:
    """Its deliberate error of 1e-4 of the path is measured, and plots have its colour."""
    agreement = compare(FIG12, engine=OFF)
    assert agreement.path_error == pytest.approx(ERROR, rel=1e-9)
    assert (agreement.momentum_error, agreement.agrees) == (0, True)
    for draw, names in (
        (path_picture, ["equations", OFF_LABEL, "start"]),
        (momentum_picture, [OFF_LABEL]),
    ):
        axes = draw([agreement]).axes[0]
        assert axes.get_legend_handles_labels()[1] == names
        colours = {line.get_color() for line in axes.get_lines()}
        assert colours & {OFF.label.colour, MUJOCO.label.colour} == {OFF.label.colour}


@pytest.mark.usefixtures("installed")
def test_an_engine_is_found_by_its_entry_point(robotball: Robotball, tmp_path: Path) -> None:
    """It appears in the list of engines, in table, JSON, CSV and names of pictures."""
    assert rb.engine_names() == [*OURS, "off", "torn"]
    assert rb.engine_named("off") is OFF
    options = ("fig12", "--engine", "off", "--json", "data.json", "--csv", "t.csv")
    status, out, _ = robotball("compare", *options)
    assert status == 0
    assert "as it comes" in out
    (record,) = json.loads((tmp_path / "data.json").read_text())
    assert record["engine"] == "Off"
    assert record["versions"]["Off"] == "3.1"
    assert record["path_error"] == pytest.approx(ERROR, rel=1e-9)
    assert ",Off," in (tmp_path / "t.csv").read_text()
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "fig12-off-as-it-comes-path.png",
        "fig12-off-as-it-comes-momentum.png",
    }


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("arguments", "facts"),
    [
        ("fig12 --engine mujok", "engine 'mujok' mujoco"),
        ("fig12 --engine torn", "engine 'torn' tests.off_engine:NOWHERE"),
        ("fig12 --engine off --preset fast", "preset 'fast'"),
        ("fig12 --engine off --accuracy 1e-6", "Off accuracy"),
        ("classical_regular --engine off", "Off classical_regular"),
    ],
)
def test_unsupported_requests_to_an_engine_are_refused_before_the_run(
    arguments: str, facts: str, robotball: Robotball
) -> None:
    """In one line, with exit status 2."""
    status, _, err = robotball("compare", *arguments.split())
    assert (status, unnamed(facts, err), err.count("\n")) == (2, [], 1)


@pytest.mark.slow
@pytest.mark.usefixtures("installed")
def test_the_study_of_engines_runs_an_engine_without_settings_in_its_table(tmp_path: Path) -> None:
    """Each of its presets runs with default settings, in a separate process."""
    study = "engines fig12 --only off --duration 1 --workers 1"
    here = {**os.environ, "PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-P", "-m", "validation", *study.split()]
    subprocess.run(command, cwd=tmp_path, env=here, capture_output=True, check=True)
    (data,) = tmp_path.glob("out/*.json")
    (row,) = json.loads(data.read_text())["runs"]
    assert row["path_error"] == pytest.approx(ERROR, rel=1e-9)
