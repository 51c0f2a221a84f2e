"""An engine runs in its environment, and every failure there is one line."""

import json
import os
import subprocess
import sys
import sysconfig
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from importlib.metadata import distribution, version
from pathlib import Path
from shutil import which
from zipfile import ZipFile

import numpy as np
import pytest

import robotball as rb
from robotball.engines import environments
from robotball.engines.adapter import elsewhere
from robotball.errors import check_count
from tests.elsewhere_engine import ELSEWHERE
from tests.imports import PROJECT
from tests.messages import naming

FIG12 = rb.load_scene("fig12")
TIMES = rb.sample_times(0.2)


def package(folder: Path, name: str, points: str = "") -> None:
    """Write the metadata of an installed package with its entry points."""
    info = folder / f"{name.replace('-', '_')}-1.5.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\n")
    (info / "entry_points.txt").write_text(points)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of environments with one for ELSEWHERE, whose Python also finds this code."""
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


def test_a_package_whose_engine_cannot_be_loaded_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With file and line, even if its code ends the program.

    After an import of importlib_metadata, for example in dask, that module loads the entry points.
    """
    with suppress(ImportError):
        import_module("importlib_metadata")
    package(tmp_path, "leaving", "[robotball.engines]\nleaving = leaving_engine:ENGINE\n")
    (tmp_path / "leaving_engine.py").write_text("raise SystemExit(0)\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    with pytest.raises(
        rb.InputError, match=naming("'leaving' leaving_engine.py line~1: SystemExit")
    ):
        rb.engine_named("leaving")


def test_an_engine_that_is_not_installed_here_runs_in_its_environment(folder: Path) -> None:
    """Same motion to the last bit, with the environment's version; its warning is repeated here."""
    package(environments._packages(folder / "elsewhere"), "robotball")
    engine = elsewhere(ELSEWHERE, folder)
    with pytest.warns(rb.SceneWarning, match=naming("fig12 RK4 Elsewhere")):
        there = rb.simulate(FIG12, TIMES, engine=engine)
    assert there.engine.version == there.report.versions["robotball"] == "1.5"
    assert ELSEWHERE.label.version == "not installed"
    here = rb.simulate(FIG12, TIMES, engine=replace(ELSEWHERE, packages=()))
    assert here.report.versions["robotball"] == version("robotball")
    assert np.array_equal(there.contact_point, here.contact_point)
    assert there.report.steps == here.report.steps == 10


def test_a_run_that_the_environment_cannot_make_is_refused_in_one_line(
    folder: Path, tmp_path: Path
) -> None:
    """The engine is installed nowhere, or a drive is a local function."""
    with pytest.raises(rb.InputError, match=naming("Elsewhere engines --install")):
        rb.simulate(FIG12, TIMES, engine=elsewhere(ELSEWHERE, tmp_path / "none"))
    function = FIG12.with_hinges(command={"frame": lambda t: 1.0 + 0.1 * t})
    with pytest.raises(rb.InputError, match=naming("module local~object")):
        rb.simulate(function, TIMES, engine=elsewhere(ELSEWHERE, folder))
    assert elsewhere(rb.engine_named("mujoco"), folder) is rb.engine_named("mujoco")


@pytest.mark.parametrize(
    ("script", "facts"),
    [
        ("kill -SEGV $$", "python SIGSEGV"),
        ("echo the last word >&2; exit 3", "python the~last~word"),
        ("exit 0", "python message"),
        ("echo ImportError: no warp >&2; exit 1", "python no~warp engines --install {home}"),
    ],
)
def test_a_process_that_fails_is_reported_in_one_line(
    tmp_path: Path, script: str, facts: str
) -> None:
    """With the interpreter, and its signal or last line; a failed import with the remedy."""
    interpreter = tmp_path / "bin" / "python"
    interpreter.parent.mkdir()
    interpreter.write_text(f"#!/bin/sh\n{script}\n")
    interpreter.chmod(0o755)
    with pytest.raises(rb.InputError, match=naming(facts.format(home=tmp_path.name))):
        environments.call(interpreter, int)


def test_an_error_of_another_process_is_raised_here() -> None:
    """An InputError is raised unchanged; any other error with its last line."""
    with pytest.raises(rb.InputError, match=naming("starts 1 0")):
        environments.call(sys.executable, check_count, "starts", 0, 1)
    with pytest.raises(rb.InputError, match=naming("python ValueError")):
        environments.call(sys.executable, float, "no number")


