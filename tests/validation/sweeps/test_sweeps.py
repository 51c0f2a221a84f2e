"""Sweeps: nothing done is lost, nothing is done twice, and one failure is one failure."""

import csv
import ctypes
import json
import multiprocessing
import os
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from robotball import InputError
from validation.progress import progress_bar
from validation.sweeps import Cell, Result, sweep, write_table
from validation.sweeps.progress import duration

WORKERS = 2


def square(cell: Cell) -> Mapping[str, Any]:
    """A cell's own square, after the trouble that the cell asks for."""
    with Path(cell["ran"]).open("a") as ran:
        ran.write(f"{cell['x']}\n")
    match cell.get("trouble"):
        case "raises":
            raise ValueError("no\n  square")
        case "ends":
            os._exit(7)
        case "spins":
            while True:
                pass
        case "hangs":  # in compiled code, with the interpreter's lock kept
            ctypes.PyDLL(None).sleep(60)
        case "nan":
            return {"square": float("nan")}
        case "list":
            return [1]  # type: ignore[return-value]
    time.sleep(cell.get("seconds", 0.0))
    return {"square": cell["x"] ** 2, "none": None, "parts": [cell["x"], 0.1]}


def other(cell: Cell) -> Mapping[str, Any]:
    """Another work."""
    return {}


def cells_of(folder: Path, count: int, **more: Any) -> list[dict[str, Any]]:
    """Cells for `square`, which writes down what it runs in this folder."""
    return [{"x": x, "ran": str(folder / "ran"), **more} for x in range(count)]


def runs(folder: Path) -> Counter[int]:
    """How often each cell was run."""
    ran = folder / "ran"
    return Counter(map(int, ran.read_text().split()) if ran.exists() else [])


def failures(results: list[Result]) -> dict[int, str]:
    return {result.cell["x"]: result.failure for result in results if result.failure}


def to_be_killed(folder: Path) -> None:
    sweep(square, cells_of(folder, 40, seconds=0.02), folder / "sweep.jsonl", workers=WORKERS)


def lines_of(file: Path) -> list[str]:
    return file.read_text().splitlines()[1:] if file.exists() else []


@pytest.mark.slow
def test_a_killed_sweep_goes_on_and_ends_with_the_identical_table(tmp_path: Path) -> None:
    """SIGKILL at any moment costs the cells that were running, and no result is made twice."""
    file, moments = tmp_path / "sweep.jsonl", random.Random(4)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    before: dict[int, int] = {}
    for enough in (1, 12, 25):
        process = context.Process(target=to_be_killed, args=(tmp_path,))
        process.start()
        while len(lines_of(file)) < enough:
            assert process.is_alive()
            time.sleep(0.001)
        time.sleep(moments.uniform(0.0, 0.05))
        process.kill()
        process.join()
        ran = runs(tmp_path)
        assert all(ran[x] == times for x, times in before.items())
        before = {x: ran[x] for x in (json.loads(line)["cell"]["x"] for line in lines_of(file))}
    assert 25 <= len(before) < 40
    with file.open("a") as torn:
        torn.write('{"cell": {"x": 39, "ra')
    cells = cells_of(tmp_path, 40, seconds=0.02)
    write_table(tmp_path / "killed.csv", sweep(square, cells, file, workers=WORKERS))
    ran = runs(tmp_path)
    assert all(ran[x] == times for x, times in before.items())
    # A death costs at most what was handed in: two cells a worker.
    assert 40 <= ran.total() <= 40 + 3 * 2 * WORKERS
    write_table(tmp_path / "whole.csv", sweep(square, cells, tmp_path / "b", workers=WORKERS))
    assert (tmp_path / "killed.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()


@pytest.mark.slow
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
        3: "ended its process: EXIT(7)",
        4: "ValueError: Out of range float values are not JSON compliant",
        5: "TypeError: a record must be a mapping, not list",
        6: "took longer than 0.2 s",
    }
    squares = [result.record and result.record["square"] for result in results]
    assert squares == [0, 1, *[None] * 5, *[x**2 for x in range(7, 12)]]
    ran = runs(tmp_path)
    assert sweep(square, cells, tmp_path / "sweep.jsonl", workers=WORKERS) == results
    assert runs(tmp_path) == ran  # failures are kept


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
        ("a,b\n1,2", "is not the record of a sweep: name another file"),
        ("somebody's only line", "is not the record of a sweep: name another file"),
    ],
)
def test_a_file_of_something_else_is_refused_and_left_alone(
    tmp_path: Path, first: str, message: str
) -> None:
    """Another work's, another version's, no sweep's at all."""
    file = tmp_path / "sweep.jsonl"
    text = first.replace("WORK", f"{__name__}.square")
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
        with pytest.raises(InputError, match="is being written by another sweep"):
            sweep(square, [], file)

    sweep(square, [], file, show=meanwhile)


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


