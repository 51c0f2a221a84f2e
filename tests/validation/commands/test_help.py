"""What the command says of itself: an example each, the values an option takes, its version."""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import pytest

import robotball as rb
from tests.conftest import Robotball
from tests.validation.examples import example
from validation.cli import COMMANDS
from validation.studies.ablation import CHOICES
from validation.studies.extreme_maps import MAPS
from validation.studies.portrait_maps import PLANES


@pytest.mark.parametrize("name", COMMANDS)
def test_a_commands_help_has_an_example_of_it(name: str, robotball: Robotball) -> None:
    """One line, after what the command does."""
    status, out, _ = robotball(name, "--help")
    assert status == 0
    assert re.findall(r"^Example: (.*)$", out, flags=re.MULTILINE) == [f"robotball {example(name)}"]
    assert name in example(name).split()


# Which of the parts of an example may say that the motions do not agree.
NAIVE = "compare fig12 --preset naive"


# Those of the studies' tests, which run their examples with `--duration`, `--json` and the like.
BY_THEIR_STUDY = {"convergence", "portraits", "tradeoff"}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*COMMANDS} - BY_THEIR_STUDY))
def test_the_example_runs_as_it_is_printed(name: str, robotball: Robotball) -> None:
    """In an empty folder, with status 0; a film needs an off-screen OpenGL."""
    if name == "video":
        pytest.importorskip("mediapy")
    for command in example(name).split("; robotball "):
        assert robotball(*shlex.split(command))[0] == (1 if command == NAIVE else 0), command


VALUES: dict[str, Sequence[str]] = {
    "compare --preset": [*rb.PRESETS],
    "section --preset": [*rb.PRESETS],
    "lyapunov --preset": [*rb.PRESETS],
    "model --preset": [*rb.PRESETS],
    "convergence --preset": [*rb.PRESETS],
    "convergence --without": [choice.name for choice in CHOICES],
    "extremes MAP...": [*MAPS],
    "portraits MAP...": [*PLANES],
}


@pytest.mark.parametrize("option", VALUES)
def test_the_help_lists_the_values_that_an_option_takes(option: str, robotball: Robotball) -> None:
    """All of them, beside it."""
    command, name = option.split(" ")
    out = robotball(command, "--help")[1]
    beside = re.search(rf"^  {re.escape(name)}(.*?)(^  -|^ +$)", out, re.MULTILINE | re.DOTALL)
    assert beside is not None
    words = beside[1]
    for value in VALUES[option]:
        assert re.search(rf"\b{value}\b", words), value


def test_the_commands_are_listed_with_a_sentence_each(robotball: Robotball) -> None:
    """And not with their examples, or with what is said further down."""
    out = robotball("--help")[1]
    assert all(f"• {name}" in out for name in COMMANDS)
    assert out.count("Example:") == 1


def test_the_version_is_robotballs_and_the_engines(robotball: Robotball) -> None:
    """On one line, as a report of an error needs them."""
    status, out, _ = robotball("--version")
    assert status == 0
    assert re.fullmatch(
        rf"robotball {version('robotball')} \(.*mujoco {version('mujoco')}.*\n", out
    )


@pytest.mark.slow
def test_python_runs_the_package_as_the_command(tmp_path: Path) -> None:
    """`python -m robotball` is `robotball`."""
    done = subprocess.run(
        [sys.executable, "-m", "robotball", "scenes"],
        cwd=tmp_path,
        env={**os.environ, "COLUMNS": "40"},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "fig12" in done.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_a_shell_can_complete_commands_and_options(shell: str, robotball: Robotball) -> None:
    """By what `--tyro-print-completion` prints."""
    status, out, _ = robotball("--tyro-print-completion", shell)
    assert status == 0
    assert all(word in out for word in (*COMMANDS, "--preset", "--accuracy"))


@pytest.mark.parametrize("command", ["scenes", "engines", "equilibria fig06 --longest 0"])
def test_a_table_is_whole_and_without_a_box(
    command: str, robotball: Robotball, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a terminal of forty columns: nothing is cut, and copied text has no lines in it."""
    monkeypatch.setenv("COLUMNS", "40")
    status, out, _ = robotball(*command.split())
    assert status == 0
    assert not re.search("[…│┃┏└]", out)
