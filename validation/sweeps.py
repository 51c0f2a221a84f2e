"""Run many cells on this machine's cores without losing results.

A cell is plain data. Each result is written to the sweep's journal immediately, as a line of JSON,
so a killed sweep can be continued. Cells run in the processes of `robotball.processes`, which can
be killed at any time, even in compiled code, if a cell exceeds its time limit.
"""

import fcntl
import json
import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import msgspec

from robotball import InputError
from robotball.errors import check_count, check_positive
from robotball.files import json_text, readable
from robotball.files.replacing import no_regular_file
from robotball.motion import versions
from robotball.processes import Answer, EndedError, cores, pool

from .output import Show, writable_file

Cell = Mapping[str, Any]
"""Plain JSON data that describes a run completely, and identifies it."""
Work = Callable[[Cell], Mapping[str, Any]]
"""A module's function of a cell. Its record is plain data, with None for missing numbers."""
_OUTLASTED = "took longer than"  # first words of the failure of a cell that exceeded its time limit
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
    limit: float | None = None,
    show: Show = lambda *_: None,
) -> list[Result]:
    """Return the results of `work` on every cell, in the order of `cells`.

    If a cell raises, ends its process or exceeds the limit, only this cell fails. A cell whose
    process died is run again alone, because something else may have killed the process.

    Parameters
    ----------
    work : callable
        A module's function.
    cells : sequence of mappings
        Distinct plain data.
    file : Path
        The journal. If it exists, only the missing cells are run. It may also contain results of
        other sweeps of the same work. Failures are kept. Delete a line to run its cell again, or
        delete the file to run all cells, for example after a change of the work.
    workers : int, optional
        The number of processes on this machine. The default is the number of available cores.
    limit : float, s, optional
        The time limit of a cell, without the time in which the machine sleeps.
    show : callable
        Called with the number of cells done, and with the number of failures and the time left.

    Raises
    ------
    InputError
        If cells are not distinct plain data, if the journal is from another work or other versions
        or cannot be read or written, or if no process starts.
    """
    distinct = _distinct(cells)
    if limit is not None:
        check_positive("limit", limit, "s")
    count = cores() if workers is None else check_count("workers", workers, 1)
    with _journal(file, work) as kept:
        missing = [cell for key, cell in distinct.items() if key not in kept.results]
        # The file may have results of other sweeps, which do not count.
        before = [kept.results[key] for key in distinct if key in kept.results]
        report = _reporter(show, before, len(cells))
        if missing:
            for line in _lines(work, missing, limit, min(count, len(missing))):
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
            f"another sweep is writing {path}: wait until it ends, or {_ELSEWHERE}"
        ) from None
    except OSError as error:
        raise InputError(f"{path} cannot be used: {error.strerror or error}") from None


def _continued(file: BinaryIO, path: Path, work: Work) -> dict[str, Result]:
    """Lock the file, check or write its header, remove a partial last line; return its results."""
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # locked until the file is closed
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
    while rest:  # a full disk may accept only a part
        rest = rest[file.write(rest) :]
    # The result must survive a failure of the machine.
    os.fsync(file.fileno())


def _check_header(line: bytes, ours: dict[str, Any], path: Path) -> None:
    with readable(f"{path} is not the journal of a sweep: move the file, or {_ELSEWHERE}"):
        theirs = json.loads(line)
        work, made_by = theirs["work"], dict(theirs["versions"])
    if work != ours["work"]:
        raise InputError(
            f"{path} is the journal of {work}, not of {ours['work']}: move it, or {_ELSEWHERE}"
        )
    for part, version in ours["versions"].items():
        if made_by.get(part) != version:
            raise InputError(
                f"{path} was made with {part} {made_by.get(part)}, but now {version} is used, and "
                f"results would be mixed: delete the file, or {_ELSEWHERE}"
            )


def _lines(work: Work, cells: Sequence[Cell], limit: float | None, count: int) -> Iterator[str]:
    """Run cells in `count` processes and yield their results as soon as they are known."""
    with pool(partial(_result_line, work), count) as submit:
        waiting, died = iter(cells), []
        # Two cells for each process keep all of them busy.
        running = {submit(cell, limit): cell for cell in islice(waiting, 2 * count)}
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED)[0]:
                cell = running.pop(future)
                try:
                    yield _line_of(future, cell, limit)
                except EndedError:
                    died.append(cell)
                running |= {submit(cell, limit): cell for cell in islice(waiting, 1)}
        # All cells together may have needed too much memory, so these run again one at a time.
        for cell in died:
            try:
                yield _line_of(submit(cell, limit), cell, limit)
            except EndedError as ended:
                yield _to_line(cell, None, _death(ended.status or 0))


def _line_of(future: Future[Answer], cell: Cell, limit: float | None) -> str:
    """Return the result of a cell. Raises EndedError if its process died."""
    try:
        return future.result()[0]
    except EndedError as ended:
        if ended.status is not None:
            raise
        return _to_line(cell, None, f"{_OUTLASTED} {limit:g} s")
    except ChildProcessError as error:
        raise InputError(f"no cells can run on the local cores: {_reason(error)}") from None


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
