"""Run many cells on this machine's cores or on a dask cluster, without losing results.

A cell is plain data. Each result is written to the sweep's journal immediately, as a line of JSON,
so a killed sweep can be continued. Cells run in the processes of `robotball.processes`, which can
be killed at any time, even in compiled code, if a cell exceeds its time limit.
"""

import fcntl
import json
import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import msgspec

from robotball import InputError
from robotball.errors import check_count, check_positive
from robotball.files import json_text, readable
from robotball.files.replacing import no_regular_file
from robotball.motion import versions
from robotball.processes import Answer, EndedError, Worker, cores, pool

from .output import Show, writable_file

Cell = Mapping[str, Any]
"""Plain JSON data that describes a run completely, and identifies it."""
Work = Callable[[Cell], Mapping[str, Any]]
"""A module's function of a cell. Its record is plain data, with None for missing numbers."""
_OUTLASTED = "took longer than"  # begins the failure of a cell that exceeded its time limit
_ELSEWHERE = "give another folder with --out"


@dataclass(frozen=True)
class Result:
    """The outcome of a cell: a record, or a failure in one line.

    Cell and record are read from JSON, so they contain lists instead of tuples.
    """

    cell: dict[str, Any]
    record: dict[str, Any] | None
    failure: str | None

    @property
    def outlasted(self) -> bool:
        """Whether the cell exceeded its time limit."""
        return self.failure is not None and self.failure.startswith(_OUTLASTED)


def sweep(
    work: Work,
    cells: Sequence[Cell],
    file: Path,
    *,
    workers: int | None = None,
    cluster: str | None = None,
    limit: float | None = None,
    show: Show = lambda *_: None,
) -> list[Result]:
    """Return the results of `work` on every cell, in the order of `cells`.

    A cell that raises, ends its process or exceeds the limit fails alone. A cell whose process died
    is run again alone, because something else may have killed the process.

    Parameters
    ----------
    work : callable
        A module's function.
    cells : sequence of mappings
        Distinct plain data.
    file : Path
        The journal. If it exists, only the missing cells are run. It may also have results of other
        sweeps of the same work. Failures are kept: delete a line to run its cell again, or the file
        to run all, for example after a change of the work.
    workers : int, optional
        The number of processes on this machine. The default is the number of available cores.
    cluster : str, optional
        The tcp:// address of a dask scheduler to use instead. Its workers need the same packages.
    limit : float, s, optional
        The time limit of a cell, without the time in which the machine sleeps.
    show : callable
        Called with the number of cells done, and with the number of failures and the time left.

    Raises
    ------
    InputError
        If cells are not distinct plain data, if the journal is from another work or other versions
        or cannot be read or written, if no process starts, or if the cluster does not answer or
        loses its workers.
    """
    distinct = _distinct(cells)
    if limit is not None:
        check_positive("limit", limit, "s")
    if cluster is not None and workers is not None:
        raise InputError("a cluster has its own workers: give one of workers and cluster")
    count = cores() if workers is None else check_count("workers", workers, 1)
    with _journal(file, work) as kept:
        missing = [cell for key, cell in distinct.items() if key not in kept.results]
        # The file may have results of other sweeps, which do not count.
        before = [kept.results[key] for key in distinct if key in kept.results]
        report = _reporter(show, before, len(cells))
        if missing:
            with (
                _local_cores(work, limit, min(count, len(missing)))
                if cluster is None
                else _cluster(work, limit, cluster)
            ) as place:
                for line in place.lines(missing):
                    report(kept.add(line))
        return [kept.results[key] for key in distinct]


def _distinct(cells: Sequence[Cell]) -> dict[str, Cell]:
    """Return the cells by identity."""
    distinct: dict[str, Cell] = {}
    for cell in cells:
        try:
            key = _identity(cell)
        except (ValueError, TypeError) as error:
            raise InputError(f"a cell must be plain JSON data: {error}") from None
        if key in distinct:
            raise InputError(f"cells must be distinct, but {key} occurs twice")
        distinct[key] = cell
    return distinct


