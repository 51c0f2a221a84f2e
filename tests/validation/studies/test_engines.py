"""The study of all engines: its rows, its Pareto front, and environments of engines."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest

import robotball as rb
from bench.gallery import engines_table
from robotball.engines.environments import call, versions_in
from tests.messages import naming
from validation.studies import engine_study
from validation.studies.engine_runs import (
    LOOSEST,
    OLDER,
    Contestant,
    contestants,
    install,
    python_of,
    settings_of,
)
from validation.studies.engine_study import COLUMNS, _engines_study, cells_of, measure, study_of
from validation.sweeps import Result

FIG12, CLASSICAL = rb.load_scene("fig12"), rb.load_scene("classical_regular")
CELL = {
    "scene": "fig12", "digest": "", "duration": 0.2, "rounds": 1, "stretches": False,
    "contestant": "mujoco", "engine": "mujoco", "preset": "balanced", "field": "timestep",
    "value": 5e-3, "interpreter": sys.executable,
}  # fmt: skip


def result(value: float, error: float, seconds: float, **changes: Any) -> Result:
    """Return the result of a run of the recipe, like in the journal."""
    record = {
        "label": "MuJoCo", "version": "4", "colour": "#000000", "marker": "o", "path_error": error,
        "momentum_error": error, "defect": None, "reached": 0.2, "slip": 0.0, "spin": 0.0,
        "longest_step": value, "seconds": seconds, "python_seconds": None, "fixed_work": 1.0,
        "faults": [], "normal_force_error": 0.0, "cone_violation": 0.0, "slip_work": 0.0,
        "energy_error": 0.0, "spread": None, "python": "3.13.0",
    }  # fmt: skip
    return Result({**CELL, "value": value}, {**record, **changes}, None)


def test_a_run_in_a_process_has_the_same_result_as_a_run_here() -> None:
    """Path errors are equal to the last bit, and the record has settings and version."""
    record = measure(CELL)
    theory = rb.integrate(FIG12, rb.sample_times(0.2))
    here = rb.simulate(FIG12, theory.times, settings="balanced")
    assert record["path_error"] == rb.motion.path_error(here, theory)
    assert record["settings"]["timestep"] == 5e-3
    assert record["version"] == rb.engine_named("mujoco").label.version
    assert record["seconds"] > 0


@pytest.mark.parametrize(("step", "tolerance"), [(0.02, 1e-10), (0.1, LOOSEST)])
def test_a_presets_tolerance_applies_to_its_own_value(step: float, tolerance: float) -> None:
    """Another step or rtol has the loosest tolerance."""
    preset = rb.engine_named("mujoco").presets["exact"]
    assert settings_of(preset, "timestep", step).error_tolerance == tolerance


def test_the_front_has_the_runs_that_no_run_dominates() -> None:
    """Runs with cancelled errors and diverged runs are excluded; a failed run has its reason."""
    results = [
        result(20e-3, 1e-6, 1.0),
        result(10e-3, 1e-7, 2.0),
        result(9e-3, 2e-7, 3.0),  # more expensive and less accurate than the run before
        result(8e-3, 1e-12, 0.5, momentum_error=1e-3),
        result(7e-3, 1e-9, 0.4, faults=["the state diverged at t = 0.1 s"]),
        Result({**CELL, "value": 1.0}, None, "its process was ended by SIGSEGV"),
        result(6e-3, 0.0, 1.0, path_error=None, momentum_error=None),
    ]
    study = study_of(FIG12, results)
    front = [run["value"] for run in study["runs"] if run["on_the_pareto_front"]]
    assert front == [20e-3, 10e-3]
    assert [row["fault"] for row in study["failed"]] == [
        "its process was ended by SIGSEGV",
        "broke off at 0.2 s",
    ]


def test_runs_have_an_order_and_costs_at_one_speed() -> None:
    """Errors of order 4; a process at half the speed takes twice as long for the same cost."""
    steps = (20e-3, 10e-3, 5e-3)
    study = study_of(
        FIG12, [result(h, h**4, n, fixed_work=n) for n, h in enumerate(steps, start=1)]
    )
    assert [row["order"] for row in study["orders"]] == pytest.approx([4], abs=1e-9)
    assert [run["order"] for run in study["runs"]] == pytest.approx([4] * 3, abs=1e-9)
    assert [run["cost"] for run in study["runs"]] == pytest.approx([10.0] * 3)
    # Costs are relative to the default preset at its own step of 5 ms.
    for seconds, relative in (((2.0, 7.0), [1.0, 3.5]), ((2.0,), [1.0])):
        runs = [result(h, h**4, time) for h, time in zip((5e-3, 1e-3), seconds, strict=False)]
        assert [run["relative_cost"] for run in study_of(FIG12, runs)["runs"]] == relative
    (run,) = study_of(FIG12, [result(1e-3, 1e-7, 7.0)])["runs"]
    assert run["relative_cost"] is None


@pytest.mark.parametrize(
    ("engine", "preset", "ours"),
    [
        ("mujoco", "naive", ""),
        ("mujoco", "exact", "steps"),
        ("dart", "best", "torque against spin"),
    ],
)
def test_a_row_names_the_parts_that_robotball_provides(engine: str, preset: str, ours: str) -> None:
    """The data and the table have them."""
    cell = {**CELL, "value": 1e-3, "engine": engine, "preset": preset}
    (run,) = study_of(FIG12, [replace(result(1e-3, 1e-6, 1.0), cell=cell)])["runs"]
    assert (run["ours"], run["newcomer"]) == (ours, preset == "naive")
    (column,) = (column for column in COLUMNS if column.header == "ours")
    assert column.text(run) == ours


@pytest.mark.parametrize(
    ("preset", "python", "text"),
    [("naive", 0.6, "60%, launching"), ("naive", 0.4, "40%"), ("exact", 0.6, "60%")],
)
def test_a_row_that_is_mostly_launching_says_so(preset: str, python: float, text: str) -> None:
    """Unless the Python is that of robotball's own parts, here the steps of "exact"."""
    run = result(1e-3, 1e-6, 1.0, python_seconds=python)
    study = study_of(FIG12, [replace(run, cell={**run.cell, "preset": preset})])
    (column,) = (column for column in COLUMNS if column.header == "Python")
    assert column.text(study["runs"][0]) == text
    assert engines_table([study]).split("\n")[-1].split("| ")[5].strip() == text