def test_versions_are_read_from_the_environment(folder: Path) -> None:
    """For the required packages that it holds."""
    home = folder / "elsewhere"
    assert environments.versions_in(home, ("only-there>=1", "numpy")) == "only-there 1.5"
    assert environments.interpreter_of(home) == home / "bin" / "python"
    assert environments.interpreter_of(folder / "none") is None


def test_a_broken_or_old_environment_is_refused_with_the_command_that_makes_it_again(
    folder: Path,
) -> None:
    """Its Python was removed, or its engine is older than its adapter requires."""
    home = folder / "elsewhere"
    assert environments.interpreter_of(home, ["only-there>=1.5", "absent>=2"]) is not None
    with pytest.raises(rb.InputError, match=naming("1.5 only-there>=1.10 --install elsewhere")):
        environments.interpreter_of(home, ["only-there>=1.10"])
    engine = elsewhere(ELSEWHERE, folder)
    (home / "bin" / "python").unlink()
    with pytest.raises(rb.InputError, match=naming("bin/python exist --install elsewhere")):
        rb.simulate(FIG12, TIMES, engine=engine)


def test_newer_releases_of_an_engine_and_its_parts_are_asked_of_the_index(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not those of other packages. mujoco-core is a part of mujoco, and jaxlib of jax."""
    names = ("mujoco-core", "jaxlib", "absl-py", "warp-lang")
    answer = [{"name": name, "version": "1", "latest_version": "2.0"} for name in names]
    asked: list[str] = []

    def uv(home: Path, _: str, *arguments: str, text: str = "") -> str:
        asked.extend(arguments)
        return json.dumps(answer)

    monkeypatch.setattr(environments, "_uv", uv)
    python = folder / "elsewhere" / "bin" / "python"
    newer = environments.newer_releases(python, ["mujoco-mjx>=3.17", "jax>=0.10"])
    assert newer == ["mujoco-core 2.0", "jaxlib 2.0"]
    assert {"--outdated", str(python)} <= {*asked}


@pytest.mark.parametrize("name", ["bin/python", "lib/*/site-packages", "lib/*/*/only_there.py"])
def test_an_environment_with_a_file_that_others_may_write_is_not_run(
    folder: Path, name: str
) -> None:
    """At any depth. Write access for the group is safe below a folder that it cannot enter."""
    home = folder / "elsewhere"
    (home / ".lock").touch()
    (home / ".lock").chmod(0o666)
    (path,) = home.glob(name)
    path.chmod(0o775)
    assert environments.interpreter_of(home) == home / "bin" / "python"
    for top, mode in ((0o700, 0o777), (0o755, 0o775)):
        home.chmod(top)
        path.chmod(mode)
        pattern = rf"{path} is not run, because another user owns it or may write to it"
        with pytest.raises(rb.InputError, match=pattern):
            environments.interpreter_of(home)


def test_a_link_in_an_environment_must_lead_to_a_file_that_others_cannot_change(
    folder: Path, tmp_path: Path
) -> None:
    home, python = folder / "elsewhere", tmp_path / "python3"
    python.touch(mode=0o755)
    (home / "bin" / "python").unlink()
    (home / "bin" / "python").symlink_to(python)
    (home / "bin" / "nowhere").symlink_to(tmp_path / "nowhere")
    assert environments.interpreter_of(home) == home / "bin" / "python"
    python.chmod(0o757)
    with pytest.raises(rb.InputError, match="bin/python is not run, because another user"):
        environments.interpreter_of(home)


@pytest.mark.parametrize("whose", ["another user's", "writable by others", "not made by us"])
def test_an_environment_that_is_not_ours_is_not_run(
    folder: Path, whose: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is refused in one line, or ignored if robotball did not make it."""
    home = folder / "elsewhere"
    if whose == "not made by us":
        (environments._packages(home) / environments._MADE).unlink()
        assert environments.interpreter_of(home) is None
        return
    if whose == "another user's":
        monkeypatch.setattr(os, "getuid", lambda: 123456)
    else:
        home.chmod(0o777)
    with pytest.raises(rb.InputError, match=naming("elsewhere user write")):
        rb.simulate(FIG12, TIMES, engine=elsewhere(ELSEWHERE, folder))


def test_a_process_imports_no_module_from_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file there cannot replace a module."""
    (tmp_path / "numpy.py").write_text("raise SystemExit('of a stranger')")
    monkeypatch.chdir(tmp_path)
    assert environments.call(sys.executable, eval, "float(__import__('numpy').ones(2).sum())") == 2


def python_of(folder: Path, minor: int, version: int) -> Path:
    """Make a program python3.`minor` that claims to be Python 3.`version`."""
    folder.mkdir(parents=True)
    path = folder / f"python3.{minor}"
    path.write_text(f"#!/bin/sh\necho python3.{version}\n")
    path.chmod(0o755)
    return path


@pytest.mark.parametrize("root", ["PYENV_ROOT", "PATH"])
def test_pythons_are_found_on_the_path_and_where_pyenv_and_uv_keep_theirs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, root: str
) -> None:
    """Newest first; for each version the first Python with that version, and ours for our own.

    Pyenv's folder is PYENV_ROOT, or the parent of shims on the PATH.
    """
    own = sys.version_info[1]
    pyenv, uv = tmp_path / "pyenv", tmp_path / "uv"
    first, other, third = (minor for minor in (14, 13, 12, 11) if minor != own)
    shims = python_of((pyenv if root == "PATH" else tmp_path) / "shims", first, own).parent
    there = {
        f"3.{first}": python_of(pyenv / "versions" / "a" / "bin", first, first),
        f"3.{other}": python_of(tmp_path / "bin", other, other),
        f"3.{third}": python_of(uv / "b" / "bin", third, third),
    }
    python_of(tmp_path / "ours", own, own)
    monkeypatch.chdir(python_of(tmp_path / "here" / "relative", 10, 10).parents[1])
    monkeypatch.setenv("PATH", f"relative:{shims}:{tmp_path / 'bin'}:{tmp_path / 'ours'}")
    monkeypatch.setattr(environments, "_PYENV", pyenv if root == "PYENV_ROOT" else tmp_path)
    monkeypatch.setattr(environments, "_UV", uv)
    pythons = environments.pythons()
    assert pythons == there | {f"3.{own}": Path(sys.executable)}
    minors = [int(version.removeprefix("3.")) for version in pythons]
    assert minors == sorted(minors, reverse=True)
    assert environments.python_named(f"3.{third}") == there[f"3.{third}"]
    with pytest.raises(rb.InputError, match=naming("3.2 3.1…")):
        environments.python_named("3.2")


@pytest.mark.parametrize(
    ("newest", "known", "taken", "newer"),
    [
        ({"3.14": "2.0", "3.13": "1.10", "3.12": "1.9"}, ["3.13", "3.12"], "3.13", ["engine 2.0"]),
        ({"3.14": "2.0", "3.12": "1.10"}, ["3.14", "3.12"], "3.14", []),
        ({"3.14": "", "3.13": "1.10", "3.12": "1.10"}, ["3.14", "3.13", "3.12"], "3.13", []),
        ({"3.14": "", "3.12": ""}, ["3.14", "3.12"], "3.14", []),
    ],
)
def test_an_environment_has_the_newest_python_that_the_newest_release_supports(
    newest: dict[str, str],
    known: list[str],
    taken: str,
    newer: list[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    """Version 1.10 is newer than 1.9. A newer release without a Python here is reported."""
    made: list[str] = []

    def uv(home: Path, _: str, *arguments: str, text: str = "") -> str:
        if "compile" in arguments:
            release = newest[arguments[arguments.index("--python-version") + 1]]
            return f"another==3\nengine=={release}\n" if release else ""
        if "venv" not in arguments:
            return ""
        made.append(arguments[arguments.index("--python") + 1])
        there = home / "lib" / environments._OWN_NAME / "site-packages"
        info = there / "engine.dist-info"
        info.mkdir(parents=True, exist_ok=True)
        (info / "METADATA").write_text(f"Name: engine\nVersion: {newest[made[-1]] or '2.0'}\n")
        return ""

    monkeypatch.setattr(environments, "_supported", lambda: [*newest])
    monkeypatch.setattr(environments, "pythons", lambda: {name: Path(name) for name in known})
    monkeypatch.setattr(environments, "_uv", uv)
    home = environments.make(tmp_path / "engine", ("engine>=1",))
    assert made == [taken]
    why, *others = environments.said_of(home)
    assert f"{newest[taken] or 'none'} for {taken}" in why
    assert others == newer


def has_uv() -> bool:
    return which("uv", path=sysconfig.get_path("scripts")) is not None or which("uv") is not None


def tiny_wheel(folder: Path) -> Path:
    path, facts = folder / "tiny-1.5-py3-none-any.whl", "tiny-1.5.dist-info"
    with ZipFile(path, "w") as wheel:
        wheel.writestr("tiny.py", "")
        wheel.writestr(f"{facts}/METADATA", "Metadata-Version: 2.1\nName: tiny\nVersion: 1.5\n")
        wheel.writestr(f"{facts}/WHEEL", "Wheel-Version: 1.0\nTag: py3-none-any\n")
        wheel.writestr(f"{facts}/RECORD", "")
    return path


def test_an_environment_can_be_made_and_runs_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With uv and a wheel in a folder. Only its user can enter; making it again empties it."""
    if not has_uv():
        pytest.skip("uv is not installed")
    tiny_wheel(tmp_path)
    monkeypatch.setenv("UV_FIND_LINKS", str(tmp_path))
    monkeypatch.setenv("UV_OFFLINE", "1")
    for _ in range(2):
        home = environments.make(tmp_path / "engines" / "tiny", ["tiny>=1"], Path(sys.executable))
        assert environments.versions_in(home, ["tiny"]) == "tiny 1.5"
        assert home.stat().st_mode & 0o777 == 0o700
        python = environments.interpreter_of(home)
        assert python is not None
        assert environments.call(python, eval, "__import__('tiny').__name__") == "tiny"
        assert not (home / "stray").exists()
        (home / "stray").touch()
    with pytest.raises(rb.InputError, match=naming("tiny tiny==2")):
        environments.make(home, ["tiny==2"], Path(sys.executable))
    assert environments.interpreter_of(home) is None


def test_environments_share_files_unless_others_may_change_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Hard links to the files of uv's cache; copies of those that a group may write."""
    if not has_uv():
        pytest.skip("uv is not installed")
    tiny_wheel(tmp_path)
    monkeypatch.setenv("UV_FIND_LINKS", str(tmp_path))
    monkeypatch.setenv("UV_OFFLINE", "1")
    monkeypatch.setenv("UV_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(environments, "_newest", lambda *_: "")
    homes = [tmp_path / "engines" / name for name in ("one", "two", "three")]
    for home in homes[:2]:
        environments.make(home, ["tiny"], Path(sys.executable))
    one, two, three = (environments._packages(home) / "tiny.py" for home in homes)
    assert one.samefile(two)
    one.chmod(0o660)
    with pytest.raises(rb.InputError, match=naming("tiny.py user --environments")):
        environments.interpreter_of(homes[1])
    environments.make(homes[2], ["tiny"], Path(sys.executable))
    assert not one.samefile(three)
    assert environments.interpreter_of(homes[2]) is not None


def test_without_uv_the_message_names_the_command_that_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A uv in the current folder is not run, even if the PATH names that folder."""
    (tmp_path / "uv").write_text("#!/bin/sh\n")
    (tmp_path / "uv").chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", ".")
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(tmp_path / "none"))
    with pytest.raises(rb.InputError, match="pip install uv"):
        environments.make(tmp_path / "engine", ["tiny"], Path(sys.executable))
    assert environments.interpreter_of(tmp_path / "engine") is None


def test_an_environment_of_another_python_is_outdated_if_our_requirements_have_changed(
    tmp_path: Path,
) -> None:
    """It holds the packages that robotball required when it was made."""
    home = tmp_path / "engine"
    there = home / "lib" / "python3.99" / "site-packages"
    there.mkdir(parents=True)
    home.chmod(0o700)
    (there / environments._MADE).touch()
    (home / "bin").mkdir()
    (home / "bin" / "python").touch(mode=0o755)
    assert environments.interpreter_of(home) is None
    facts = there / "robotball-0.dist-info"
    facts.mkdir()
    ours = distribution("robotball").read_text("METADATA")
    assert ours is not None
    (facts / "METADATA").write_text(ours)
    assert environments.interpreter_of(home) == home / "bin" / "python"
    (facts / "METADATA").write_text(ours.replace("Requires-Dist: numpy", "Requires-Dist: numpy<2,"))
    assert environments.interpreter_of(home) is None


def test_environments_are_in_the_users_data_folder(tmp_path: Path) -> None:
    """In an absolute XDG_DATA_HOME, else in ~/.local/share, whatever the current folder is."""
    code = "from robotball.engines.environments import ENVIRONMENTS; print(ENVIRONMENTS)"
    default = tmp_path / ".local" / "share"
    for variable, data in (
        (str(tmp_path / "data"), tmp_path / "data"),
        ("out", default),
        ("", default),
    ):
        environment = {**os.environ, "HOME": str(tmp_path), "XDG_DATA_HOME": variable}
        command = [sys.executable, "-c", code]
        output = subprocess.check_output(command, env=environment, text=True, cwd=PROJECT)
        assert output.strip() == str(data / "robotball" / "engines")