def _reporter(show: Show, before: Sequence[Result], total: int) -> Callable[[Result | None], None]:
    """Return the function that counts a result and shows the progress of the sweep.

    Results from `before` are ignored for the speed.
    """
    done, failed = len(before), sum(result.failure is not None for result in before)
    start = time.monotonic()

    def report(result: Result | None) -> None:
        nonlocal done, failed
        if result is not None:
            done, failed = done + 1, failed + (result.failure is not None)
        progress = f"{done} of {total} cells"
        if failed:
            progress += f", {failed} failed"
        if len(before) < done < total:  # the speed is known
            per_cell = (time.monotonic() - start) / (done - len(before))
            progress += f", {duration(per_cell * (total - done))} left"
        show(done, progress)

    report(None)
    return report


def duration(seconds: float) -> str:
    """Format an estimated time, rounded to its accuracy."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def rows_of(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Return a row for each cell with the values of cell and record, and the failure.

    Lists and mappings become JSON. If cell and record have the same key, the cell's value is used.
    """
    rows = [{**(result.record or {}), **result.cell} for result in results]
    cells = (name for result in results for name in result.cell)
    columns = dict.fromkeys((*cells, *(name for row in rows for name in row)))
    return [
        {name: _as_cell(row.get(name)) for name in columns} | {"failure": result.failure}
        for row, result in zip(rows, results, strict=True)
    ]


def _as_cell(value: Any) -> Any:
    return json_text(value) if isinstance(value, list | dict) else value


def _identity(cell: Cell) -> str:
    """Return a text that is the same for equal cells; raises unless the cell is plain data."""
    # NaN is refused because it equals nothing.
    return json.dumps(cell, sort_keys=True, allow_nan=False)


def _reason(error: BaseException) -> str:
    """Format an exception in one line."""
    message = " ".join(str(error).split())
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def _to_line(cell: Cell, record: Mapping[str, Any] | None, failure: str | None) -> str:
    """Format a result as a line of JSON."""
    return json_text({"cell": cell, "record": record, "failure": failure})


def _from_line(line: str | bytes) -> Result:
    """Read a result from a line of JSON. Raises like msgspec if the line is invalid."""
    return msgspec.json.decode(line, type=Result)


@dataclass(frozen=True)
class _Journal:
    """An open journal, and its results by the identity of the cell."""

    path: Path
    file: BinaryIO
    results: dict[str, Result]

    def add(self, line: str) -> Result:
        """Write a line to disk and return its result. Raises InputError if it cannot be written."""
        with _refusals(self.path):
            _write(self.file, line)
        result = _from_line(line)
        self.results[_identity(result.cell)] = result
        return result


@contextmanager
def _journal(path: Path, work: Work) -> Iterator[_Journal]:
    """Open a new or existing journal of a work.

    Raises InputError if the file cannot be read or written, is not a journal, is from another work
    or other versions, or is being written by another sweep.
    """
    with _refusals(path):
        writable_file(path).parent.mkdir(parents=True, exist_ok=True)
        if no_regular_file(path):
            raise InputError(
                f"{path} is not a regular file, so results cannot be kept: {_ELSEWHERE}"
            )
        # A buffer would be lost if the process is killed.
        file = path.open("ab+", buffering=0)
    with file:
        with _refusals(path):
            results = _continued(file, path, work)
        yield _Journal(path, file, results)


@contextmanager
def _refusals(path: Path) -> Iterator[None]:
    """Raise InputError for errors of the operating system."""
    try:
        yield
    except BlockingIOError:
        raise InputError(
            f"{path} is being written by another sweep: wait for it, or {_ELSEWHERE}"
        ) from None
    except OSError as error:
        raise InputError(f"{path} cannot be used: {error.strerror or error}") from None


