"""Shared fixtures: reproducible draws, and the command as a user runs it."""

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings

from robotball.view import gl

Robotball = Callable[..., tuple[int, str, str]]

# Terminal settings of the user must not change the output.
for variable in (
    "COLUMNS",
    "LINES",
    "FORCE_COLOR",
    "NO_COLOR",
    "TTY_COMPATIBLE",
    "TTY_INTERACTIVE",
):
    os.environ.pop(variable, None)

# Ignore engines that the user has installed; ENGINES_OF names a data folder with engines to test.
os.environ["XDG_DATA_HOME"] = os.environ.get("ENGINES_OF", os.devnull)

# Property tests draw the same examples on every machine and in every run.
settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")

# Show the values in failed assertions of these helper modules.
pytest.register_assert_rewrite(
    "tests.robotball.design.designs", "tests.robotball.scene_files.scene_texts"
)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--rewrite", action="store_true", help="write the catalogue of messages again")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark study cases as slow, so that `-m "not slow"` leaves them out."""
    for item in items:
        if item.get_closest_marker("study"):
            item.add_marker("slow")


@pytest.fixture
def linux() -> None:
    """Skip a test that needs /proc, the signals or the processor sets of Linux."""
    if sys.platform != "linux":
        pytest.skip("needs Linux")


@pytest.fixture
def screen() -> None:
    """Skip without off-screen OpenGL."""
    if gl.find_backend() is None:
        pytest.skip(gl.advice())


@pytest.fixture
def robotball(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Robotball:
    """Run the command in an empty folder: (exit status, standard output, standard error).

    Output of `--json` must have the keys of docs/json.md.
    """
    from tests.validation.json_keys import misfits  # late: most tests do not need it
    from validation.cli import main

    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["robotball", *map(str, arguments)])
        with pytest.raises(SystemExit) as leaving:
            main()
        captured = capsys.readouterr()
        status = leaving.value.code or 0
        assert isinstance(status, int)
        if status < 2 and "--json" in arguments:
            record = json.loads(Path(str(arguments[arguments.index("--json") + 1])).read_text())
            name = str(arguments[arguments[0] in ("study", "dynamics")])  # of two words the second
            many = name == "compare" and "--starts" in arguments
            assert misfits("compare --starts" if many else name, record) == set()
        return status, captured.out, captured.err

    return run
