"""`make bench`: many motions on one core and on all, in turn; the digits must be the same.

Beside each ratio stands what plain processes reach, one a core, each of which does the one core's
work for itself: cores that share caches, memory and clock are not as fast together as alone.
"""

import multiprocessing
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table

from robotball.cores import allowed, at_most, cores
from robotball.engines.ensembles.orbits import orbits
from robotball.equations import Parameters
from robotball.qualitative.basins import basins
from robotball.qualitative.long_run import exponents
from robotball.qualitative.sections import section, section_starts
from validation.studies.portrait_maps import PLANES, cells_of, measure
from validation.sweeps import sweep

ROUNDS = {"portraits": 3}
OTHER_ROUNDS = 9
D = 0.9
I = (1 / 0.8 - D, 1 / 0.6 - D, 1 / 0.7 - D)
FIG_11B = Parameters("rubber", I, D, 1.0, (0.0, 0.0, 2.0), (2.0, 3.0, 0.0))
MANY, SOME = 4096, 512
TIMES = np.array([0.0, 100.0])
CELLS = cells_of(PLANES["axial"], 10)

Digits = NDArray[Any]
Work = Callable[[], Digits]


def work() -> dict[str, Work]:
    """What is timed, by name, with its digits."""
    rng = np.random.default_rng(1)
    starts = section_starts(rng.uniform(-4, 4, MANY), rng.uniform(0, 6, MANY), 25.0)
    some = starts[0][:SOME], starts[1][:SOME]

    def portraits() -> Digits:
        with tempfile.TemporaryDirectory() as folder:
            found = sweep(measure, CELLS, Path(folder, "cells.jsonl"), workers=allowed())
        return np.array([each.record for each in found])

    return {
        "ensemble": lambda: orbits(FIG_11B, *starts, TIMES, 1e-9).contact_points,
        "section": lambda: section(FIG_11B, *starts, 25, tolerance=1e-9).times,
        "exponents": lambda: exponents(FIG_11B, *some, 1000.0, 100.0).largest,
        "basins": lambda: basins(FIG_11B, *some, 500.0).labels,
        "portraits": portraits,
    }


def plain_work() -> dict[str, Work]:
    """What a plain process does of each; of the portraits a few, by itself."""
    return work() | {"portraits": lambda: np.array([measure(cell) for cell in CELLS[::10]])}


def main() -> None:
    """The table."""
    console, everyone = Console(), cores()
    console.print(
        f"The best of {OTHER_ROUNDS} rounds, of the portraits {ROUNDS['portraits']}, on one core "
        f"and on {everyone} in\nturn: another's work on the machine slows some rounds, and the "
        f"best least.\nbound: how many times as much {everyone} plain processes do as one alone."
    )
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("", "1 core [ms]", f"{everyone} cores [ms]", "ratio", "bound"):
        table.add_column(heading, justify="right")
    with plain_processes(everyone) as together:
        for name, run in work().items():
            counts = (1, everyone)
            best = {(kind, count): np.inf for kind in ("ours", "plain") for count in counts}
            digits: list[Digits] = []
            for done in range(1 + ROUNDS.get(name, OTHER_ROUNDS)):
                for count in counts:
                    with at_most(count):
                        began = time.perf_counter()
                        digits.append(run())
                        ours = time.perf_counter() - began
                    plain = together(name, count)
                    if done:  # the first round warms up
                        best["ours", count] = min(best["ours", count], ours)
                        best["plain", count] = min(best["plain", count], plain)
            assert all(np.array_equal(each, digits[0]) for each in digits), name
            one, all_of_them = (best["ours", count] for count in counts)
            bound = everyone * best["plain", 1] / best["plain", everyone]
            numbers = (f"{one * 1e3:.0f}", f"{all_of_them * 1e3:.0f}", f"{one / all_of_them:.2f}")
            table.add_row(name, *numbers, f"{bound:.2f}")
    console.print(table)


@contextmanager
def plain_processes(most: int) -> Iterator[Callable[[str, int], float]]:
    """What gives the seconds that so many processes take for a named work, each for itself."""
    context = multiprocessing.get_context("spawn")
    pipes, processes = [], []
    for _ in range(most):
        ours, theirs = context.Pipe()
        process = context.Process(target=serve, args=(theirs,), daemon=True)
        process.start()
        pipes.append(ours)
        processes.append(process)

    def together(name: str, count: int) -> float:
        began = time.perf_counter()
        for pipe in pipes[:count]:
            pipe.send(name)
        for pipe in pipes[:count]:
            pipe.recv()
        return time.perf_counter() - began

    yield together
    for process in processes:
        process.terminate()


def serve(pipe: Connection) -> None:
    """Does what it is told, on one core."""
    works = plain_work()
    with at_most(1):
        while True:
            works[pipe.recv()]()
            pipe.send(None)


if __name__ == "__main__":
    main()
