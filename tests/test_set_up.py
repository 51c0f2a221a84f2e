"""`make setup` installs all that is needed, on a Python that is supported."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path
from zipfile import ZipFile

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


def test_continuous_integration_knows_nothing_of_its_machine(tmp_path: Path) -> None:
    """It runs the README's two commands and two more; each sees PATH and an empty HOME alone."""
    make = tmp_path / "make"
    make.write_text('#!/bin/sh\n{ echo "make $*"; env; ls -A "$HOME"; } >> "$0.log"\n')
    make.chmod(0o755)
    path = os.pathsep.join([str(tmp_path), os.environ["PATH"]])
    machine = {**os.environ, "PATH": path, "HOME": str(PROJECT), "PYTHONDONTWRITEBYTECODE": "1"}
    subprocess.run([PROJECT / ".ci" / "run"], env=machine, check=True)
    calls = re.split(r"^make ", make.with_name("make.log").read_text(), flags=re.M)[1:]
    assert [call.split("\n")[0] for call in calls] == ["demo", "test", "test-fast", "wheel ONE=1"]
    bits = {"OPENBLAS_CORETYPE=Haswell", "NUMBA_CPU_NAME=generic"}
    for call, more in zip(calls, (set(), set(), bits, set()), strict=True):
        of_the_shell = re.compile("PWD=|OLDPWD=|SHLVL=|_=")
        seen = {line for line in call.split("\n")[1:-1] if not of_the_shell.match(line)}
        home = {line for line in seen if line.startswith("HOME=")} - {f"HOME={PROJECT}"}
        assert len(home) == 1
        assert seen == home | more | {f"PATH={path}"}


def test_in_a_wheel_validation_is_a_part_of_robotball(tmp_path: Path) -> None:
    """No module of it, and not the command, asks for a package `validation`, which is anybody's."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=PROJECT, check=True, capture_output=True)
    with ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        files = {name: wheel.read(name).decode() for name in wheel.namelist()}
    assert {name.split("/")[0].split("-")[0] for name in files} == {"robotball"}
    (commands,) = (text for name, text in files.items() if name.endswith("entry_points.txt"))
    assert "robotball = robotball.validation.__main__:main" in commands
    inside = re.compile(r"robotball/validation/.*\.py$")
    modules = {name: text for name, text in files.items() if inside.match(name)}
    assert len(modules) > 50
    for name, text in modules.items():
        for node in ast.walk(ast.parse(text)):
            named: list[object] = []
            if isinstance(node, ast.Import):
                named += [each.name for each in node.names]
            elif isinstance(node, ast.ImportFrom | ast.Constant):
                named.append(node.module if isinstance(node, ast.ImportFrom) else node.value)
            assert not [each for each in named if OUTSIDE.match(str(each))], name
