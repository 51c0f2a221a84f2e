"""`make setup` installs all that is needed, on a Python that is supported."""

import os
import re
import subprocess
import tomllib
from importlib.util import find_spec
from pathlib import Path

from tests.imports import PROJECT

PYPROJECT = tomllib.loads((PROJECT / "pyproject.toml").read_text())


def test_every_python_from_3_11_to_3_14_is_taken() -> None:
    """By the package and by the Makefile alike."""
    (by_make,) = re.findall(r"^PYTHON_RANGE := (.*)$", (PROJECT / "Makefile").read_text(), re.M)
    assert by_make == PYPROJECT["project"]["requires-python"] == ">=3.11,<3.15"


def test_labmaze_is_left_out() -> None:
    """dm-control asks for it, has no use for it here, and no newer Python has a wheel of it."""
    lock = (PROJECT / "requirements.lock").read_text()
    assert re.findall(r"^labmaze.*(?=\\)", lock, re.M) == [
        "labmaze==1.0.6 ; sys_platform == 'never' "
    ]
    assert find_spec("labmaze") is None
    assert find_spec("dm_control.mjcf") is not None


def test_continuous_integration_knows_nothing_of_its_machine(tmp_path: Path) -> None:
    """It runs the README's two commands and two more; each sees PATH and an empty HOME alone."""
    make = tmp_path / "make"
    make.write_text('#!/bin/sh\n{ echo "make $*"; env; ls -A "$HOME"; } >> "$0.log"\n')
    make.chmod(0o755)
    path = os.pathsep.join([str(tmp_path), os.environ["PATH"]])
    machine = {**os.environ, "PATH": path, "HOME": str(PROJECT), "PYTHONDONTWRITEBYTECODE": "1"}
    subprocess.run([PROJECT / ".ci" / "run"], env=machine, check=True)
    calls = re.split(r"^make ", make.with_name("make.log").read_text(), flags=re.M)[1:]
    assert [call.split("\n")[0] for call in calls] == ["demo", "test", "test-fast", "wheel"]
    bits = {"OPENBLAS_CORETYPE=Haswell", "NUMBA_CPU_NAME=generic"}
    for call, more in zip(calls, (set(), set(), bits, set()), strict=True):
        of_the_shell = re.compile("PWD=|OLDPWD=|SHLVL=|_=")
        seen = {line for line in call.split("\n")[1:-1] if not of_the_shell.match(line)}
        home = {line for line in seen if line.startswith("HOME=")} - {f"HOME={PROJECT}"}
        assert len(home) == 1
        assert seen == home | more | {f"PATH={path}"}
