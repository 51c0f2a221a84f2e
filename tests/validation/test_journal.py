"""The file of a sweep: whole lines, of one work and one set of versions, by one sweep at a time."""

import os
import resource
from collections import Counter
from pathlib import Path

import pytest

from robotball import InputError
from tests.validation.work import WORKERS, cells_of, lines_of, runs, square
from validation.sweeps import sweep


def test_the_file_may_hold_more_than_is_asked_for(tmp_path: Path) -> None:
    """A larger sweep runs only what it adds; the order is that of the cells asked for."""
    cells, file = cells_of(tmp_path, 6), tmp_path / "deep" / "sweep.jsonl"
    sweep(square, cells[:4], file, workers=WORKERS)
    results = sweep(square, cells[::-1], file, workers=WORKERS)
    assert [result.cell["x"] for result in results] == [5, 4, 3, 2, 1, 0]
    assert runs(tmp_path) == Counter(range(6))


@pytest.mark.parametrize(
    ("first", "message"),
    [
        ('{"work": "elsewhere.other", "versions": {}}', "is the record of elsewhere.other, not of"),
        ('{"work": "WORK", "versions": {"python": "2.7"}}', "was made with python 2.7, and this"),
        ("a,b\n1,2", "is not the record of a sweep: move it, or give another folder with --out"),
        ("somebody's only line", "is not the record of a sweep: move it, or give another folder"),
    ],
)
def test_a_file_of_something_else_is_refused_and_left_alone(
    tmp_path: Path, first: str, message: str
) -> None:
    """Another work's, another version's, no sweep's at all."""
    file = tmp_path / "sweep.jsonl"
    text = first.replace("WORK", f"{square.__module__}.square")
    text += "\n" if first.startswith("{") else ""
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        sweep(square, cells_of(tmp_path, 1), file)
    assert file.read_text() == text


def test_a_line_that_is_no_result_is_refused_by_its_number(tmp_path: Path) -> None:
    """A whole line that cannot be read is not a kill's doing, and is not dropped in silence."""
    file = tmp_path / "sweep.jsonl"
    sweep(square, [], file)
    with file.open("a") as damaged:
        damaged.write("{}\n")
    with pytest.raises(InputError, match=r"line 2 of .* is no result: delete that line"):
        sweep(square, [], file)


def test_a_file_that_is_being_written_is_refused(tmp_path: Path) -> None:
    """Two sweeps never write one file."""
    file = tmp_path / "sweep.jsonl"

    def meanwhile(done: float, what: str) -> None:
        with pytest.raises(
            InputError, match="is being written by another sweep: wait for it, or give"
        ):
            sweep(square, [], file)

    sweep(square, [], file, show=meanwhile)


def test_a_disk_that_fills_up_ends_the_sweep_in_one_line(tmp_path: Path) -> None:
    """What was written is whole, and when there is room again the rest is added."""
    cells, file = cells_of(tmp_path, 3), tmp_path / "sweep.jsonl"
    sweep(square, cells[:2], file, workers=WORKERS)
    written = lines_of(file)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    room = len(written[0]) // 2  # for a part of the next line
    resource.setrlimit(resource.RLIMIT_FSIZE, (file.stat().st_size + room, hard))
    try:
        with pytest.raises(InputError, match=r"sweep\.jsonl cannot be used: File too large"):
            sweep(square, cells[:3], file)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert lines_of(file)[:2] == written
    assert not file.read_text().endswith("\n")
    sweep(square, cells[:3], file)
    assert lines_of(file)[:2] == written
    assert len(lines_of(file)) == 3


def test_a_file_that_cannot_be_opened_is_refused(tmp_path: Path) -> None:
    """A name too long, a link to itself, a folder, a device, which would never end: a line each."""
    circle, device = tmp_path / "circle.jsonl", tmp_path / "sweep.jsonl"
    circle.symlink_to(circle)
    device.symlink_to(os.devnull)
    for file, message in (
        (tmp_path / ("x" * 256), "cannot be written: File name too long"),
        (circle, "cannot be written: Too many levels of symbolic links"),
        (tmp_path, "cannot be written: it is a folder"),
        (device, r"sweep\.jsonl is no regular file, as a sweep's record"),
    ):
        with pytest.raises(InputError, match=message):
            sweep(square, [], file)
