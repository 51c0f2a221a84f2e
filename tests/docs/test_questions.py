"""The page of questions prints what its commands print today."""

import re
import shlex
from pathlib import Path

import pytest

from tests.conftest import Robotball
from tests.imports import PROJECT

PAGE = (PROJECT / "docs" / "questions.md").read_text(encoding="utf-8")
SHOWN = re.findall(r"^## (.*?)\n.*?^```console\n\$ robotball (.*?)\n(.*?)^```", PAGE, re.M | re.S)
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
    assert len(SHOWN) == PAGE.count("\n## ") == 18


@pytest.mark.slow
@pytest.mark.parametrize(("question", "command", "answer"), SHOWN, ids=[q for q, *_ in SHOWN])
def test_a_question_is_answered_as_the_page_says(
    question: str, command: str, answer: str, robotball: Robotball, tmp_path: Path
) -> None:
    """Numbers up to a tenth, for other processors: those of slips grow from rounding.

    A command that several questions share runs once.
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
