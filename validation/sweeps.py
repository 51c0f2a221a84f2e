"""Run many cells, on this machine's cores or on a dask cluster, and lose no result.

A cell is plain data. Each result is a line of JSON in the sweep's journal, on disk as soon as it is
known, so a sweep that was killed goes on where it ended. Each cell runs in a process that shares a
pipe with its parent and nothing with any other: no lock stays taken whenever one is killed, and a
cell that outlasts its limit, even in compiled code, is ended with its process.
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
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from itertools import islice
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, BinaryIO

from robotball import InputError
from robotball.cores import FORKSERVER, at_most, cores, end_with_parent, start_server
from robotball.errors import check_count, check_positive
from robotball.files.replacing import no_regular_file
from validation.output import Show, versions, writable_file, write_rows

Cell = Mapping[str, Any]
"""Plain data, as JSON has it, that says everything about one run: it is the run's identity."""
OUTLASTED = "took longer than"
"""How the failure of a cell begins that was ended at its limit of time."""
Work = Callable[[Cell], Mapping[str, Any]]
"""A module's function of a cell; its record is plain data, with None for what has no number."""


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
        return self.failure is not None and self.failure.startswith(OUTLASTED)


def identity(cell: Mapping[str, Any]) -> str:
    """The same text for equal cells; raises ValueError or TypeError where it is no plain data."""
    return json.dumps(cell, sort_keys=True, allow_nan=False)


def reason(error: BaseException) -> str:
    """An exception in one line."""
    words = " ".join(str(error).split())
    return f"{type(error).__name__}: {words}" if words else type(error).__name__


def to_line(cell: Cell, record: Mapping[str, Any] | None, failure: str | None) -> str:
    """A result as a line; raises ValueError or TypeError where the record is no plain data."""
    whole = {"cell": cell, "record": record, "failure": failure}
    return json.dumps(whole, allow_nan=False, ensure_ascii=False)


def from_line(line: str | bytes) -> Result:
    """The result of a line; raises ValueError or TypeError where it is none."""
    return Result(**json.loads(line))


def write_table(path: Path, results: Sequence[Result]) -> None:
    """Write the results as CSV, a row a cell. Equal results make equal files."""
    write_rows(path, rows_of(results))


def rows_of(results: Sequence[Result]) -> list[dict[str, Any]]:
    """Return a row for each cell: its columns, those of all records, and the failure.

    Lists and mappings are JSON. Of a name that cell and record share, the cell's value stands.
    """
    cells = [result.cell for result in results]
    records = [result.record or {} for result in results]
    columns = dict.fromkeys(name for row in (*cells, *records) for name in row)
    return [
        {name: _plain({**record, **cell}.get(name)) for name in columns}
        | {"failure": result.failure}
        for cell, record, result in zip(cells, records, results, strict=True)
    ]


def _plain(value: Any) -> Any:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value


ELSEWHERE = "give another folder with --out"


@dataclass(frozen=True)
class Journal:
    """An open file of results; `results`: what it holds, by the identity of the cell."""

    path: Path
    file: BinaryIO
    results: dict[str, Result]

    def add(self, line: str) -> Result:
        """The result of a line, which is on disk when this returns; InputError if it can't be."""
        with _refusals(self.path):
            _write(self.file, line)
        result = from_line(line)
        self.results[identity(result.cell)] = result
        return result


@contextmanager
def journal(path: Path, work: Work) -> Iterator[Journal]:
    """The journal at `path` of the cells that `work` has done, new or to be continued.

    Raises InputError where the file can't be read or written, is no journal, is of another work or
    made by other versions, or is being written by another sweep.
    """
    with _refusals(path):
        writable_file(path).parent.mkdir(parents=True, exist_ok=True)
        if no_regular_file(path):
            raise InputError(f"{path} is no regular file, as a sweep's record is: {ELSEWHERE}")
        file = path.open("ab+", buffering=0)
    with file:
        with _refusals(path):
            results = _continued(file, path, work)
        yield Journal(path, file, results)


@contextmanager
def _refusals(path: Path) -> Iterator[None]:
    """Make one line of what the system refuses in the block."""
    try:
        yield
    except BlockingIOError:
        raise InputError(
            f"{path} is being written by another sweep: wait for it, or {ELSEWHERE}"
        ) from None
    except OSError as error:
        raise InputError(f"{path} cannot be used: {error.strerror or error}") from None


