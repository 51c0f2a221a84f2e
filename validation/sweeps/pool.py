"""Where cells run: on this machine, or, in cluster.py, on others."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from queue import Empty, SimpleQueue

from robotball import InputError
from validation.sweeps.cells import Cell, Work, reason, to_line
from validation.sweeps.process import Outcome, Worker

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

        def hand_in(count: int) -> None:
            for cell in islice(waiting, count):
                future = self.submit(cell)
                running[future] = cell
                future.add_done_callback(done.put)

        hand_in(self.window)
        while running:
            try:
                future = done.get(timeout=CHECK)
            except Empty:
                self.check()
            else:
                cell = running.pop(future)
                yield cell, self._outcome(cell, future)
                hand_in(1)

    def _outcome(self, cell: Cell, future: "Future[Outcome]") -> Outcome:
        try:
            return future.result()
        except self.killed:
            return to_line(cell, None, "ended its worker"), True
        except CancelledError:  # by dask, whose scheduler does not answer
            raise InputError(f"{self.place} has gone: start it, and this again to go on") from None
        except Exception as error:
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
