"""Files that are whole or not there, and never in the place of what is no regular file."""

import os
import stat
import threading
from pathlib import Path

import pytest

import robotball as rb
from robotball.files.replacing import replacing
from validation.output import writable_file


def write(path: Path, text: str) -> None:
    with replacing(writable_file(path)) as temporary:
        temporary.write_text(text)


@pytest.fixture
def fifo(tmp_path: Path) -> Path:
    path = tmp_path / "fifo"
    os.mkfifo(path)
    return path


def test_a_pipe_is_written_into_and_stays_one(fifo: Path) -> None:
    """Its reader gets all of the text; the same holds for a device."""
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(fifo.read_text()), daemon=True)
    reader.start()
    write(fifo, "whole")
    reader.join(10)
    assert read == ["whole"]
    assert stat.S_ISFIFO(fifo.stat().st_mode)
    assert list(fifo.parent.iterdir()) == [fifo]


@pytest.mark.parametrize("there", [True, False])
def test_a_link_stays_and_what_it_names_is_replaced(tmp_path: Path, there: bool) -> None:
    """Whether or not the file is there already; no fragment stays in either folder."""
    (tmp_path / "far").mkdir()
    target, link = tmp_path / "far" / "real.json", tmp_path / "link.json"
    link.symlink_to("far/real.json")
    if there:
        target.write_text("old")
    write(link, "new")
    assert link.is_symlink()
    assert (target.is_symlink(), target.read_text()) == (False, "new")
    assert [path.name for path in target.parent.iterdir()] == ["real.json"]


def test_links_in_a_circle_are_refused(tmp_path: Path) -> None:
    """By an InputError, before anything is written."""
    link = tmp_path / "link"
    link.symlink_to(link)
    with pytest.raises(rb.InputError, match="Too many levels of symbolic links"):
        write(link, "new")


@pytest.mark.parametrize("length", [254, 255])
def test_a_name_may_be_as_long_as_the_system_allows(tmp_path: Path, length: int) -> None:
    """The temporary one beside it is shorter."""
    path = tmp_path / ("n" * (length - 5) + ".json")
    write(path, "new")
    assert path.read_text() == "new"


def test_no_two_writers_share_a_temporary_file(tmp_path: Path) -> None:
    """Processes of two machines may have the same number."""
    path = tmp_path / "a.json"
    with replacing(path) as first, replacing(path) as second:
        assert first != second
        first.write_text("first")
        second.write_text("second")
    assert path.read_text() == "first"
    assert list(tmp_path.iterdir()) == [path]
