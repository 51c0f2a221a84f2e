"""The frame of studies: one set of rows makes the table, the CSV file and the names of files."""

import json
from operator import itemgetter
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from robotball.engines.mujoco import LABEL
from validation.study import Column, Row, Study, present, table_of

ROWS: list[Row] = [{"name": "a[b]", "error": 1.2e-3}, {"name": "c", "error": None}, {"name": "d"}]
COLUMNS = (Column("name", itemgetter("name"), words=True), Column("error", "error", "m"))


def test_a_study_s_files_and_table_hold_its_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Numbers in two digits, a dash for none, brackets as they are; the paths as written."""
    table = table_of(COLUMNS, ROWS)
    study = Study("x y", LABEL, ["study"], ROWS, {"runs": ROWS}, ["[bold]note[/]", table], Figure())
    picture, data, rows = (tmp_path / f"{study.stem('4s')}.{end}" for end in ("png", "json", "csv"))
    assert picture.name == "x-y-mujoco-study-4s.png"
    assert present(study, picture, data, rows) == [picture, data, rows]
    printed = capsys.readouterr().out
    lines = [line.split() for line in printed.splitlines()]
    assert lines == [
        ["note"], ["error"], ["name", "[m]"], [printed.splitlines()[3].strip()],
        ["a[b]", "1.2e-03"], ["c", "-"], ["d", "-"],
    ]  # fmt: skip
    assert rows.read_text() == "name,error\na[b],0.0012\nc,\nd,\n"
    assert json.loads(data.read_text())["runs"] == ROWS
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_nothing_is_written_that_has_no_path_or_picture(tmp_path: Path) -> None:
    """A study without a picture and without files to write leaves its folder empty."""
    study = Study("x", None, ["study"], ROWS, {"runs": ROWS})
    assert present(study, tmp_path / "a.png", None, None) == []
    assert list(tmp_path.iterdir()) == []


def test_a_study_without_rows_has_an_empty_table_of_files(tmp_path: Path) -> None:
    """As where no engine is there to run; it is no error."""
    present(Study("x", None, ["study"], [], {}), tmp_path / "a.png", None, tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().strip() == ""


def test_a_section_of_a_table_ends_where_its_key_changes() -> None:
    """And at the last row."""
    rows: list[Row] = [{"name": each, "error": None} for each in "aab"]
    ends = [row.end_section for row in table_of(COLUMNS, rows, section="name").rows]
    assert ends == [False, True, True]