def test_the_page_has_a_row_for_each_run_and_the_picture_a_label_for_each_engine() -> None:
    """It has errors of the scenes, bold on a front, the cost of the first, and a link."""
    own, worse = result(5e-3, 1e-7, 0.1), result(5e-3, 1e-2, 1.0)
    other = replace(worse, cell={**worse.cell, "contestant": "other", "preset": "fast"})
    first, second = study_of(FIG12, [own, other]), study_of(CLASSICAL, [own])
    *_, mine, others = engines_table([first, second]).split("\n")
    assert mine.split("| ")[1:7] == [
        "[MuJoCo 4, balanced](rolling/mujoco_rolls.py) ", "5 ms ", "**1.0e-07** ", "**1.0e-07** ",
        "1 ", "- ",
    ]  # fmt: skip
    assert others.split("| ")[2:5] == ["5 ms ", "1.0e-02 ", "- "]
    figure = _engines_study(FIG12, [own, other], ()).picture
    assert figure is not None
    colours = [text.get_color() for text in figure.axes[0].texts]
    assert len(colours) == 2
    assert colours.count("dimgray") == 1  # the engine that is not on the front


@pytest.mark.parametrize("name", rb.engine_names())
def test_every_preset_is_a_line_of_json(name: str) -> None:
    """Settings of a run are plain data without NaN or infinity."""
    for preset in rb.engine_named(name).presets.values():
        assert json.loads(json.dumps(preset.plain(), allow_nan=False))["name"] == preset.name


