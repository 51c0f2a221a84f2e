"""Run many cells, on this machine's cores or on a dask cluster, and lose no result.

A cell is plain data. Each result is a line of JSON in the sweep's journal, on disk as soon as it is
known, so a sweep that was killed goes on where it ended. Cells run in the processes of
`robotball.processes`, which may be killed at any time, and are where a cell outlasts its limit,
even in compiled code.
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
from robotball.files import readable
from robotball.files.json_text import json_text
from robotball.files.replacing import no_regular_file
from robotball.motion import versions
from robotball.processes import Answer, EndedError, Worker, cores, pool

from .output import Show, writable_file

Cell = Mapping[str, Any]
"""Plain data, as JSON has it, that says everything about one run: it is the run's identity."""
Work = Callable[[Cell], Mapping[str, Any]]
"""A module's function of a cell; its record is plain data, with None for what has no number."""
_OUTLASTED = "took longer than"  # begins the failure of a cell that was ended at its limit of time
_ELSEWHERE = "give another folder with --out"


@dataclass(frozen=True)
class Result:
    """The outcome of a cell: a record, or the reason why there is none.

    cell, record: as JSON gives them back, so a tuple is a list; failure: one line.
    """

    cell: dict[str, Any]
    record: dict[str, Any] | None
    failure: str | None

    @property
    def outlasted(self) -> bool:
        """Whether the cell was ended at its limit of time."""
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

    work: a module's function; file: keeps every result from the moment it is known. A sweep that
    was killed and is started again with the same file does only what is missing, and cells of
    other sweeps of the same work may be there too. Failures are kept like records: to try one
    again, delete its line; to do all again, as after a change of the work, delete the file.

    workers: processes on this machine, as many as it has cores for us if None; cluster: the tcp://
    address of a dask scheduler to run on instead, whose workers need the same packages but not
    this file; limit: s after which a cell is given up, whatever it does, not counting a time in
    which the machine sleeps; show: called with the number of cells done and with how many failed
    and the time left.

    A cell that raises, ends its process or outlasts the limit fails alone. One whose process died
    is run again before that is its failure, as something else may have killed it.

    Raises InputError on cells that are not distinct plain data, on a file of another work or of
    other versions or that cannot be read or written, and where no process starts, or the cluster
    does not answer or loses its workers.
    """
    distinct = _distinct(cells)
    if limit is not None:
        check_positive("limit", limit, "s")
    if cluster is not None and workers is not None:
        raise InputError("a cluster has its own workers: give one of workers and cluster")
    count = cores() if workers is None else check_count("workers", workers, 1)
    with _journal(file, work) as kept:
        missing = [cell for key, cell in distinct.items() if key not in kept.results]
        # Of the asked cells alone: other sweeps of the same work may have results in the file.
        there = [kept.results[key] for key in distinct if key in kept.results]
        report = _reporter(show, there, len(cells))
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
    """Return the cells by their identities."""
    distinct: dict[str, Cell] = {}
    for cell in cells:
        try:
            key = _identity(cell)
        except (ValueError, TypeError) as error:
            raise InputError(f"a cell must be plain data, as JSON has it: {error}") from None
        if key in distinct:
            raise InputError(f"cells must be distinct, and {key} is there twice")
        distinct[key] = cell
    return distinct


def _reporter(show: Show, before: Sequence[Result], total: int) -> Callable[[Result | None], None]:
    """Return what shows a sweep's progress when it is called with one more result.

    The results there before say nothing about the speed.
    """
    done, failed = len(before), sum(result.failure is not None for result in before)
    start = time.monotonic()

    def report(result: Result | None) -> None:
        nonlocal done, failed
        if result is not None:
            done, failed = done + 1, failed + (result.failure is not None)
        words = [f"{done} of {total} cells"]
        if failed:
            words.append(f"{failed} failed")
        # Before the first result of this run nothing is known of the speed.
        if len(before) < done < total:
            each = (time.monotonic() - start) / (done - len(before))
            words.append(f"{duration(each * (total - done))} left")
        show(done, ", ".join(words))

    report(None)
    return report


def duration(seconds: float) -> str:
    """Return a time to come, as precisely as it can be known."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def rows_of(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Return a row for each cell: its columns, those of all records, and the failure.

    Lists and mappings are JSON. Of a name that cell and record share, the cell's value stands.
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
    """Return the same text for equal cells. Raises ValueError or TypeError for no plain data."""
    # Keys sorted, as two equal cells may be written in another order; NaN is refused, as it equals
    # nothing.
    return json.dumps(cell, sort_keys=True, allow_nan=False)


