"""Sweeps: nothing done is lost, nothing is done twice, and one failure is one failure."""

import csv
from pathlib import Path
from typing import Any

import pytest

from robotball import InputError
from tests.validation.work import WORKERS, cells_of, failures, runs, square
from validation.output import progress_bar, write_rows
from validation.sweeps import Cell, Result, duration, rows_of, sweep


def test_a_cell_that_fails_is_recorded_and_stops_nothing(tmp_path: Path) -> None:
    """Whatever a cell does, its reason is one line, and the innocent beside it have records."""
    cells = cells_of(tmp_path, 12)
    for x, trouble in enumerate(("raises", "ends", "nan", "list", "spins"), start=2):
        cells[x]["trouble"] = trouble
    results = sweep(square, cells, tmp_path / "sweep.jsonl", workers=WORKERS, limit=0.2)
    assert [result.cell for result in results] == cells
    told = failures(results)
    told[4] = told[4].removesuffix(": nan")  # which Python 3.12 adds
    assert told == {
        2: "ValueError: no square",
        3: "ended its process with status 7",
        4: "ValueError: Out of range float values are not JSON compliant",
        5: "TypeError: a record must be a mapping, not list",
        6: "took longer than 0.2 s",
    }
    squares = [result.record and result.record["square"] for result in results]
    assert squares == [0, 1, *[None] * 5, *[x**2 for x in range(7, 12)]]
    ran = runs(tmp_path)
    assert sweep(square, cells, tmp_path / "sweep.jsonl", workers=WORKERS) == results
    assert runs(tmp_path) == ran  # failures are kept


@pytest.mark.parametrize(
    ("cells", "options", "message"),
    [
        ([{"x": 1}, {"x": 1}], {}, r'cells must be distinct, and {"x": 1} is there twice'),
        ([{"x": float("nan")}], {}, "a cell must be plain data, as JSON has it"),
        ([{"x": {1}}], {}, "a cell must be plain data, as JSON has it"),
        ([{"x": 1}], {"workers": 0}, "workers must be at least 1, not 0"),
        ([{"x": 1}], {"limit": 0.0}, "limit must be positive and finite, not 0 s"),
        ([{"x": 1}], {"workers": 2, "cluster": "tcp://a:1"}, "give one of workers and cluster"),
    ],
)
def test_unusable_input_is_refused(
    tmp_path: Path, cells: list[Cell], options: dict[str, Any], message: str
) -> None:
    """One line that says what is wrong."""
    with pytest.raises(InputError, match=message):
        sweep(square, cells, tmp_path / "sweep.jsonl", **options)


def test_progress_says_how_many_failed_and_the_time_left(tmp_path: Path) -> None:
    """Every result is told of, those that were there before at once."""
    cells, file = cells_of(tmp_path, 4), tmp_path / "sweep.jsonl"
    cells[0]["trouble"] = "raises"
    sweep(square, cells[:2], file, workers=WORKERS)
    told: list[tuple[float, str]] = []
    sweep(square, cells, file, workers=WORKERS, show=lambda *words: told.append(words))
    assert [done for done, _ in told] == [2, 3, 4]
    assert told[0][1] == "2 of 4 cells, 1 failed"
    assert told[1][1].startswith("3 of 4 cells, 1 failed, ")
    assert told[1][1].endswith(" s left")
    assert told[2][1] == "4 of 4 cells, 1 failed"


def test_time_left_has_a_unit_that_suits_it() -> None:
    """Seconds, minutes, hours."""
    assert [duration(s) for s in (4.4, 89, 720, 9000)] == ["4 s", "89 s", "12 min", "2.5 h"]


def test_long_work_leaves_a_line_now_and_then_in_a_log(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where standard error is no terminal, the first line comes after the interval, not before."""
    clock = iter((0.0, 29.0, 31.0, 31.0, 45.0))
    monkeypatch.setattr("validation.output.time.monotonic", lambda: next(clock))
    with progress_bar(8) as show:
        for done in (1, 2, 3):
            show(done, f"{done} of 8 cells")
    assert capsys.readouterr().err == "25%: 2 of 8 cells\n"


def test_a_table_has_a_row_a_cell(tmp_path: Path) -> None:
    """Cells' columns, then records', failure last; what has no number is empty."""
    results = [
        Result({"x": 1, "y": [1, 2]}, {"z": 0.1, "x": 9}, None),
        Result({"x": 2, "y": None}, None, "ValueError: a, b"),
        Result({"x": 3, "y": {"a": "é"}}, {"z": None, "more": True}, None),
    ]
    write_rows(tmp_path / "table.csv", rows_of(results))
    with (tmp_path / "table.csv").open() as table:
        assert list(csv.reader(table)) == [
            ["x", "y", "z", "more", "failure"],
            ["1", "[1, 2]", "0.1", "", ""],
            ["2", "", "", "", "ValueError: a, b"],
            ["3", '{"a": "é"}', "", "True", ""],
        ]
