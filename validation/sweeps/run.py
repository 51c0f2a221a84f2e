"""A sweep: every cell's result, in spite of cells that fail and of being killed."""

import time
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from robotball import InputError
from robotball.errors import check_count, check_positive
from robotball.threads import cores
from validation.progress import Show
from validation.sweeps.cells import Cell, Result, Work, identity
from validation.sweeps.cluster import cluster_pool
from validation.sweeps.journal import journal
from validation.sweeps.pool import Pool, local_pool


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
    """Tells `show` after every result; those there `before` say nothing about the speed."""

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