def _reason(error: BaseException) -> str:
    """Return an exception in one line."""
    words = " ".join(str(error).split())
    return f"{type(error).__name__}: {words}" if words else type(error).__name__


def _to_line(cell: Cell, record: Mapping[str, Any] | None, failure: str | None) -> str:
    """Return a result as a line of JSON."""
    return json_text({"cell": cell, "record": record, "failure": failure})


def _from_line(line: str | bytes) -> Result:
    """Return the result of a line. Raises as msgspec does where it is none."""
    return msgspec.json.decode(line, type=Result)


@dataclass(frozen=True)
class _Journal:
    """An open file of results; `results`: what it holds, by the identity of the cell."""

    path: Path
    file: BinaryIO
    results: dict[str, Result]

    def add(self, line: str) -> Result:
        """Return the result of a line, which is on disk by then; InputError if it cannot be."""
        with _refusals(self.path):
            _write(self.file, line)
        result = _from_line(line)
        self.results[_identity(result.cell)] = result
        return result


@contextmanager
def _journal(path: Path, work: Work) -> Iterator[_Journal]:
    """Open the journal at `path` of the cells that `work` has done, new or to be continued.

    Raises InputError where the file cannot be read or written, is no journal, is of another work or
    made by other versions, or is being written by another sweep.
    """
    with _refusals(path):
        writable_file(path).parent.mkdir(parents=True, exist_ok=True)
        if no_regular_file(path):
            raise InputError(f"{path} is no regular file, as a sweep's record is: {_ELSEWHERE}")
        # Without a buffer, which a kill would take along.
        file = path.open("ab+", buffering=0)
    with file:
        with _refusals(path):
            results = _continued(file, path, work)
        yield _Journal(path, file, results)


@contextmanager
def _refusals(path: Path) -> Iterator[None]:
    """Raise InputError for what the system refuses in the block."""
    try:
        yield
    except BlockingIOError:
        raise InputError(
            f"{path} is being written by another sweep: wait for it, or {_ELSEWHERE}"
        ) from None
    except OSError as error:
        raise InputError(f"{path} cannot be used: {error.strerror or error}") from None


def _continued(file: BinaryIO, path: Path, work: Work) -> dict[str, Result]:
    """Return the results in the file, which is locked and left with a header and whole lines."""
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # until it is closed or we are killed
    header = {"work": f"{work.__module__}.{work.__qualname__}", "versions": versions()}
    file.seek(0)
    text = file.read()
    # Of a line that a killed sweep was writing there is only a part, without its end.
    whole = text[: text.rfind(b"\n") + 1]
    first, *lines = whole.splitlines() or [b""]
    # A sweep that was killed at once may have written a part of its own header.
    if text and not f"{json.dumps(header)}\n".encode().startswith(text):
        _check_header(first, header, path)
    file.truncate(len(whole))
    if not whole:
        _write(file, json.dumps(header))
    results = {}
    for number, line in enumerate(lines, start=2):
        with readable(f"line {number} of {path} is no result: delete that line"):
            result = _from_line(line)
            results[_identity(result.cell)] = result
    return results


def _write(file: BinaryIO, line: str) -> None:
    rest = f"{line}\n".encode()
    while rest:  # a disk that fills up takes a part
        rest = rest[file.write(rest) :]
    # A result counts as done from here, so a machine that fails must not lose it.
    os.fsync(file.fileno())


def _check_header(line: bytes, ours: dict[str, Any], path: Path) -> None:
    with readable(f"{path} is not the record of a sweep: move it, or {_ELSEWHERE}"):
        theirs = json.loads(line)
        work, made_by = theirs["work"], dict(theirs["versions"])
    if work != ours["work"]:
        raise InputError(
            f"{path} is the record of {work}, not of {ours['work']}: move it, or {_ELSEWHERE}"
        )
    for part, version in ours["versions"].items():
        if made_by.get(part) != version:
            raise InputError(
                f"{path} was made with {part} {made_by.get(part)}, and this is {version}: results "
                f"of both would be mixed; delete it, or {_ELSEWHERE}"
            )


_CHECK = 5.0  # s that a place may give no results before it is checked
_ANSWER = 4.0  # s that a scheduler may take to answer
_ABSENCE = 30.0  # s without dask workers: more than a nanny needs to start one again
_WINDOW = 1000  # cells handed to a scheduler at once: more than its threads, few enough to be quick