@contextmanager
def two_dask_workers() -> Iterator[str]:
    """The address of a cluster where no cell may kill more than one worker."""
    dask = pytest.importorskip("dask")
    distributed = pytest.importorskip("distributed")
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
    ):
        yield cluster.scheduler_address


@pytest.mark.slow
def test_a_cluster_gives_the_same_results(tmp_path: Path) -> None:
    """Records and failures by dask are those by the local cores, resumed ones too."""
    cells, file = cells_of(tmp_path, 12), tmp_path / "cluster.jsonl"
    cells[2]["trouble"], cells[7]["trouble"] = "raises", "spins"
    local = sweep(square, cells, tmp_path / "local.jsonl", workers=WORKERS, limit=0.5)
    assert failures(local) == {2: "ValueError: no square", 7: "took longer than 0.5 s"}
    fatal = [{"x": 12, "ran": str(tmp_path / "ran"), "trouble": "ends"}]
    with two_dask_workers() as address:
        sweep(square, cells[:3], file, cluster=address)
        results = sweep(square, cells + fatal, file, cluster=address, limit=0.5)
    assert results[:12] == local
    assert results[12].failure == "ended its process"


@pytest.mark.slow
def test_ctrl_c_leaves_the_file_whole(tmp_path: Path) -> None:
    """What was done before is there, the rest is done later."""
    cells, file = cells_of(tmp_path, 8), tmp_path / "sweep.jsonl"

    def interrupt(done: float, what: str) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(square, cells, file, workers=WORKERS, show=interrupt)
    assert len(lines_of(file)) == 3
    assert file.read_text().endswith("\n")
    assert not failures(sweep(square, cells, file, workers=1))
    assert runs(tmp_path).total() <= 8 + 2 * WORKERS


@pytest.mark.slow
def test_compiled_code_that_does_not_return_is_given_up(tmp_path: Path) -> None:
    """Its process is ended, which one worker survives too, as it is not this process."""
    cells = cells_of(tmp_path, 2)
    cells[0]["trouble"] = "hangs"
    results = sweep(square, cells, tmp_path / "sweep.jsonl", workers=1, limit=0.2)
    assert failures(results) == {0: "took longer than 0.2 s"}


def test_time_left_has_a_unit_that_suits_it() -> None:
    """Seconds, minutes, hours."""
    assert [duration(s) for s in (4.4, 89, 720, 9000)] == ["4 s", "89 s", "12 min", "2.5 h"]


def test_long_work_leaves_a_line_now_and_then_in_a_log(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where standard error is no terminal, the first line comes after the interval, not before."""
    clock = iter((0.0, 29.0, 31.0, 31.0, 45.0))
    monkeypatch.setattr("validation.progress.time.monotonic", lambda: next(clock))
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
    write_table(tmp_path / "table.csv", results)
    with (tmp_path / "table.csv").open() as table:
        assert list(csv.reader(table)) == [
            ["x", "y", "z", "more", "failure"],
            ["1", "[1, 2]", "0.1", "", ""],
            ["2", "", "", "", "ValueError: a, b"],
            ["3", '{"a": "é"}', "", "True", ""],
        ]


@pytest.mark.slow
def test_a_cluster_that_does_not_answer_is_refused(tmp_path: Path) -> None:
    """One line within seconds, and no trouble later."""
    with pytest.raises(InputError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:1: "):
        sweep(square, cells_of(tmp_path, 1), tmp_path / "sweep", cluster="tcp://127.0.0.1:1")


def test_without_dask_a_cluster_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The line says how to install the extra."""
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'robotball\[cluster\]'"):
        sweep(square, cells_of(tmp_path, 1), tmp_path / "sweep", cluster="tcp://127.0.0.1:1")
