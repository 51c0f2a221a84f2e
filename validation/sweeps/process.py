"""A process that runs one cell after another, and is ended where one outlasts its limit.

It shares a pipe with the process that started it and nothing with any other, so that no lock stays
taken whenever it is killed.
"""

import fcntl
import multiprocessing
import os
import signal
from collections.abc import Mapping
from concurrent.futures import CancelledError
from contextlib import suppress
from multiprocessing.connection import Connection

from robotball.processes import CHILDREN, FORKSERVER, for_a_worker
from robotball.threads import at_most
from validation.sweeps.cells import OUTLASTED, Cell, Work, reason, to_line

IDLE = 60.0
"""How long [s] a process waits for the next cell before it ends."""
PARTS = 20
"""A limit is waited for in so many parts; however long we are stopped, it takes one of them."""
TRIES = 10
"""How often a process is asked to begin a cell, and started again where it was idle or killed."""
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
        FORKSERVER.set_forkserver_preload([work.__module__, __name__])
        self._pipe, theirs = FORKSERVER.Pipe()
        process = FORKSERVER.Process(target=_serve, args=(theirs,), daemon=True)
        with theirs, for_a_worker(work.__module__):
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
    """What the process does: of each cell it says that it begins, and then its line."""
    _end_with_parent()
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while pipe.poll(IDLE):
            work, cell = pipe.recv()
            pipe.send(None)
            pipe.send(_line(work, cell))


def _end_with_parent() -> None:
    """Has SIGIO end this process when a pipe closes that multiprocessing opens in the parent.

    It needs no step in Python, so it ends compiled code too. Where the system ignores SIGIO, as
    macOS does, the process ends after its cell.
    """
    parent = multiprocessing.parent_process()
    assert parent is not None
    end_when_closed(parent.sentinel)


def end_when_closed(pipe: int) -> None:
    """Has SIGIO end this process when the other end of a pipe closes."""
    fcntl.fcntl(pipe, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(pipe, fcntl.F_SETFL, os.O_ASYNC)


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