def _continued(file: BinaryIO, path: Path, work: Work) -> dict[str, Result]:
    """Lock the file, check or write its header, remove a partial last line; return its results."""
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # until the file is closed
    header = {"work": f"{work.__module__}.{work.__qualname__}", "versions": versions()}
    file.seek(0)
    text = file.read()
    # The last line of a killed sweep may be incomplete.
    whole = text[: text.rfind(b"\n") + 1]
    first, *lines = whole.splitlines() or [b""]
    # A sweep that was killed early may have written a part of the header.
    if text and not f"{json.dumps(header)}\n".encode().startswith(text):
        _check_header(first, header, path)
    file.truncate(len(whole))
    if not whole:
        _write(file, json.dumps(header))
    results = {}
    for number, line in enumerate(lines, start=2):
        with readable(f"line {number} of {path} is not a valid result: delete that line"):
            result = _from_line(line)
            results[_identity(result.cell)] = result
    return results


def _write(file: BinaryIO, line: str) -> None:
    rest = f"{line}\n".encode()
    while rest:  # a full disk may accept a part only
        rest = rest[file.write(rest) :]
    # The result must survive a failure of the machine.
    os.fsync(file.fileno())


def _check_header(line: bytes, ours: dict[str, Any], path: Path) -> None:
    with readable(f"{path} is not the journal of a sweep: move it, or {_ELSEWHERE}"):
        theirs = json.loads(line)
        work, made_by = theirs["work"], dict(theirs["versions"])
    if work != ours["work"]:
        raise InputError(
            f"{path} is the journal of {work}, not of {ours['work']}: move it, or {_ELSEWHERE}"
        )
    for part, version in ours["versions"].items():
        if made_by.get(part) != version:
            raise InputError(
                f"{path} was made with {part} {made_by.get(part)}, but this is {version}: results "
                f"of both would be mixed; delete it, or {_ELSEWHERE}"
            )


_CHECK = 5.0  # s without results after which a place is checked
_ANSWER = 4.0  # s that a scheduler may take to answer
_ABSENCE = 30.0  # s without dask workers, longer than a nanny takes to restart one
_WINDOW = 1000  # cells submitted to a scheduler at once, more than it has threads


@dataclass(frozen=True)
class _Place:
    """A place where cells run.

    Attributes
    ----------
    name : str
        The name in messages.
    limit : float, s, or None
        The time limit of a cell.
    window : int
        The number of cells to submit at once, enough to keep all processes busy.
    submit : callable
        Submits a cell to a process that runs `_result_line`.
    check : callable
        Raises InputError if results can no longer arrive.
    """

    name: str
    limit: float | None
    window: int
    submit: Callable[[Cell], "Future[Answer]"]
    check: Callable[[], None] = lambda: None

    def lines(self, cells: Sequence[Cell]) -> Iterator[str]:
        """Yield the results of the cells as soon as they are known.

        A process may die because all cells together need too much memory. So its cell is run again
        alone when the others are done. Raises InputError if cells cannot be run.
        """
        died_cells = []
        for cell, line, died in self._outcomes(cells):
            if died:
                died_cells.append(cell)
            else:
                yield line
        for cell in died_cells:
            for _, line, _ in self._outcomes([cell]):
                yield line

    def _outcomes(self, cells: Sequence[Cell]) -> Iterator[tuple[Cell, str, bool]]:
        """Yield the cells with their results, and whether a process died."""
        waiting = iter(cells)
        running = {self.submit(cell): cell for cell in islice(waiting, self.window)}
        while running:
            finished, _ = wait(running, _CHECK, FIRST_COMPLETED)
            if not finished:
                self.check()
            for future in finished:
                cell = running.pop(future)
                yield cell, *self._outcome(cell, future)
            running |= {self.submit(cell): cell for cell in islice(waiting, len(finished))}

    def _outcome(self, cell: Cell, future: "Future[Answer]") -> tuple[str, bool]:
        try:
            return future.result()[0], False
        except EndedError as ended:
            if ended.status is None:
                return _to_line(cell, None, f"{_OUTLASTED} {self.limit:g} s"), False
            return _to_line(cell, None, _death(ended.status)), True
        except CancelledError:  # dask's scheduler does not answer
            raise InputError(
                f"{self.name} does not answer: restart it, then repeat the command to continue"
            ) from None
        except ChildProcessError as error:
            raise InputError(f"no cells can run on {self.name}: {_reason(error)}") from None
        # dask reports workers that left or were killed with many types of exceptions.
        except Exception as error:
            return _to_line(cell, None, _reason(error)), True


