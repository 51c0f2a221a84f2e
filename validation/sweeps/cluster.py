"""A dask cluster that runs already."""

from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from robotball import InputError
from validation.output import versions
from validation.sweeps.attempt import attempt, reason
from validation.sweeps.cells import Cell, Work
from validation.sweeps.pool import DIED, Pool

ANSWER = 4.0
"""How long [s] a scheduler may take to answer."""
WINDOW = 1000
"""Cells handed to the scheduler at once: more than its threads, few enough to be quick."""


@contextmanager
def cluster_pool(work: Work, limit: float | None, address: str) -> Iterator[Pool]:
    """The workers of the scheduler at `address`.

    Raises InputError where dask is not installed, none answers, or the workers have other versions
    than we have.
    """
    try:
        distributed = import_module("distributed")  # whose calls have no types
    except ImportError:
        raise InputError(
            "a cluster needs dask: install the extra, pip install 'robotball[cluster]'"
        ) from None

    def submit(cell: Cell) -> "Future[str]":
        return executor.submit(attempt, work, cell, limit, False)

    def death(error: BaseException) -> str | None:
        return DIED if isinstance(error, distributed.KilledWorker) else None

    try:
        client = distributed.Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"no dask scheduler answers at {address}: {reason(error)}; give the address that "
            "`dask scheduler` prints, such as tcp://127.0.0.1:8786"
        ) from None
    with client:
        _check_workers(client, address)
        executor = client.get_executor(pure=False)
        yield Pool(address, WINDOW, submit, death)


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
