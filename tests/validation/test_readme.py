"""What the README shows is what the program gives."""

import re
from pathlib import Path

import pytest

import robotball as rb
from validation import compare

README = (Path(__file__).parents[2] / "README.md").read_text()
ROWS = re.findall(r"^\| (\w+) \| (\w+) \| [\d.]+ ms \| (\S+) \|", README, flags=re.MULTILINE)


def test_the_readme_has_the_demos_table() -> None:
    """Two scenes at all presets."""
    expected = [(s, p) for s in ("fig12", "classical_regular") for p in rb.PRESETS]
    assert [(scene, preset) for scene, preset, _ in ROWS] == expected


@pytest.mark.parametrize(("scene", "preset", "shown"), ROWS)
def test_the_readmes_numbers_are_the_programs(scene: str, preset: str, shown: str) -> None:
    """To the digits shown; a third off at 1 ms and for the chattering naive model; or rounding."""
    error = compare(rb.load_scene(scene), preset).path_error
    tolerance = {"naive": 0.35, "accurate": 0.35, "adaptive": 2.0}.get(preset, 0.05)
    assert error == pytest.approx(float(shown), rel=tolerance)


def test_every_command_is_in_the_readme() -> None:
    """Nothing that a newcomer could run is hidden."""
    from typing import get_args

    from validation.cli import Command

    for command in get_args(Command):
        assert re.search(rf"\b{command.__name__.lower()}\b", README), command
