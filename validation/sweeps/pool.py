"""Processes to run cells in, wherever they are."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from itertools import islice
from queue import SimpleQueue

from validation.sweeps.cells import Cell

DIED = "ended its process"
"""Why a cell has no record that took its process with it."""


@dataclass(frozen=True)
class Pool:
    """Where cells run.

    place: as the user knows it; window: how many cells to have handed in at once, enough to keep
    every process busy; death: why a cell's process died, by what its future raised, or None if it
    did not.
    """

    place: str
    window: int
    submit: Callable[[Cell], "Future[str]"]
    death: Callable[[BaseException], str | None]

    def run(self, cells: Iterable[Cell], at_once: int) -> Iterator[tuple[Cell, "Future[str]"]]:
        """The cells with their futures, each as soon as it is done; `at_once` are handed in."""
        waiting = iter(cells)
        running: dict[Future[str], Cell] = {}
        done: SimpleQueue[Future[str]] = SimpleQueue()

        def hand_in(count: int) -> None:
            for cell in islice(waiting, count):
                future = self.submit(cell)
                running[future] = cell
                future.add_done_callback(done.put)

        hand_in(at_once)
        while running:
            future = done.get()
            hand_in(1)
            yield running.pop(future), future
