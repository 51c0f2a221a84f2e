"""The cores of this machine, by joblib's processes."""

import os
import re
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from typing import Any

from validation.sweeps.attempt import attempt
from validation.sweeps.cells import Cell, Work
from validation.sweeps.limit import too_long
from validation.sweeps.pool import DIED, Pool

IDLE = 60.0
"""How long [s] a process waits for the next cell, or for the next sweep, before it ends."""
WATCH = 0.5
"""How often [s] a process looks whether the one that started it still lives."""


@contextmanager
def local_pool(work: Work, limit: float | None, workers: int) -> Iterator[Pool]:
    """So many processes, each with one thread, started when first needed.

    They outlive the block a while, to serve the next sweep; an exception in the block ends them,
    and so does the end of this process.
    """
    from joblib.externals.loky import get_reusable_executor
    from joblib.externals.loky.process_executor import TerminatedWorkerError
    from joblib.parallel import ParallelBackendBase

    def executor() -> Any:
        """The one there is, or a new one if its processes died."""
        return get_reusable_executor(
            workers,
            timeout=IDLE,
            env=dict.fromkeys(ParallelBackendBase.MAX_NUM_THREADS_VARS, "1"),
            initializer=_live_with,
            initargs=(os.getpid(),),
        )

    def submit(cell: Cell) -> "Future[str]":
        task = partial(attempt, work, cell, limit, own_process=True)
        try:
            return executor().submit(task)
        except BrokenProcessPool:  # it died since we asked for it
            return executor().submit(task)

    def death(error: BaseException) -> str | None:
        if not isinstance(error, TerminatedWorkerError):
            return None
        status = re.findall(r"\w+\(-?\d+\)", str(error))[:1]
        if limit is not None and status == [f"SIGALRM({-signal.SIGALRM})"]:
            return too_long(limit)
        return ": ".join([DIED, *status])

    try:
        yield Pool("the local cores", 2 * workers, submit, death)
    except BaseException:
        executor().shutdown(kill_workers=True)
        raise


def _live_with(parent: int) -> None:
    """Leaves Ctrl-C to the parent, and ends this process when the parent has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(WATCH)
    os._exit(0)
