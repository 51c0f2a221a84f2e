"""Scene files of which a test tells only what it is about, written or loaded."""

from pathlib import Path

import pytest

import robotball as rb
from tests.robotball.files.robot_tables import FRAME, HEAD, SHELL, START, Load
from tests.robotball.files.scene_texts import Write


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a scene file and returns its path."""

    def write(text: str) -> Path:
        path = tmp_path / "mine.toml"
        path.write_text(text)
        return path

    return write


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Loads a scene made of these tables; those that are not told are a whole robot's."""

    def load(
        head: str = "", shell: str = SHELL, frame: str = FRAME, rest: str = "", start: str = START
    ) -> rb.Scene:
        path = tmp_path / "mine.toml"
        path.write_text(HEAD + head + shell + frame + rest + start)
        return rb.load_scene(path)

    return load
