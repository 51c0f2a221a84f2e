"""Pages show what their commands print today."""

import re
import shlex
from pathlib import Path

import pytest

from tests.conftest import Robotball
from tests.imports import PROJECT

PAGES = {
    name: (PROJECT / "docs" / f"{name}.md").read_text(encoding="utf-8")
    for name in ("check", "controllers", "fitting", "questions", "trajectories")
}
SHOWN = [
    (name, command, answer)
    for name, page in PAGES.items()
    for command, answer in re.findall(r"^```console\n\$ robotball (.*)\n([^`]*)^```", page, re.M)
]
NUMBER = r"(-?\d+(?:\.\d+)?(?:e[-+]\d+)?)"
OUTPUTS: dict[str, str] = {}


def pattern(line: str) -> str:
    """Return a pattern of a shown line: a group for each number, any words for `…`."""
    parts = re.split(rf"{NUMBER}|(…)|(\s+)", line)
    kinds = {"…": ".*", " ": r"\s+"}
    return "".join(
        NUMBER if re.fullmatch(NUMBER, part) else kinds.get(part) or re.escape(part)
        for part in parts
        if part
    )


def test_every_question_has_a_command_and_its_answer() -> None:
    shown = [answer for name, _, answer in SHOWN if name == "questions" and answer]
    assert len(shown) == PAGES["questions"].count("\n## ") == 20


@pytest.mark.slow
@pytest.mark.parametrize(("page", "command", "answer"), SHOWN)
def test_a_command_prints_what_the_page_shows(
    page: str, command: str, answer: str, robotball: Robotball, tmp_path: Path
) -> None:
    """Numbers up to a tenth, for other processors: those of slips grow from rounding.

    A command that is shown several times runs once.
    """
    for folder in ("docs", "examples"):
        (tmp_path / folder).symlink_to(PROJECT / folder)
    if command not in OUTPUTS:
        _, said, warned = robotball(*shlex.split(command))
        OUTPUTS[command] = said + warned
    output = OUTPUTS[command]
    for line in answer.splitlines():
        found = re.search(pattern(line), output)
        assert found is not None, (line, output)
        numbers = [float(text) for text in re.findall(NUMBER, line)]
        assert [*map(float, found.groups())] == pytest.approx(numbers, rel=0.1), line
