"""`make setup` installs all that is needed, on a Python that is supported."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path
from zipfile import ZipFile

import pytest

from tests.imports import PROJECT

OUTSIDE = re.compile(r"validation(\.\w+)*$")  # the full name of a module
PYPROJECT = tomllib.loads((PROJECT / "pyproject.toml").read_text())


def test_every_python_from_3_11_to_3_14_is_taken() -> None:
    """By the package and by the Makefile alike."""
    (by_make,) = re.findall(r"^PYTHON_RANGE := (.*)$", (PROJECT / "Makefile").read_text(), re.M)
    assert by_make == PYPROJECT["project"]["requires-python"] == ">=3.11,<3.15"


def test_labmaze_is_left_out() -> None:
    """dm-control asks for it. No newer Python has a wheel of it, nor so dm-control."""
    lock = (PROJECT / "requirements.lock").read_text()
    assert re.findall(r"^labmaze.*(?=\\)", lock, re.M) == [
        "labmaze==1.0.6 ; python_full_version < '3.13' and sys_platform == 'never' "
    ]
    (asked,) = (each for each in PYPROJECT["project"]["dependencies"] if "dm-control" in each)
    assert asked.endswith("; python_version < '3.13'")
    assert find_spec("labmaze") is None
    assert (find_spec("dm_control") is not None) == (sys.version_info < (3, 13))


def executable(path: Path, script: str) -> Path:
    """Write a script of the shell to a path, whose folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return path


def run_ci(tmp_path: Path, *pythons: str) -> tuple[list[str], str]:
    """Return what each call of make by `.ci/run` logs, and the output of `.ci/run`.

    `make pythons` lists the given Pythons, and that of `.venv` as the oldest. Any other call logs
    its arguments, its environment, and what is in HOME.
    """
    shutil.copytree(PROJECT / ".ci", tmp_path / "clone" / ".ci")
    listed = " ".join([*pythons, "3.11=/clone/.venv/bin/python"])
    make = executable(
        tmp_path / "make",
        f"test \"$*\" = '--silent pythons' && {{ printf '%s\\n' {listed}; exit; }}\n"
        '{ echo "make $*"; env; ls -A "$HOME"; } >> "$0.log"',
    )
    path = os.pathsep.join([str(tmp_path), os.environ["PATH"]])
    machine = {**os.environ, "PATH": path, "HOME": str(PROJECT)}
    command = [tmp_path / "clone" / ".ci" / "run"]
    said = subprocess.run(command, env=machine, check=True, capture_output=True, text=True)
    calls = re.split(r"^make ", make.with_name("make.log").read_text(), flags=re.M)[1:]
    return calls, said.stdout + said.stderr


def test_continuous_integration_knows_nothing_of_its_machine(tmp_path: Path) -> None:
    """It runs the README's two commands and two more; each sees PATH and an empty HOME alone."""
    calls, said = run_ci(tmp_path, "3.13=/new/python3.13", "3.12=/old/python3.12")
    commands = [call.split("\n")[0] for call in calls]
    other = "VENV=.venv-other PYTHON=/new/python3.13 UV_COMPILE_BYTECODE=0"
    assert commands == ["demo", "test", f"demo test TESTS=core and not slow {other}", "wheel ONE=1"]
    bits = {"OPENBLAS_CORETYPE=Haswell", "NUMBA_CPU_NAME=generic"}
    for call, more in zip(calls, (set(), set(), bits, set()), strict=True):
        of_the_shell = re.compile("PWD=|OLDPWD=|SHLVL=|_=")
        seen = {line for line in call.split("\n")[1:-1] if not of_the_shell.match(line)}
        home = {line for line in seen if line.startswith("HOME=")} - {f"HOME={PROJECT}"}
        assert len(home) == 1
        assert seen == home | more | {f"PATH={tmp_path}:{os.environ['PATH']}"}
    assert len(re.findall(r"^== .*make .*: \S+s, processor time \S+s user", said, re.M)) == 4


def test_continuous_integration_says_that_a_machine_has_one_python(tmp_path: Path) -> None:
    """The numeric tests run again with it, on other last bits."""
    calls, said = run_ci(tmp_path)
    assert calls[2].startswith("demo test TESTS=core and not slow VENV=.venv\n")
    assert "no other Python here" in said


@pytest.mark.parametrize(("tests", "types"), [(0, 0), (1, 0), (0, 1)])
def test_make_test_fails_if_tests_or_mypy_fail(tmp_path: Path, tests: int, types: int) -> None:
    """Both run, their output is not mixed, and the failure of either one is that of `make test`."""
    shutil.copy(PROJECT / "Makefile", tmp_path)
    for name in ("pyproject.toml", "requirements.lock"):
        (tmp_path / name).touch()
    (tmp_path / ".ci").symlink_to(PROJECT / ".ci")
    bin_folder = tmp_path / "environment" / "bin"
    executable(bin_folder / "pytest", f"sleep 0.2; echo 'tests: {tests} failed'; exit {tests}")
    executable(bin_folder / "mypy", f"echo 'types: {types} errors'; exit {types}")
    for name in ("python", "ruff", "uv", "chromium"):
        executable(bin_folder / name, "exit 0")
    (bin_folder.parent / ".stamp").touch()
    # Without the variables of the make that may run this test.
    machine = {"PATH": f"{bin_folder}:{os.environ['PATH']}"}
    ran = subprocess.run(
        ["make", "test", "VENV=environment"],
        cwd=tmp_path, env=machine, capture_output=True, text=True,
    )  # fmt: skip
    assert (ran.returncode == 0) == (tests == types == 0)
    lines = [f"tests: {tests} failed", "mypy:", f"types: {types} errors"]
    lines += [f"exit status: pytest {tests}, mypy {types}"]
    assert ran.stdout.splitlines()[-4:] == lines


def test_the_wheel_has_the_files_of_the_checkout(tmp_path: Path) -> None:
    """Byte for byte, all in `robotball`; validation names no package `validation`."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=PROJECT, check=True, capture_output=True)
    with ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        files = {name: wheel.read(name) for name in wheel.namelist() if ".dist-info/" not in name}
    folders = ("robotball", "validation", "mjcf")
    listed = subprocess.check_output(["git", "ls-files", *folders], cwd=PROJECT, text=True)
    checkout = {
        (name if name.startswith("robotball/") else f"robotball/{name}"): PROJECT / name
        for name in listed.splitlines()
    }
    assert files == {name: file.read_bytes() for name, file in checkout.items()}
    modules = [name for name in files if re.match(r"robotball/validation/.*\.py$", name)]
    assert len(modules) > 40
    for name in modules:
        for node in ast.walk(ast.parse(files[name])):
            named: list[object] = []
            if isinstance(node, ast.Import):
                named += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom | ast.Constant):
                named.append(node.module if isinstance(node, ast.ImportFrom) else node.value)
            assert not [module for module in named if OUTSIDE.match(str(module))], name
