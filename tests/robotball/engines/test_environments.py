"""An engine that only an environment has runs there by itself, and what goes wrong is one line."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.engines import environments
from robotball.engines.adapter import elsewhere
from robotball.errors import check_count
from tests.elsewhere_engine import ELSEWHERE
from tests.imports import PROJECT

FIG12 = rb.load_scene("fig12")
TIMES = rb.sample_times(0.2)


def package(folder: Path, name: str, points: str = "") -> None:
    """The metadata of an installed package, with its entry points."""
    info = folder / f"{name.replace('-', '_')}-1.5.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\n")
    (info / "entry_points.txt").write_text(points)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of environments, in which the one of the engine is: its interpreter finds more."""
    point = "[robotball.engines]\nelsewhere = tests.elsewhere_engine:ELSEWHERE\n"
    package(tmp_path / "ours", "elsewhere", point)
    monkeypatch.setattr(sys, "path", [str(tmp_path / "ours"), *sys.path])
    home = tmp_path / "engines" / "elsewhere"
    there = environments._packages(home)
    package(there, "only-there")
    (there / "only_there.py").touch()
    (there / environments._MADE).touch()
    home.chmod(0o700)
    python = home / "bin" / "python"
    python.parent.mkdir()
    path = f"{there}:{tmp_path / 'ours'}:{PROJECT}"
    python.write_text(f'#!/bin/sh\nPYTHONPATH="{path}" exec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    return home.parent


@pytest.mark.slow
def test_an_engine_runs_in_its_environment_by_itself(folder: Path) -> None:
    """The same motion to the last bit, with the version of there; its warning is issued here."""
    engine = elsewhere(ELSEWHERE, folder)
    with pytest.warns(rb.SceneWarning, match="fig12, RK4: Elsewhere: it warns"):
        there = rb.simulate(FIG12, TIMES, engine=engine)
    assert there.engine.version == "1.5"
    assert ELSEWHERE.label.version == "not installed"
    here = rb.simulate(FIG12, TIMES, engine=replace(ELSEWHERE, packages=()))
    assert np.array_equal(there.contact_point, here.contact_point)
    assert there.report.steps == here.report.steps == 10


def test_what_cannot_run_there_is_one_line(folder: Path, tmp_path: Path) -> None:
    """It is nowhere; or the environment has lost it; or a drive is a function of no module."""
    with pytest.raises(rb.InputError, match=r"^Elsewhere is not installed: robotball engines --i"):
        rb.simulate(FIG12, TIMES, engine=elsewhere(ELSEWHERE, tmp_path / "none"))
    function = FIG12.with_hinges(command={"frame": lambda t: 1.0 + 0.1 * t})
    with pytest.raises(rb.InputError, match=r"stands in a module alone: Can't (pickle|get)"):
        rb.simulate(function, TIMES, engine=elsewhere(ELSEWHERE, folder))
    assert elsewhere(rb.engine_named("mujoco"), folder) is rb.engine_named("mujoco")


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("kill -SEGV $$", "python: ended by SIGSEGV$"),
        ("echo the last word >&2; exit 3", "python: the last word$"),
        ("exit 0", "python: it ended without a word$"),
    ],
)
def test_a_process_that_ends_badly_is_one_line(tmp_path: Path, script: str, said: str) -> None:
    """Its signal, or its last word, with the interpreter."""
    interpreter = tmp_path / "python"
    interpreter.write_text(f"#!/bin/sh\n{script}\n")
    interpreter.chmod(0o755)
    with pytest.raises(rb.InputError, match=said):
        environments.call(interpreter, int)


@pytest.mark.slow
def test_an_error_of_another_process_is_raised_here() -> None:
    """An InputError as it was; of any other its last word."""
    with pytest.raises(rb.InputError, match="starts must be at least 1, not 0"):
        environments.call(sys.executable, check_count, "starts", 0, 1)
    with pytest.raises(rb.InputError, match=r"python.*: ValueError: could not convert"):
        environments.call(sys.executable, float, "no number")


def test_versions_are_those_that_the_environment_holds(folder: Path) -> None:
    """By the names in requirements; of what is not there nothing is said."""
    home = folder / "elsewhere"
    assert environments.versions_in(home, ("only-there>=1", "numpy")) == "only-there 1.5"
    assert environments.interpreter_of(home) == home / "bin" / "python"
    assert environments.interpreter_of(folder / "none") is None


@pytest.mark.parametrize("whose", ["another user's", "writable by others", "not made by us"])
def test_an_environment_that_is_not_ours_is_not_run(
    folder: Path, whose: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is refused in a line; one that robotball did not make is none. Nor is any made there."""
    home = folder / "elsewhere"
    if whose == "not made by us":
        (environments._packages(home) / environments._MADE).unlink()
        assert environments.interpreter_of(home) is None
        return
    if whose == "another user's":
        monkeypatch.setattr(os, "getuid", lambda: 123456)
    else:
        home.chmod(0o777)
    words = r"elsewhere belongs to another user, or others may write there, so it is not run: give"
    with pytest.raises(rb.InputError, match=words):
        rb.simulate(FIG12, TIMES, engine=elsewhere(ELSEWHERE, folder))


@pytest.mark.slow
def test_a_process_imports_nothing_of_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A module there does not stand in for one that it loads."""
    (tmp_path / "numpy.py").write_text("raise SystemExit('of a stranger')")
    monkeypatch.chdir(tmp_path)
    assert environments.call(sys.executable, eval, "float(__import__('numpy').ones(2).sum())") == 2


def test_environments_are_in_the_users_own_folder(tmp_path: Path) -> None:
    """Whatever folder one stands in: XDG_DATA_HOME, which a relative path is not, or the home's."""
    code = "from robotball.engines.environments import ENVIRONMENTS; print(ENVIRONMENTS)"
    own = tmp_path / ".local" / "share"
    for given, data in ((str(tmp_path / "data"), tmp_path / "data"), ("out", own), ("", own)):
        environment = {**os.environ, "HOME": str(tmp_path), "XDG_DATA_HOME": given}
        command = [sys.executable, "-c", code]
        said = subprocess.check_output(command, env=environment, text=True, cwd=PROJECT)
        assert said.strip() == str(data / "robotball" / "engines")
