"""Every command and every piece of Python that README and docs print runs as it is printed.

A command that takes minutes is run in a short form; as printed it is run by `make gallery`, or by
whoever repeats its study.
"""

import re
from dataclasses import replace
from pathlib import Path

import pytest

import robotball as rb
from tests.conftest import Robotball
from tests.validation.examples import example
from tests.validation.test_readme import DOCS, PROJECT, README
from validation.cli import parse

# After four spaces, in a code span, or in a scene file's first line; a comment is cut off. One with
# a word in capitals or in brackets stands for others: the examples of `--help` are those.
COMMAND = r"(?:^ {4}|`)(?:\.venv/bin/)?robotball ([^`\n#>|]+)"
ALONE = {"demo", "scenes", "engines", "paper", "attractors", "extremes", "portraits", "figures"}
PRINTED = sorted(
    {
        command
        for text in (README, *DOCS.values())
        for found in re.findall(COMMAND, text, re.MULTILINE)
        if not re.search("[A-Z…\\[]{2}|N…", command := found.strip().partition("  ")[0])
        and (" " in command or command in ALONE)
    }
)
# Long ones, of which the example in `--help` is a short form; test_help.py runs it as it is.
BY_EXAMPLE = {
    "ablation fig12",
    "attractors",
    "convergence fig12",
    "demo",
    "extremes",
    "lyapunov fig14",
    "paper",
    "tradeoff fig12",
}
# Others that are long, and what is run in their place.
SHORT = {
    "engines fig12 classical_regular wobbling_drive classical_chaotic": (
        "engines wobbling_drive --only mujoco --quick --duration 0.2 --workers 1"
    ),
    "extremes --random 500": "extremes --random 3",
    "extremes duration": "extremes duration --quick --workers 1",
}
NOT_RUN = {  # and why
    "--tyro-print-completion bash": "test_help.py tries what it prints",
    **dict.fromkeys(
        (
            "engines --install drake,bullet,exudyn,pinocchio,dart,physx,newton,genesis",
            "engines --install mujoco-warp,mjx,mujoco-3.17",
        ),
        "it needs a network, and a while",
    ),
}


@pytest.mark.parametrize("arguments", PRINTED)
def test_a_printed_command_is_one(arguments: str) -> None:
    """Its name, its options and their values are known; `robotball X --help` has one that runs."""
    if "--tyro-print-completion" not in arguments:
        assert parse(arguments.split())


def test_there_are_commands_to_try() -> None:
    """The pattern finds those of README and docs, and each that is left out is one of them."""
    assert {"demo", "convergence fig12", "report fig12", "export fig12 --to ball"} <= set(PRINTED)
    assert {*BY_EXAMPLE, *SHORT, *NOT_RUN} <= set(PRINTED)


@pytest.mark.parametrize("command", sorted(BY_EXAMPLE))
def test_the_example_of_a_long_command_is_a_short_form_of_it(command: str) -> None:
    """The same command on the same scene, with options or names after it."""
    words = command.split()
    assert example(words[0]).split()[: len(words)] == words


@pytest.fixture
def folder(robotball: Robotball, tmp_path: Path) -> Path:
    """Where a reader of the pages would stand, with the examples."""
    (tmp_path / "examples").symlink_to(PROJECT / "examples")
    (tmp_path / "my_robot.toml").symlink_to(PROJECT / "examples" / "my_robot.toml")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("command", sorted({*PRINTED} - BY_EXAMPLE - {*NOT_RUN}))
def test_a_printed_command_runs(command: str, robotball: Robotball, folder: Path) -> None:
    """As printed, or in the form of SHORT, with status 0."""
    scene, times = rb.load_scene("fig12"), rb.sample_times(1.2)
    for name, step in (("a", 4e-3), ("b", 2e-3), ("c", 1e-3), ("run", 2e-2)):
        if f" {name}.csv" in command:
            settings = replace(rb.preset("fast"), timestep=step)
            rb.simulate(scene, times, settings).save(folder / f"{name}.csv")
    status, out, error = robotball(*SHORT.get(command, command).split())
    assert status == 0, error
    assert out


PYTHON = [
    pytest.param(text, id=f"{name}-{i}")
    for name, page in DOCS.items()
    for i, text in enumerate(re.findall(r"```python\n(.*?)```", page, re.DOTALL))
]


@pytest.mark.slow
@pytest.mark.parametrize("text", PYTHON)
def test_printed_python_runs(text: str, folder: Path) -> None:
    """As it is, in a folder with a file to judge."""
    scene = rb.load_scene("fig12")
    rb.integrate(scene, rb.sample_times(0.4)).save(folder / "run.csv")
    exec(text, {})