def test_a_newer_release_without_a_wheel_is_a_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The table and the data have it beside the runs of the installed release."""
    monkeypatch.setattr(engine_study, "said_of", lambda home: ["by", f"{home.name} 9.0"])
    missed = engine_study._missed([contestants()["dart"]], tmp_path)
    study = _engines_study(FIG12, [result(5e-3, 1e-7, 1.0), *missed], ())
    assert study.record is not None
    (row,) = study.record["failed"]
    assert row["title"] == "dart 9.0, any"
    assert row["fault"].startswith("no wheel for python3.")


def test_an_engine_that_is_not_installed_has_no_cells(tmp_path: Path) -> None:
    """An engine of robotball's environment runs there."""
    known = contestants()
    assert python_of(known[OLDER], tmp_path) is None
    assert cells_of("wobbling_drive", [known[OLDER]], tmp_path, 1.0, 1) == []
    assert python_of(known["mujoco"], tmp_path / "none") == Path(sys.executable)


def test_the_list_says_which_engines_have_newer_releases_and_which_are_broken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An environment that cannot run is a line with the remedy, and the others are listed."""
    known = contestants()
    asked: list[tuple[str, ...]] = []

    def newer(python: Path, packages: tuple[str, ...]) -> list[str]:
        asked.append(packages)
        return ["mujoco-core 9.0"]

    def interpreter_of(home: Path, requirements: tuple[str, ...] = ()) -> None:
        if home.name == "drake":
            raise rb.InputError("too old")

    monkeypatch.setattr(engine_study, "newer_releases", newer)
    monkeypatch.setattr("validation.studies.engine_runs.interpreter_of", interpreter_of)
    some = [known["mujoco"], known["drake"], known[OLDER]]
    mujoco, drake, older, *_ = engine_study._list(some, tmp_path, newest=True)
    assert (mujoco["newer"], drake["newer"], older["newer"]) == ("mujoco-core 9.0", "-", "-")
    assert (drake["runs in"], older["runs in"]) == ("too old", "not installed")
    assert asked == [("mujoco",)]
    assert "newer" not in engine_study._list(some, tmp_path, newest=False)[0]


def wheel(folder: Path, name: str) -> None:
    """Write a wheel of one empty module, which pip can install without network."""
    path = folder / f"{name}-1.0-py3-none-any.whl"
    facts = f"{name}-1.0.dist-info"
    with ZipFile(path, "w") as file:
        file.writestr(f"{name}.py", "")
        file.writestr(f"{facts}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        file.writestr(f"{facts}/WHEEL", "Wheel-Version: 1.0\nTag: py3-none-any\n")
        file.writestr(f"{facts}/RECORD", "")


@pytest.mark.slow
def test_an_environment_has_its_engine_and_our_packages(tmp_path: Path) -> None:
    """The engine is imported from the environment, robotball and NumPy from ours."""
    asked = Contestant("other", "mujoco", (str(tmp_path / "otherengine-1.0-py3-none-any.whl"),))
    wheel(tmp_path, "otherengine")
    home = install(asked, tmp_path, sys.executable)
    python = python_of(asked, tmp_path)
    assert python == home / "bin" / "python"
    imports = "[__import__(name).__file__ for name in ('otherengine', 'robotball')]"
    engine, package = call(python, eval, imports)
    assert Path(engine).is_relative_to(home)
    assert Path(package).samefile(rb.__file__)
    assert versions_in(home, ("otherengine>=1", "numpy")) == "otherengine 1.0"
    cells = cells_of("wobbling_drive", [asked], tmp_path, 1.0, 1)
    assert {(cell["engine"], cell["interpreter"]) for cell in cells} == {("mujoco", str(python))}


def test_a_failed_installation_makes_no_environment(tmp_path: Path) -> None:
    """A folder that a failed uv left is not used, and a folder with other files is kept."""
    asked = Contestant("other", "mujoco", (str(tmp_path / "nowhere-1-py3-none-any.whl"),))
    with pytest.raises(rb.InputError, match=naming("other nowhere")):
        install(asked, tmp_path, sys.executable)
    assert (tmp_path / "other" / "bin" / "python").exists()
    assert python_of(asked, tmp_path) is None
    with pytest.raises(rb.InputError, match=naming("mujoco already")):
        install(Contestant("mujoco", "mujoco", ()), tmp_path)
    notes = tmp_path / "mine" / "notes.txt"
    notes.parent.mkdir()
    notes.write_text("mine")
    with pytest.raises(rb.InputError, match=naming("mine environment")):
        install(replace(asked, name="mine"), tmp_path)
    assert [path.name for path in notes.parent.iterdir()] == ["notes.txt"]