def _continued(file: BinaryIO, path: Path, work: Work) -> dict[str, Result]:
    """The results in the file, which is locked and ready for more: a header and whole lines."""
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # until it is closed or we are killed
    header = {"work": f"{work.__module__}.{work.__qualname__}", "versions": versions()}
    file.seek(0)
    text = file.read()
    whole = text[: text.rfind(b"\n") + 1]
    first, *lines = whole.splitlines() or [b""]
    if text and not _encoded(json.dumps(header)).startswith(text):
        _check_header(first, header, path)
    # Of a line that a killed sweep was writing there is only a part, without its end.
    file.truncate(len(whole))
    if not whole:
        _write(file, json.dumps(header))
    return _results(lines, path)


def _encoded(line: str) -> bytes:
    return line.encode() + b"\n"


def _write(file: BinaryIO, line: str) -> None:
    rest = _encoded(line)
    while rest:  # a disk that fills up takes a part
        rest = rest[file.write(rest) :]
    os.fsync(file.fileno())


def _check_header(line: bytes, ours: dict[str, Any], path: Path) -> None:
    try:
        theirs = json.loads(line)
        work, made_by = theirs["work"], dict(theirs["versions"])
    except (ValueError, TypeError, KeyError):
        raise InputError(f"{path} is not the record of a sweep: move it, or {ELSEWHERE}") from None
    if work != ours["work"]:
        raise InputError(
            f"{path} is the record of {work}, not of {ours['work']}: move it, or {ELSEWHERE}"
        )
    for part, version in ours["versions"].items():
        if made_by.get(part) != version:
            raise InputError(
                f"{path} was made with {part} {made_by.get(part)}, and this is {version}: results "
                f"of both would be mixed; delete it, or {ELSEWHERE}"
            )


def _results(lines: list[bytes], path: Path) -> dict[str, Result]:
    results = {}
    for number, line in enumerate(lines, start=2):
        try:
            result = from_line(line)
            results[identity(result.cell)] = result
        except (ValueError, TypeError):
            raise InputError(f"line {number} of {path} is no result: delete that line") from None
    return results


IDLE = 60.0
"""How long [s] a process waits for the next cell before it ends."""
PARTS = 20
"""A limit is waited for in so many parts; however long we are stopped, it takes one of them."""
TRIES = 10
"""How often a process is asked to begin a cell, and started again where it was idle or killed."""
CHILDREN = threading.Lock()
"""A process that is started looks after all others, which two threads must not do at a time."""
Outcome = tuple[str, bool]
"""A result as a line, and whether the process died, of the cell or of a kill from outside."""


class Worker:
    """A process of its own, started when it is first needed and again after its end."""

    def __init__(self) -> None:
        self._process: multiprocessing.process.BaseProcess | None = None
        self._closed = False

    def outcome(self, work: Work, cell: Cell, limit: float | None) -> Outcome:
        """The cell's result, which is a failure if there is none in `limit` s; for one thread.

        Raises ChildProcessError where no process begins it.
        """
        self._begin(work, cell)
        try:
            if self._answers(limit):
                return self._pipe.recv(), False
        except (OSError, EOFError):
            return to_line(cell, None, _death(self._end())), True
        self._end()
        return to_line(cell, None, f"{OUTLASTED} {limit:g} s"), False

    def close(self) -> None:
        """Ends the process, whatever it does, and starts no other; for any thread."""
        self._closed = True
        self._end()

    def _begin(self, work: Work, cell: Cell) -> None:
        """Returns when the cell runs, from where its time counts."""
        for _ in range(TRIES):
            try:
                if self._process is None:
                    self._start(work)
                self._pipe.send((work, cell))
                self._pipe.recv()
                return
            except (OSError, EOFError) as error:  # it ended before
                why = reason(error)
                if self._end() == 1:  # by an exception: the work cannot be loaded
                    break
        raise ChildProcessError(f"no process takes one ({why}); more is on standard error")

    def _start(self, work: Work) -> None:
        self._pipe, theirs = FORKSERVER.Pipe()
        process = FORKSERVER.Process(target=_serve, args=(theirs,), daemon=True)
        with theirs, CHILDREN:
            start_server(work.__module__)
            process.start()
        self._process = process
        if self._closed:  # meanwhile
            self._end()
            raise CancelledError

    def _answers(self, limit: float | None) -> bool:
        if limit is None:
            return self._pipe.poll(None)
        return any(self._pipe.poll(limit / PARTS) for _ in range(PARTS))

    def _end(self) -> int:
        """The status of the process, ended by itself or now."""
        process, self._process = self._process, None
        if process is None:
            return 0
        process.kill()
        with CHILDREN:
            process.join()
            return process.exitcode or 0


