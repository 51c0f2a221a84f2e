"""Scene files of which a test tells only what it is about, written."""

from pathlib import Path

import pytest

from tests.robotball.files.scene_texts import Write


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a scene file and returns its path."""

    def write(text: str) -> Path:
        path = tmp_path / "mine.toml"
        path.write_text(text)
        return path

    return write
