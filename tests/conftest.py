"""Property tests draw the same examples on every machine and at every run."""

import pytest
from hypothesis import settings

from robotball.film import gl

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")

# A check in these that fails shows its values, as one in a test does.
pytest.register_assert_rewrite(
    "tests.robotball.designs",
    "tests.robotball.files.robot_tables",
    "tests.robotball.files.scene_texts",
)


@pytest.fixture
def screen() -> None:
    """Skips what draws where there is no off-screen OpenGL."""
    if gl.find_backend() is None:
        pytest.skip(gl.advice())