def _death(status: int) -> str:
    if status < 0:
        return f"its process was ended by signal {-status}, {signal.strsignal(-status)}"
    return f"ended its process with status {status}"


def _serve(pipe: Connection) -> None:
    """Run cells in this process: answer that one begins, and then its line."""
    end_with_parent()
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while pipe.poll(IDLE):
            work, cell = pipe.recv()
            pipe.send(None)
            pipe.send(_line(work, cell))


def _line(work: Work, cell: Cell) -> str:
    """The result; whatever the work raises is its failure."""
    try:
        with at_most(1):
            record = work(cell)
        if not isinstance(record, Mapping):
            raise TypeError(f"a record must be a mapping, not {type(record).__name__}")
        return to_line(cell, record, None)
    except (Exception, SystemExit) as error:
        return to_line(cell, None, reason(error))


CHECK = 5.0
"""How long [s] a pool may give no results before it is checked."""


@dataclass(frozen=True)
class Pool:
    """Where cells run.

    place: as the user knows it; window: how many cells to have handed in at once, which keep every
    process busy; submit: what will come of a cell; killed: what is raised instead where a worker
    ended, its processes with it; check: raises InputError where nothing can come.
    """

    place: str
    window: int
    submit: Callable[[Cell], "Future[Outcome]"]
    killed: tuple[type[Exception], ...] = ()
    check: Callable[[], None] = lambda: None

    def lines(self, cells: Sequence[Cell]) -> Iterator[str]:
        """The cells' results, each as soon as it is known; raises InputError where none can run.

        What ended a process may be the memory that all took together, so its cell is run again
        when the others are done, with no other beside it.
        """
        again = []
        for cell, (line, died) in self._outcomes(cells):
            if died:
                again.append(cell)
            else:
                yield line
        for cell in again:
            for _, (line, _) in self._outcomes([cell]):
                yield line

    def _outcomes(self, cells: Sequence[Cell]) -> Iterator[tuple[Cell, Outcome]]:
        """The cells with what came of them, each as soon as it is done."""
        waiting = iter(cells)
        running: dict[Future[Outcome], Cell] = {}
        done: SimpleQueue[Future[Outcome]] = SimpleQueue()
        resubmitted: set[int] = set()

        def submit(cell: Cell) -> None:
            future = self.submit(cell)
            running[future] = cell
            future.add_done_callback(done.put)

        def hand_in(count: int) -> None:
            for cell in islice(waiting, count):
                submit(cell)

        hand_in(self.window)
        while running:
            try:
                future = done.get(timeout=CHECK)
            except Empty:
                self.check()
            else:
                cell = running.pop(future)
                outcome = self._outcome(cell, future, last=id(cell) in resubmitted)
                if outcome is None:
                    resubmitted.add(id(cell))
                    submit(cell)
                else:
                    yield cell, outcome
                    hand_in(1)

    def _outcome(self, cell: Cell, future: "Future[Outcome]", last: bool) -> Outcome | None:
        """Return what came of a cell; None where its result was lost and `last` is not set.

        A worker that leaves while its result is fetched loses it, which dask reports by errors of
        many types. Where nothing can run, the second attempt fails as well.
        """
        try:
            return future.result()
        except self.killed:
            return to_line(cell, None, "ended its worker"), True
        except CancelledError:  # by dask, whose scheduler does not answer
            raise InputError(f"{self.place} has gone: start it, and this again to go on") from None
        except Exception as error:
            if not last:
                return None
            raise InputError(f"no cells can run on {self.place}: {reason(error)}") from None


@contextmanager
def local_pool(work: Work, limit: float | None, count: int) -> Iterator[Pool]:
    """So many processes of this machine, which end with the block, whatever they do."""
    workers = [Worker() for _ in range(count)]
    free = list(workers)

    def outcome(cell: Cell) -> Outcome:
        worker = free.pop()
        try:
            return worker.outcome(work, cell, limit)
        finally:
            free.append(worker)

    executor = ThreadPoolExecutor(count)
    try:
        yield Pool("the local cores", 2 * count, lambda cell: executor.submit(outcome, cell))
    finally:
        for worker in workers:
            worker.close()
        executor.shutdown(cancel_futures=True)


ANSWER = 4.0
"""How long [s] a scheduler may take to answer."""
ABSENCE = 30.0
"""How long [s] a cluster may be without workers: more than a nanny needs to start one again."""
WINDOW = 1000
"""Cells handed to the scheduler at once: more than its threads, few enough to be quick."""
_own = threading.local()
"""A thread of a dask worker has a worker of ours."""