@dataclass(frozen=True)
class _Place:
    """A place where cells run.

    name: for the user; limit: s for a cell; window: how many cells to have handed in at once, which
    keep every process busy; submit: gives a cell to `Worker.answer` of a process of `_result_line`;
    check: raises InputError where no answer can come.
    """

    name: str
    limit: float | None
    window: int
    submit: Callable[[Cell], "Future[Answer]"]
    check: Callable[[], None] = lambda: None

    def lines(self, cells: Sequence[Cell]) -> Iterator[str]:
        """Yield the cells' results, each as soon as it is known.

        What ended a process may be the memory that all took together, so its cell is run again
        when the others are done, with no other beside it. Raises InputError where none can run.
        """
        again = []
        for cell, line, died in self._outcomes(cells):
            if died:
                again.append(cell)
            else:
                yield line
        for cell in again:
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
        except CancelledError:  # by dask, whose scheduler does not answer
            raise InputError(f"{self.name} has gone: start it, and this again to go on") from None
        except ChildProcessError as error:
            raise InputError(f"no cells can run on {self.name}: {_reason(error)}") from None
        # A dask worker that leaves while its answer is fetched loses it, and one that is killed
        # leaves none, which dask reports by errors of many types.
        except Exception as error:
            return _to_line(cell, None, _reason(error)), True


def _death(status: int) -> str:
    if status < 0:
        return f"its process was ended by signal {-status}, {signal.strsignal(-status)}"
    return f"ended its process with status {status}"


def _result_line(work: Work, cell: Cell) -> str:
    """Return the result as a line; whatever the work raises is its failure."""
    try:
        record = work(cell)
        if not isinstance(record, Mapping):
            raise TypeError(f"a record must be a mapping, not {type(record).__name__}")
        return _to_line(cell, record, None)
    # A cell may also exit, by a library's own wish; only Ctrl-C must end the sweep.
    except (Exception, SystemExit) as error:
        return _to_line(cell, None, _reason(error))


@contextmanager
def _local_cores(work: Work, limit: float | None, count: int) -> Iterator[_Place]:
    """Give so many processes of this machine, which end with the block, whatever they do."""
    with pool(partial(_result_line, work), count) as submit:
        yield _Place("the local cores", limit, 2 * count, lambda cell: submit(cell, limit))


@contextmanager
def _cluster(work: Work, limit: float | None, address: str) -> Iterator[_Place]:
    """Give the workers of the scheduler at `address`, with a process of ours for each thread.

    A cell that outlasts its limit or ends its process is so no loss of the dask worker. Raises
    InputError where dask is not installed, none answers, or the workers have other versions than we
    have; its check raises it where all workers have gone.
    """
    try:
        distributed = import_module("distributed")  # whose calls have no types
    except ImportError:
        raise InputError(
            "a cluster needs dask: pip install '.[cluster]' in a checkout of robotball"
        ) from None
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # we say it in a line
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
                f"all workers of {address} have gone: start some, and this again to go on"
            ) from None

    with client:
        _check_workers(client, address, work)
        # dask takes a call that it has seen for done; a cell that died is to be run again.
        executor = client.get_executor(pure=False)
        submit = partial(executor.submit, _answer, work, limit=limit)
        yield _Place(address, limit, _WINDOW, submit, check)


def _check_workers(client: Any, address: str, work: Work) -> None:
    try:
        workers = client.run(_versions_beside, work)
    except Exception as error:
        raise InputError(
            f"the workers at {address} do not run robotball: {_reason(error)}; install it there"
        ) from None
    if not workers:
        raise InputError(f"{address} has no workers: start some with `dask worker {address}`")
    for worker, theirs in workers.items():
        for part, ours in versions().items():
            if theirs[part] != ours:
                raise InputError(
                    f"worker {worker} has {part} {theirs[part]}, and this is {ours}: install the "
                    "same there"
                )


def _versions_beside(_: Work) -> dict[str, str]:
    """Return the versions of a dask worker, which must have loaded the work to be asked."""
    return versions()


def _answer(work: Work, cell: Cell, limit: float | None) -> Answer:
    """Return the answer of a process of this thread of a dask worker."""
    # A nanny makes its worker a daemon, which may start none lest they outlive it: ours do not.
    multiprocessing.current_process().daemon = False
    return _worker_of(work, threading.get_ident()).answer(cell, limit)


@cache
def _worker_of(work: Work, _thread: int) -> Worker:
    return Worker(partial(_result_line, work))
