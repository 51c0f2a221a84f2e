"""A dask cluster that runs already."""

import logging
import multiprocessing
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from robotball import InputError
from validation.output import versions
from validation.sweeps.cells import Cell, Work, reason
from validation.sweeps.pool import Pool
from validation.sweeps.process import Outcome, Worker

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
    """What comes of a cell in a process of this thread of a dask worker."""
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
