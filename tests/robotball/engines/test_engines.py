"""An engine of somebody else's is found, and goes through everything that ours does."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.engine import OURS, request_of
from robotball.engines.mujoco.mujoco_engine import MUJOCO
from tests.conftest import Robotball
from tests.off_engine import ERROR, OFF
from validation import compare
from validation.plots import momentum_picture, path_picture, sheet_of

FIG12 = rb.load_scene("fig12")


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The engine `off` as a package with an entry point would bring it."""
    info = tmp_path / "off-3.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: off\nVersion: 3.1\n")
    (info / "entry_points.txt").write_text(
        "[robotball.engines]\noff = tests.off_engine:OFF\ntorn = tests.off_engine:NOWHERE\n"
    )
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])


def test_an_engine_is_held_against_the_equations() -> None:
    """Its deliberate error, 1e-4 of the path at the end, is what compare measures."""
    agreement = compare(FIG12, engine=OFF)
    assert agreement.path_error == pytest.approx(ERROR, rel=1e-9)
    assert agreement.momentum_error == 0
    assert agreement.agrees
    assert agreement.settings.name == "as it comes"


def test_plots_have_the_engines_name_and_colour() -> None:
    """Labels and lines are the engine's, not those of ours."""
    agreement = compare(FIG12, engine=OFF)
    for picture in (path_picture(sheet_of([agreement])), momentum_picture(sheet_of([agreement]))):
        axes = picture.axes[0]
        _, labels = axes.get_legend_handles_labels()
        assert labels == ["equations", "Off, as it comes"]
        assert OFF.label.colour in {line.get_color() for line in axes.get_lines()}
        assert MUJOCO.label.colour not in {line.get_color() for line in axes.get_lines()}


@pytest.mark.slow
@pytest.mark.usefixtures("installed", "screen")
def test_a_package_brings_an_engine_to_every_command(robotball: Robotball, tmp_path: Path) -> None:
    """Found by its entry point: in the list, in table, JSON, CSV, plots and in a film."""
    assert rb.engine_names() == [*OURS, "off", "torn"]
    assert rb.engine_named("off") is OFF
    options = ("fig12", "--engine", "off")
    status, out, _ = robotball("compare", *options, "--json", "data.json", "--csv", "t.csv")
    assert status == 0
    assert "as it comes" in out
    (record,) = json.loads((tmp_path / "data.json").read_text())
    assert record["engine"] == "Off"
    assert record["versions"]["Off"] == "3.1"
    assert record["path_error"] == pytest.approx(ERROR, rel=1e-9)
    assert ",Off," in (tmp_path / "t.csv").read_text()
    assert robotball("video", *options, "--duration", 0.2)[0] == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "fig12-off-as-it-comes-path.png", "fig12-off-as-it-comes-momentum.png",
        "fig12-off-as-it-comes-0.2s.mp4",
    }  # fmt: skip


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("fig12 --engine mujok", "no engine is called 'mujok'; did you mean mujoco"),
        ("fig12 --engine torn", "the engine 'torn' of tests.off_engine:NOWHERE fails"),
        ("fig12 --engine off --preset fast", "no preset is called 'fast'; there are"),
        ("fig12 --engine off --accuracy 1e-6", "Off has no settings for an accuracy"),
        ("classical_regular --engine off", "Off cannot run classical_regular: it has no"),
    ],
)
def test_what_an_engine_cannot_do_is_one_line_before_the_run(
    arguments: str, words: str, robotball: Robotball
) -> None:
    """Exit status 2."""
    status, _, err = robotball("compare", *arguments.split())
    assert status == 2
    assert words in err
    assert err.count("\n") == 1


def test_an_engine_that_prepares_nothing_is_run_anew_from_every_start() -> None:
    """The protocol's own way: the scene with another start."""
    start = rb.load_scene("fig13").start
    motion = OFF.prepare(FIG12, OFF.presets["as it comes"])(np.array([0.0, 0.1]), start)
    assert motion.momentum[0] == pytest.approx(start.momentum, abs=1e-12)


def test_a_request_is_made_of_settings_or_of_an_accuracy() -> None:
    """It is named by either; an engine's own settings are not another's."""
    assert request_of(settings="fast").name == "fast"
    assert request_of(accuracy=1e-6).name == "to 1e-06"
    assert request_of(settings="fast", keep_going=True).settings != rb.preset("fast")
    with pytest.raises(rb.InputError, match="MuJoCo runs by Settings, not by EngineSett"):
        rb.simulate(FIG12, settings=OFF.presets["as it comes"])
    with pytest.raises(rb.InputError, match="a run with a fault reaches no accuracy"):
        request_of(accuracy=1e-6, keep_going=True)
