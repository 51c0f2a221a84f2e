"""The command as a user runs it, in an empty folder."""

from collections.abc import Callable
from pathlib import Path

import pytest

from validation.cli import main

Robotball = Callable[..., tuple[int, str, str]]


@pytest.fixture
def robotball(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Robotball:
    """Runs the command in an empty folder: (exit status, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as leaving:
            main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        assert isinstance(leaving.value.code, int)
        return leaving.value.code, captured.out, captured.err

    return run
