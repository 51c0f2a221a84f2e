"""Compiled code is kept whole, in a folder of its user's own, or compiled anew."""

import os
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robotball.engines import kept
from robotball.errors import SceneWarning


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of one's own, and an empty temporary folder; warnings begin anew."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    kept._warn_once.cache_clear()
    return tmp_path / "cache" / "robotball"


def compiled(source: str = "2 x", **options: Any) -> tuple[float, int]:
    """What a compiled function makes of 3, and how often it was compiled and not loaded."""
    double: Any = kept.compiled_from(source, "f8(f8)", **options)(lambda x: 2.0 * x)
    return double(3.0), double.stats.cache_misses.total()


def test_what_is_kept_is_loaded(home: Path) -> None:
    """The second time nothing is compiled, unless the source is another, or an option."""
    assert [compiled(), compiled(), compiled("x + x")] == [(6.0, 1), (6.0, 0), (6.0, 1)]
    loose: dict[str, Any] = {"fastmath": {"nsz", "contract"}}
    assert [compiled(**loose), compiled(**loose)] == [(6.0, 1), (6.0, 0)]
    assert len(list(home.iterdir())) == 3


def flipped(content: bytes) -> bytes:
    """One bit in the middle is another: of machine code, most likely."""
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda content: b"",
    "a byte": lambda content: content[:1],
    "half": lambda content: content[: len(content) // 2],
    "one bit": flipped,
    "something else": lambda content: b"no code " * 1000,
}


@pytest.mark.parametrize("damaged", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_file_is_replaced(home: Path, damaged: Callable[[bytes], bytes]) -> None:
    """Compiled anew, with the right result, and loaded the next time."""
    compiled()
    (file,) = home.iterdir()
    file.write_bytes(damaged(file.read_bytes()))
    assert [compiled(), compiled()] == [(6.0, 1), (6.0, 0)]


def test_a_full_disk_is_a_warning(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The code works; it is only not kept, and no half of it either."""

    def full(path: Path, data: bytes) -> int:
        path.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.warns(SceneWarning, match="compiled code is not kept.*No space left on device"):
        assert compiled() == (6.0, 1)
    assert list(home.iterdir()) == []


def closed(home: Path) -> Path:
    """The temporary folder that stands in for a home cache that cannot be made."""
    home.parent.write_text("in its place")
    return Path(tempfile.gettempdir()) / f"robotball-{os.getuid()}"


def test_without_a_home_a_temporary_folder_is_closed_to_others(home: Path) -> None:
    """It is made with mode 700, and used."""
    folder = closed(home)
    assert kept.cache_folder() == folder
    assert folder.stat().st_mode & 0o777 == 0o700
    assert [compiled(), compiled()] == [(6.0, 1), (6.0, 0)]


@pytest.mark.parametrize("mode", [0o777, 0o770])
def test_a_folder_that_others_may_write_is_not_used(home: Path, mode: int) -> None:
    """What is loaded from it would be run; nothing is kept then, and a warning says so."""
    folder = closed(home)
    folder.mkdir()
    folder.chmod(mode)
    with pytest.warns(SceneWarning, match="belongs to this user alone; set XDG_CACHE_HOME"):
        assert [compiled(), compiled()] == [(6.0, 1), (6.0, 1)]
    assert list(folder.iterdir()) == []


def test_a_folder_of_another_user_is_not_used(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither at home nor under the temporary folder, whatever its mode."""
    home.mkdir(parents=True, mode=0o700)
    stranger = os.getuid() + 1
    monkeypatch.setattr(os, "getuid", lambda: stranger)
    closed_to_us = Path(tempfile.gettempdir()) / f"robotball-{stranger}"
    closed_to_us.mkdir(mode=0o700)
    with pytest.warns(SceneWarning, match="belongs to this user alone"):
        assert kept.cache_folder() is None


def test_a_warning_comes_once(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many functions are compiled."""
    closed(home).mkdir(mode=0o777)
    closed_folder = Path(tempfile.gettempdir()) / f"robotball-{os.getuid()}"
    closed_folder.chmod(0o777)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        compiled(), compiled("x + x")
    assert [each.category for each in caught] == [SceneWarning]