@contextmanager
def cluster_pool(work: Work, limit: float | None, address: str) -> Iterator[Pool]:
    """The workers of the scheduler at `address`, each with a process of its own for every thread.

    Raises InputError where dask is not installed, none answers, or the workers have other versions
    than we have; its check raises it where all workers have gone.
    """
    try:
        distributed = import_module("distributed")  # whose calls have no types
    except ImportError:
        raise InputError(
            "a cluster needs dask: install the extra, pip install 'robotball[cluster]'"
        ) from None
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # we say it in a line
    try:
        client = distributed.Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"no dask scheduler answers at {address}: {reason(error)}; give the address that "
            "`dask scheduler` prints, such as tcp://127.0.0.1:8786"
        ) from None

    def check() -> None:
        try:
            client.wait_for_workers(1, timeout=ABSENCE)
        except OSError:  # as a TimeoutError is
            raise InputError(
                f"all workers of {address} have gone: start some, and this again to go on"
            ) from None

    with client:
        _check_workers(client, address)
        executor = client.get_executor(pure=False)
        yield Pool(
            address,
            WINDOW,
            lambda cell: executor.submit(_outcome, work, cell, limit),
            (distributed.KilledWorker,),
            check,
        )


def _outcome(work: Work, cell: Cell, limit: float | None) -> Outcome:
    """Return the outcome of a cell, run in a process of this thread of a dask worker."""
    # A nanny makes its worker a daemon, which may start none lest they outlive it: ours do not.
    multiprocessing.current_process().daemon = False
    worker: Worker = _own.__dict__.setdefault("worker", Worker())
    return worker.outcome(work, cell, limit)


def _check_workers(client: Any, address: str) -> None:
    try:
        workers = client.run(versions)
    except Exception as error:
        raise InputError(
            f"the workers at {address} do not run robotball: {reason(error)}; install it there"
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


def sweep(
    work: Work,
    cells: Sequence[Cell],
    file: Path,
    *,
    workers: int | None = None,
    cluster: str | None = None,
    limit: float | None = None,
    show: Show | None = None,
) -> list[Result]:
    """The results of `work` on every cell, in the order of `cells`.

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
    other versions or that can't be read or written, and where no process starts, or the cluster
    does not answer or loses its workers.
    """
    distinct = _distinct(cells)
    if limit is not None:
        check_positive("limit", limit, "s")
    with journal(file, work) as kept:
        missing = [cell for key, cell in distinct.items() if key not in kept.results]
        there = [kept.results[key] for key in distinct if key in kept.results]
        progress = Progress(show, there, len(cells))
        if missing:
            with _pool(work, limit, workers, cluster, len(missing)) as pool:
                for line in pool.lines(missing):
                    progress.add(kept.add(line))
        return [kept.results[key] for key in distinct]


def _distinct(cells: Sequence[Cell]) -> dict[str, Cell]:
    """The cells by their identities."""
    distinct: dict[str, Cell] = {}
    for cell in cells:
        try:
            key = identity(cell)
        except (ValueError, TypeError) as error:
            raise InputError(f"a cell must be plain data, as JSON has it: {error}") from None
        if key in distinct:
            raise InputError(f"cells must be distinct, and {key} is there twice")
        distinct[key] = cell
    return distinct


def _pool(
    work: Work, limit: float | None, workers: int | None, cluster: str | None, count: int
) -> AbstractContextManager[Pool]:
    if cluster is not None:
        if workers is not None:
            raise InputError("a cluster has its own workers: give one of workers and cluster")
        return cluster_pool(work, limit, cluster)
    chosen = cores() if workers is None else check_count("workers", workers, 1)
    return local_pool(work, limit, min(chosen, count))


class Progress:
    """Report to `show` after every result; those there `before` say nothing about the speed."""

    def __init__(self, show: Show | None, before: Sequence[Result], total: int) -> None:
        self.show, self.total = show, total
        self.before = self.done = len(before)
        self.failed = sum(result.failure is not None for result in before)
        self.start = time.monotonic()
        self._tell()

    def add(self, result: Result) -> None:
        """Counts one more."""
        self.done += 1
        self.failed += result.failure is not None
        self._tell()

    def _tell(self) -> None:
        if self.show is None:
            return
        words = [f"{self.done} of {self.total} cells"]
        if self.failed:
            words.append(f"{self.failed} failed")
        if self.before < self.done < self.total:
            each = (time.monotonic() - self.start) / (self.done - self.before)
            words.append(f"{duration(each * (self.total - self.done))} left")
        self.show(self.done, ", ".join(words))


def duration(seconds: float) -> str:
    """A time to come, as precisely as it can be known."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