def _death(status: int) -> str:
    if status < 0:
        return f"its process was killed by signal {-status}, {signal.strsignal(-status)}"
    return f"its process exited with status {status}"


def _result_line(work: Work, cell: Cell) -> str:
    """Run a cell and return its result as a line; an exception becomes its failure."""
    try:
        record = work(cell)
        if not isinstance(record, Mapping):
            raise TypeError(f"a record must be a mapping, not {type(record).__name__}")
        return _to_line(cell, record, None)
    # Libraries may call sys.exit; only Ctrl-C must end the sweep.
    except (Exception, SystemExit) as error:
        return _to_line(cell, None, _reason(error))


@contextmanager
def _local_cores(work: Work, limit: float | None, count: int) -> Iterator[_Place]:
    """Provide `count` processes of this machine, which end with the block."""
    with pool(partial(_result_line, work), count) as submit:
        yield _Place("the local cores", limit, 2 * count, lambda cell: submit(cell, limit))


@contextmanager
def _cluster(work: Work, limit: float | None, address: str) -> Iterator[_Place]:
    """Provide the workers of the scheduler at `address`, with one process per thread.

    The processes protect the dask workers from cells that exceed the limit or end their process.
    Raises InputError if dask is not installed, if no scheduler answers, or if the workers have
    other versions; the check of the place raises it if all workers have left.
    """
    try:
        distributed = import_module("distributed")  # it has no type hints
    except ImportError:
        raise InputError(
            "a cluster needs dask: pip install '.[cluster]' in a checkout of robotball"
        ) from None
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # our message has one line
    try:
        client = distributed.Client(address, timeout=_ANSWER, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"no dask scheduler answers at {address}: {_reason(error)}; give the address that "
            "`dask scheduler` prints, such as tcp://127.0.0.1:8786"
        ) from None

    def check() -> None:
        try:
            client.wait_for_workers(1, timeout=_ABSENCE)
        except OSError:  # as a TimeoutError is
            raise InputError(
                f"all workers of {address} have left: start workers, then repeat the command"
            ) from None

    with client:
        _check_workers(client, address, work)
        # Otherwise dask would not run a cell twice if its process died.
        executor = client.get_executor(pure=False)
        submit = partial(executor.submit, _answer, work, limit=limit)
        yield _Place(address, limit, _WINDOW, submit, check)


def _check_workers(client: Any, address: str, work: Work) -> None:
    try:
        workers = client.run(_versions_beside, work)
    except Exception as error:
        raise InputError(
            f"the workers at {address} cannot run robotball: {_reason(error)}; install it there"
        ) from None
    if not workers:
        raise InputError(f"{address} has no workers: start them with `dask worker {address}`")
    for worker, theirs in workers.items():
        for part, ours in versions().items():
            if theirs[part] != ours:
                raise InputError(
                    f"worker {worker} has {part} {theirs[part]}, but {ours} is running here: "
                    "install the same version there"
                )


def _versions_beside(_: Work) -> dict[str, str]:
    """Return the versions of a dask worker; passing the work checks that it can be imported."""
    return versions()


def _answer(work: Work, cell: Cell, limit: float | None) -> Answer:
    """Run a cell in the process of this thread of a dask worker."""
    # Daemons must not start processes, and dask workers are daemons. Our processes end with them.
    multiprocessing.current_process().daemon = False
    return _worker_of(work, threading.get_ident()).answer(cell, limit)


@cache
def _worker_of(work: Work, _thread: int) -> Worker:
    return Worker(partial(_result_line, work))
