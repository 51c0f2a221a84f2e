"""Sweeps lose no result, repeat no cell, and survive the failure of a cell.

They survive processes that end, hang or stop. A journal has whole
lines of one work and one set of versions, and one sweep writes it at a time.
"""

import fcntl
import json
import multiprocessing
import os
import random
import resource
import signal
import sys
import time
import types
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from robotball import InputError
from tests.messages import naming, unnamed
from tests.validation.work import WORKERS, cells_of, failures, lines_of, runs, square
from validation.output import write_rows
from validation.sweeps import Result, duration, rows_of, sweep

linux = pytest.mark.usefixtures("linux")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Return the path of a journal."""
    return tmp_path / "sweep.jsonl"


def table(path: Path, results: list[Result]) -> bytes:
    """Write results as CSV and return the text."""
    write_rows(path, rows_of(results))
    return path.read_bytes()


# Cells -----------------------------------------------------------------------------------------


TROUBLES = ("raises", "ends", "nan", "list", "spins", "hangs")


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_a_cell_that_fails_is_recorded_and_stops_nothing(tmp_path: Path, workers: int) -> None:
    """A failure has its reason in one line, and the other cells have records.

    Progress counts the results in the journal first. Failures are kept in the journal, which may
    have results of other cells.
    """
    cells = cells_of(tmp_path, 10, dict(enumerate(TROUBLES, start=2)))
    file = tmp_path / "deep" / "sweep.jsonl"
    shown: list[tuple[float, str]] = []
    options: dict[str, Any] = {"workers": workers, "show": lambda *words: shown.append(words)}
    sweep(square, cells[:2], file, workers=workers)
    results = sweep(square, cells, file, limit=1.0, **options)
    assert [result.cell for result in results] == cells
    reasons = failures(results)
    facts = {
        2: "ValueError no~square",
        3: "process 7",
        5: "TypeError mapping list",
        6: "1~s",
        7: "1~s",
    }
    assert sorted(reasons) == list(facts)
    assert [unnamed(facts[x], reason) for x, reason in reasons.items()] == [[]] * 5
    assert {result.cell["x"] for result in results if result.outlasted} == {6, 7}
    squares = [result.record and result.record["square"] for result in results]
    assert squares == [0, 1, *[None] * 6, 64, 81]
    assert results[4].record == {"square": None}  # it was NaN
    assert [done for done, _ in shown] == [*range(2, 11)]
    assert unnamed("2 10", shown[0][1]) == []
    assert unnamed("10 5 failed", shown[-1][1]) == []
    assert all(words.endswith((" s left", " min left")) for _, words in shown[1:-1])
    ran = runs(tmp_path)
    assert sweep(square, cells[:4:-1], file, **options) == results[:4:-1]
    assert shown[-1][0] == 5
    assert unnamed("5 3 failed", shown[-1][1]) == []
    assert runs(tmp_path) == ran
    assert all(
        ran[x] == 1 for x in range(10) if x != 3
    )  # x = 3 killed its process and was run twice


@pytest.mark.parametrize(
    ("numbers", "options", "facts"),
    [
        ((1, 1), {}, 'distinct {"x":~1}'),
        ((float("nan"),), {}, "cell JSON"),
        (({1},), {}, "cell JSON"),
        ((1,), {"workers": 0}, "workers 1 0"),
        ((1,), {"limit": 0.0}, "limit 0~s"),
    ],
)
def test_unusable_input_is_refused(
    file: Path, numbers: tuple[Any, ...], options: dict[str, Any], facts: str
) -> None:
    """The message names the wrong value."""
    with pytest.raises(InputError, match=naming(facts)):
        sweep(square, [{"x": x} for x in numbers], file, **options)


def test_a_table_has_a_row_for_each_cell(tmp_path: Path) -> None:
    """Columns of cells come first, then columns of records, then the failure.

    The remaining time is in seconds, minutes or hours.
    """
    shown = [duration(s) for s in (4.4, 89, 90, 720, 5399, 5400, 9000)]
    assert shown == ["4 s", "89 s", "2 min", "12 min", "90 min", "1.5 h", "2.5 h"]
    results = [
        Result({"x": 1, "y": [1, 2]}, {"z": 0.1, "x": 9}, None),
        Result({"x": 2, "y": None}, None, "ValueError: a, b"),
        Result({"x": 3, "y": {"a": "é"}}, {"z": None, "more": True}, None),
    ]
    assert table(tmp_path / "table.csv", results).decode().splitlines() == [
        "x,y,z,more,failure",
        '1,"[1, 2]",0.1,,',
        '2,,,,"ValueError: a, b"',
        '3,"{""a"": ""é""}",,True,',
    ]


# The file --------------------------------------------------------------------------------------

DEEP = "[" * 100_000 + "]" * 100_000
DAMAGED = (
    "{}",
    DEEP,
    '{"cell": 5, "record": null, "failure": null}',
    '{"cell": {}, "record": "x", "failure": null}',
    '{"cell": {}, "record": {}, "failure": 1}',
)
HEADER = '{"work": "tests.validation.work.square", "versions": {"python": "2.7"}}\n'


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        ('{"work": "a.b", "versions": {}}\n', "a.b tests.validation.work.square"),
        (HEADER, "python~2.7"),
        ("a,b\n1,2", "journal sweep --out"),
        ("somebody's only line", "journal sweep"),
        ('{"work": ' + DEEP + "}\n", "journal sweep"),
        *((line, "line~2") for line in DAMAGED),
    ],
)
def test_a_file_of_something_else_is_refused_and_left_alone(
    file: Path, text: str, facts: str
) -> None:
    """Cases: another work, other versions, not a journal, and an invalid line.

    A killed sweep leaves incomplete lines only, so an invalid whole line is not dropped.
    """
    if text in DAMAGED:
        sweep(square, [], file)
        text = f"{file.read_text()}{text}\n"
    file.write_text(text)
    with pytest.raises(InputError, match=naming(facts)):
        sweep(square, [], file)
    assert file.read_text() == text


def test_a_file_that_another_sweep_writes_and_a_device_are_refused(file: Path) -> None:
    """Two sweeps must not write the same file, and a device has no end."""

    def meanwhile(done: float, message: str) -> None:
        with pytest.raises(InputError, match=naming("another sweep")):
            sweep(square, [], file)

    sweep(square, [], file, show=meanwhile)
    file.unlink()
    file.symlink_to(os.devnull)
    with pytest.raises(InputError, match=naming("sweep.jsonl regular~file")):
        sweep(square, [], file)


def test_a_disk_that_fills_up_ends_the_sweep_in_one_line(tmp_path: Path, file: Path) -> None:
    """Written lines are complete, and the sweep can be continued later."""
    cells = cells_of(tmp_path, 3)
    sweep(square, cells[:2], file, workers=WORKERS)
    written = lines_of(file)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    room = len(written[0]) // 2  # room for a part of the next line
    resource.setrlimit(resource.RLIMIT_FSIZE, (file.stat().st_size + room, hard))
    try:
        with pytest.raises(InputError, match=naming("sweep.jsonl File~too~large")):
            sweep(square, cells, file)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not file.read_text().endswith("\n")
    sweep(square, cells, file)
    assert lines_of(file)[:2] == written
    assert len(lines_of(file)) == 3


# Processes -------------------------------------------------------------------------------------

FORKSERVER = multiprocessing.get_context("forkserver")


def sweeping(file: Path, cells: list[dict[str, Any]], limit: float | None) -> None:
    sweep(square, cells, file, workers=WORKERS, limit=limit)


def started(file: Path, cells: list[dict[str, Any]], limit: float | None = None) -> Any:
    """Start a sweep in a process, with the fork server that sweeps use."""
    sweep(dict, [{}], file.with_name("first.jsonl"))  # starts the server
    process = FORKSERVER.Process(target=sweeping, args=(file, cells, limit))
    process.start()
    return process


def within(seconds: float, done: Callable[[], bool]) -> bool:
    """Wait for a condition for some seconds, and return whether it was met."""
    end = time.monotonic() + seconds
    while not (met := done()) and time.monotonic() < end:
        time.sleep(0.001)
    return met


@pytest.mark.slow
def test_a_killed_sweep_continues_and_gives_the_same_table(tmp_path: Path, file: Path) -> None:
    """SIGKILL loses only the running cells, and no result is computed twice."""
    cells, moments = cells_of(tmp_path, 40, seconds=0.02), random.Random(4)
    before: dict[int, int] = {}
    for enough in (1, 20):
        process = started(file, cells)
        assert within(60, lambda least=enough: len(lines_of(file)) >= least)  # type: ignore[misc]
        time.sleep(moments.uniform(0.0, 0.05))
        process.kill()
        process.join()
        ran = runs(tmp_path)
        assert all(ran[x] == times for x, times in before.items())
        before = {x: ran[x] for x in (json.loads(line)["cell"]["x"] for line in lines_of(file))}
    assert 20 <= len(before) < 40
    with file.open("a") as torn:
        torn.write('{"cell": {"x": 39, "ra')
    killed = table(tmp_path / "killed.csv", sweep(square, cells, file, workers=WORKERS))
    ran = runs(tmp_path)
    assert all(ran[x] == times for x, times in before.items())
    # A killed sweep loses at most the submitted cells, two per worker.
    assert 40 <= ran.total() <= 40 + 2 * 2 * WORKERS
    whole = sweep(square, cells, tmp_path / "whole.jsonl", workers=WORKERS)
    assert killed == table(tmp_path / "whole.csv", whole)


def test_killed_workers_cost_nothing(tmp_path: Path, file: Path) -> None:
    """Four processes are killed while they run cells, and no cell fails.

    All kills come before the lost cells are repeated: a cell fails if it is lost twice.
    """
    cells, moments = cells_of(tmp_path, 24, seconds=0.01), random.Random(8)

    def kill(done: float, message: str) -> None:
        if done in range(4, 20, 4):
            time.sleep(moments.uniform(0.0, 0.01))
            *_, one, two = map(int, (tmp_path / "pids").read_text().split())
            with suppress(ProcessLookupError):
                os.kill(moments.choice((one, two)), signal.SIGKILL)

    results = sweep(square, cells, file, workers=WORKERS, show=kill)
    squares = [result.record and result.record["square"] for result in results]
    assert squares == [x**2 for x in range(24)]
    # A process that is killed between two cells loses no cell, but is replaced.
    assert 24 <= runs(tmp_path).total() <= 24 + 4
    assert len(set((tmp_path / "pids").read_text().split())) > WORKERS


def test_ctrl_c_ends_the_processes_and_leaves_a_whole_journal(tmp_path: Path, file: Path) -> None:
    """One process would run its cell for a minute. The sweep can be continued later."""
    cells = cells_of(tmp_path, 6)
    slow = [{**cells[0], "seconds": 60.0}, *cells[1:]]

    def interrupt(done: float, message: str) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(square, slow, file, workers=WORKERS, show=interrupt)
    assert not multiprocessing.active_children()
    assert len(lines_of(file)) == 3
    assert file.read_text().endswith("\n")
    assert not failures(sweep(square, cells, file, workers=1))
    assert runs(tmp_path).total() <= 6 + 2 * WORKERS


@linux
def test_a_killed_sweep_leaves_no_process(tmp_path: Path, file: Path) -> None:
    """Even a process in compiled code that holds the interpreter lock ends."""

    def is_free() -> bool:
        with (tmp_path / "held").open("w") as opened, suppress(BlockingIOError):
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        return False

    process = started(file, cells_of(tmp_path, 1, trouble="hangs"))
    assert within(60, (tmp_path / "hangs").exists)
    assert not is_free()
    process.kill()
    process.join()
    assert within(60, is_free)


@linux
def test_time_in_which_the_machine_sleeps_does_not_count(tmp_path: Path, file: Path) -> None:
    """A cell that is stopped for longer than its limit still has its record."""
    started(file, cells_of(tmp_path, 1, trouble="pauses"), 1.0).join(60)
    (line,) = lines_of(file)
    assert json.loads(line)["failure"] is None


@linux
def test_a_process_has_one_thread(tmp_path: Path, file: Path) -> None:
    """Threads of BLAS would take the cores of the other cells."""
    (result,) = sweep(square, cells_of(tmp_path, 1, trouble="threads"), file)
    assert result.record == {"sum": 400.0**3, "threads": 1}


def test_a_work_that_no_process_can_load_is_refused(
    tmp_path: Path, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No failure is written, because the cells are not to blame."""
    module = types.ModuleType("nowhere")
    exec("def work(cell): return {}", module.__dict__)
    monkeypatch.setitem(sys.modules, "nowhere", module)
    with pytest.raises(InputError, match=naming("cells cores ChildProcessError")):
        sweep(module.work, cells_of(tmp_path, 3), file)
    assert lines_of(file) == []
