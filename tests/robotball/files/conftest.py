"""Scene files of which a test tells only what it is about, written or loaded."""

from pathlib import Path

import pytest

import robotball as rb
from tests.robotball.files.scene_texts import Load, Write, robot


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a scene file and returns its path."""

    def write(text: str) -> Path:
        path = tmp_path / "mine.toml"
        path.write_text(text)
        return path

    return write


@pytest.fixture
def load(write: Write) -> Load:
    """Loads a scene made of these tables; those that are not given are a whole robot's."""
    return lambda *head, **tables: rb.load_scene(write(robot(*head, **tables)))
