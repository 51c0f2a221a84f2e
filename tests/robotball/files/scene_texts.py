"""Scene files of the catalog as texts, edited, and the line that refuses one."""

from collections.abc import Callable
from pathlib import Path

import pytest

import robotball as rb
from robotball.files.scene_file import CATALOG

FIG12 = (CATALOG / "fig12.toml").read_text()
CLASSICAL = (CATALOG / "classical_regular.toml").read_text()
SECTION = "section = { L = 3.6, l = 0.6, g = 0.0, f = 25.0 }"

Write = Callable[[str], Path]


def edited(old: str, new: str, text: str = FIG12) -> str:
    """The text with its one occurrence of `old` replaced."""
    assert text.count(old) == 1
    return text.replace(old, new)


def with_start(start: str, text: str = FIG12) -> str:
    return edited(SECTION, start, text)


def refusal(path: Path | str) -> str:
    """The message of the InputError that loading gives: one line, which names the file."""
    with pytest.raises(rb.InputError) as caught:
        rb.load_scene(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message
