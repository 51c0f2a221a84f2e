"""A sweep: every cell's result, in spite of cells that fail and of being killed."""

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager, closing
from functools import partial
from pathlib import Path

from robotball import InputError
from robotball.errors import check_count, check_positive
from validation.progress import Show
from validation.sweeps.attempt import reason
from validation.sweeps.cells import Cell, Result, Work, identity, to_line
from validation.sweeps.cluster import cluster_pool
from validation.sweeps.journal import journal
from validation.sweeps.local import local_pool
from validation.sweeps.pool import Pool
from validation.sweeps.progress import Progress


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

    workers: processes on this machine, as many as it has cores if None; cluster: the tcp:// address
    of a dask scheduler to run on instead, whose workers need the same packages but not this file;
    limit: s after which a cell is given up; show: called with the number of cells done and with
    how many failed and the time left.

    A cell that raises, ends its process or outlasts the limit fails alone: those that ran beside
    it are run again. The limit takes effect at the next step in Python; where a call of compiled
    code does not return the process is ended at twice the limit, but not so on a cluster.

    Raises InputError on cells that are not distinct plain data, on a file of another work or of
    other versions, and where the cluster does not answer.
    """
    distinct = _distinct(cells)
    if limit is not None:
        check_positive("limit", limit, "s")
    with journal(file, work) as kept:
        missing = [cell for key, cell in distinct.items() if key not in kept.results]
        there = [kept.results[key] for key in distinct if key in kept.results]
        progress = Progress(show, there, len(cells))
        pools = partial(_pool, work, limit, workers, cluster)
        with closing(_lines(pools, missing)) as lines:
            for line in lines:
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
    from joblib import cpu_count  # the usable ones

    chosen = cpu_count() if workers is None else check_count("workers", workers, 1)
    return local_pool(work, limit, min(chosen, count))


def _lines(
    pools: Callable[[int], AbstractContextManager[Pool]], cells: Sequence[Cell]
) -> Generator[str, None, None]:
    """The cells' results as lines, each as soon as it is known; pools: for so many cells.

    When a process dies nobody knows which of the cells handed in was to blame, so each of them is
    run again with no other beside it.
    """
    if not cells:
        return
    suspects = []
    with pools(len(cells)) as pool:
        for cell, future in pool.run(cells, pool.window):
            line, death = _outcome(pool, future)
            if death:
                suspects.append(cell)
            else:
                yield line
    if not suspects:
        return
    with pools(1) as pool:
        for cell, future in pool.run(suspects, 1):
            line, death = _outcome(pool, future)
            yield to_line(cell, None, death) if death else line


def _outcome(pool: Pool, future: "Future[str]") -> tuple[str, str | None]:
    """The line of a cell that is done, and why its process died, if it did."""
    try:
        return future.result(), None
    except Exception as error:
        death = pool.death(error)
        if death is None:
            raise InputError(f"no cells can run on {pool.place}: {reason(error)}") from None
        return "", death
