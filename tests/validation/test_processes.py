"""Processes that are killed, hang, or are stopped: nothing done is lost and none is left."""

import fcntl
import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import time
import types
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from robotball import InputError
from tests.validation.work import WORKERS, cells_of, failures, lines_of, runs, square
from validation.output import write_rows
from validation.sweeps import rows_of, sweep

FORKSERVER = multiprocessing.get_context("forkserver")
linux = pytest.mark.skipif(sys.platform != "linux", reason="rests on Linux' signals and /proc")


def to_be_killed(folder: Path) -> None:
    sweep(square, cells_of(folder, 60, seconds=0.02), folder / "sweep.jsonl", workers=WORKERS)


def to_be_left(folder: Path) -> None:
    sweep(square, cells_of(folder, 1, trouble="hangs"), folder / "sweep.jsonl")


def to_be_stopped(folder: Path) -> None:
    sweep(square, cells_of(folder, 1, trouble="pauses"), folder / "sweep.jsonl", limit=1.0)


@pytest.fixture(autouse=True)
def server(tmp_path_factory: pytest.TempPathFactory) -> None:
    """The server that starts processes is that of a sweep, also for the tests' own."""
    folder = tmp_path_factory.mktemp("server")
    sweep(square, cells_of(folder, 1), folder / "sweep.jsonl")


def within(seconds: float, done: Callable[[], bool]) -> bool:
    """Whether that is so before the seconds are over."""
    end = time.monotonic() + seconds
    while not (there := done()) and time.monotonic() < end:
        time.sleep(0.001)
    return there


def is_free(file: Path) -> bool:
    """Whether no process holds its lock."""
    with file.open("w") as opened:
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True


@pytest.mark.slow
def test_a_killed_sweep_goes_on_and_ends_with_the_identical_table(tmp_path: Path) -> None:
    """SIGKILL at any moment costs the cells that were running, and no result is made twice."""
    file, moments = tmp_path / "sweep.jsonl", random.Random(4)
    before: dict[int, int] = {}
    for enough in (1, 12, 25):
        process = FORKSERVER.Process(target=to_be_killed, args=(tmp_path,))
        process.start()
        assert within(60, lambda least=enough: len(lines_of(file)) >= least)  # type: ignore[misc]
        time.sleep(moments.uniform(0.0, 0.05))
        process.kill()
        process.join()
        ran = runs(tmp_path)
        assert all(ran[x] == times for x, times in before.items())
        before = {x: ran[x] for x in (json.loads(line)["cell"]["x"] for line in lines_of(file))}
    assert 25 <= len(before) < 60
    with file.open("a") as torn:
        torn.write('{"cell": {"x": 59, "ra')
    cells = cells_of(tmp_path, 60, seconds=0.02)
    write_rows(tmp_path / "killed.csv", rows_of(sweep(square, cells, file, workers=WORKERS)))
    ran = runs(tmp_path)
    assert all(ran[x] == times for x, times in before.items())
    # A death costs at most what was handed in: two cells a worker.
    assert 60 <= ran.total() <= 60 + 3 * 2 * WORKERS
    write_rows(
        tmp_path / "whole.csv", rows_of(sweep(square, cells, tmp_path / "b", workers=WORKERS))
    )
    assert (tmp_path / "killed.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()


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


def test_compiled_code_that_does_not_return_is_given_up(tmp_path: Path) -> None:
    """Its process is ended, which one worker survives too, as it is not this process."""
    cells = cells_of(tmp_path, 2)
    cells[0]["trouble"] = "hangs"
    results = sweep(square, cells, tmp_path / "sweep.jsonl", workers=1, limit=0.2)
    assert failures(results) == {0: "took longer than 0.2 s"}


def test_killed_workers_cost_nothing(tmp_path: Path) -> None:
    """SIGKILL of any process that runs cells, seven times: no failure, the identical table.

    All fall before the lost cells are run again: a second loss is a cell's failure.
    """
    cells, moments = cells_of(tmp_path, 40, seconds=0.01), random.Random(8)

    def kill(done: float, what: str) -> None:
        if done in range(4, 32, 4):
            time.sleep(moments.uniform(0.0, 0.01))
            *_, one, two = map(int, (tmp_path / "pids").read_text().split())
            with suppress(ProcessLookupError):
                os.kill(moments.choice((one, two)), signal.SIGKILL)

    killed = sweep(square, cells, tmp_path / "a", workers=WORKERS, show=kill)
    assert not failures(killed)
    assert runs(tmp_path).total() <= 40 + 7
    write_rows(tmp_path / "killed.csv", rows_of(killed))
    write_rows(tmp_path / "whole.csv", rows_of(sweep(square, cells, tmp_path / "b", workers=3)))
    assert (tmp_path / "killed.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()


def test_ctrl_c_ends_what_runs(tmp_path: Path) -> None:
    """No process is left, though one would run its cell for a minute."""
    cells = cells_of(tmp_path, 4)
    cells[0]["seconds"] = 60.0

    def interrupt(done: float, what: str) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(square, cells, tmp_path / "sweep.jsonl", workers=WORKERS, show=interrupt)
    assert not multiprocessing.active_children()


@linux
def test_a_killed_sweep_leaves_no_process(tmp_path: Path) -> None:
    """Not even one in compiled code that keeps the interpreter's lock."""
    process = FORKSERVER.Process(target=to_be_left, args=(tmp_path,))
    process.start()
    assert within(60, (tmp_path / "hangs").exists)
    assert not is_free(tmp_path / "held")
    process.kill()
    process.join()
    assert within(10, lambda: is_free(tmp_path / "held"))


@pytest.mark.slow
@linux
def test_a_time_in_which_all_is_stopped_does_not_count(tmp_path: Path) -> None:
    """Stopped for longer than its limit, as when the machine sleeps, a cell has its record."""
    process = FORKSERVER.Process(target=to_be_stopped, args=(tmp_path,))
    process.start()
    process.join(60)
    (line,) = lines_of(tmp_path / "sweep.jsonl")
    assert json.loads(line)["failure"] is None


@linux
def test_a_process_has_one_thread(tmp_path: Path) -> None:
    """BLAS has no threads of its own, which would take the other cells' cores."""
    (result,) = sweep(square, cells_of(tmp_path, 1, trouble="threads"), tmp_path / "sweep.jsonl")
    assert result.record == {"sum": 400.0**3, "threads": 1}


@pytest.mark.slow
def test_a_script_sweeps_below_its_guard(tmp_path: Path) -> None:
    """Its processes import it, and say nothing."""
    (tmp_path / "script.py").write_text(f"""
from pathlib import Path
from tests.validation.work import cells_of, square
from validation.sweeps import sweep
folder = Path({str(tmp_path)!r})
if __name__ == "__main__":
    print(len(sweep(square, cells_of(folder, 2), folder / "sweep.jsonl")))
""")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    script = [sys.executable, str(tmp_path / "script.py")]
    ran = subprocess.run(script, capture_output=True, text=True, env=environment)
    assert (ran.stdout, ran.stderr) == ("2\n", "")


def test_a_work_that_no_process_can_load_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is not the cells' failure: none is written."""
    module = types.ModuleType("nowhere")
    exec("def work(cell): return {}", module.__dict__)
    monkeypatch.setitem(sys.modules, "nowhere", module)
    with pytest.raises(InputError, match="no cells can run on the local cores: ChildProcessError"):
        sweep(module.work, cells_of(tmp_path, 3), tmp_path / "sweep.jsonl")
    assert lines_of(tmp_path / "sweep.jsonl") == []
