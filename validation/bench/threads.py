"""Measure many motions on one core and on all, in turn; a part of `make bench`.

The digits must be the same. Beside each ratio stands what plain processes reach, one a core, each
of which does the one core's work for itself: cores that share caches, memory and clock are not as
fast together as alone.
"""

import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from robotball import load_scene
from robotball.engines.ensembles.orbits import orbits
from robotball.processes import Answer, allowed, at_most, cores, pool
from robotball.qualitative.long_run import basins, exponents
from robotball.qualitative.sections import section, section_starts
from validation.output import plain_table
from validation.studies.portrait_maps import PLANES, cells_of, measure
from validation.sweeps import sweep

_ROUNDS = {"portraits": 3}
_OTHER_ROUNDS = 9
_FIG_11B = load_scene("fig14").parameters
_MANY, _SOME = 4096, 512
_TIMES = np.array([0.0, 100.0])
_CELLS = cells_of(PLANES["axial"], 10)

_Digits = NDArray[Any]
_Work = Callable[[], _Digits]


def work() -> dict[str, _Work]:
    """Return the functions that are timed, by name; each returns its digits."""
    rng = np.random.default_rng(1)
    starts = section_starts(rng.uniform(-4, 4, _MANY), rng.uniform(0, 6, _MANY), 25.0)
    some = starts[0][:_SOME], starts[1][:_SOME]

    def portraits() -> _Digits:
        with tempfile.TemporaryDirectory() as folder:
            found = sweep(measure, _CELLS, Path(folder, "cells.jsonl"), workers=allowed())
        return np.array([each.record for each in found])

    return {
        "ensemble": lambda: orbits(_FIG_11B, *starts, _TIMES, 1e-9).contact_points,
        "section": lambda: section(_FIG_11B, *starts, 25, tolerance=1e-9).times,
        "exponents": lambda: exponents(_FIG_11B, *some, 1000.0, 100.0).largest,
        "basins": lambda: basins(_FIG_11B, *some, 500.0).labels,
        "portraits": portraits,
    }


@cache
def _plain_work() -> dict[str, _Work]:
    """Return the functions of a plain process; of the portraits it does a few, by itself."""
    return work() | {"portraits": lambda: np.array([measure(cell) for cell in _CELLS[::10]])}


def _main() -> None:
    """Print the table."""
    console, everyone = Console(), cores()
    console.print(
        f"The best of {_OTHER_ROUNDS} rounds, of the portraits {_ROUNDS['portraits']}, on one core "
        f"and on {everyone} in\nturn: another's work on the machine slows some rounds, and the "
        f"best least.\nbound: how many times as much {everyone} plain processes do as one alone."
    )
    headings = ("", "1 core [ms]", f"{everyone} cores [ms]", "ratio", "bound")
    table = plain_table(headings, left=(), padding=(0, 1), show_edge=True)
    with pool(_do_plainly, everyone) as submit:
        for name, run in work().items():
            counts = (1, everyone)
            best = {(kind, count): np.inf for kind in ("ours", "plain") for count in counts}
            digits: list[_Digits] = []
            for done in range(1 + _ROUNDS.get(name, _OTHER_ROUNDS)):
                for count in counts:
                    with at_most(count):
                        began = time.perf_counter()
                        digits.append(run())
                        ours = time.perf_counter() - began
                    plain = _seconds_together(submit, name, count)
                    if done:  # the first round warms up
                        best["ours", count] = min(best["ours", count], ours)
                        best["plain", count] = min(best["plain", count], plain)
            assert all(np.array_equal(each, digits[0]) for each in digits), name
            one, all_of_them = (best["ours", count] for count in counts)
            bound = everyone * best["plain", 1] / best["plain", everyone]
            numbers = (f"{one * 1e3:.0f}", f"{all_of_them * 1e3:.0f}", f"{one / all_of_them:.2f}")
            table.add_row(name, *numbers, f"{bound:.2f}")
    console.print(table)


def _seconds_together(submit: Callable[..., Future[Answer]], name: str, count: int) -> float:
    """Return the seconds of so many processes at a named work, each for itself."""
    began = time.perf_counter()
    for future in [submit(name) for _ in range(count)]:
        future.result()
    return time.perf_counter() - began


def _do_plainly(name: str) -> None:
    """Do a named work in a process of its own, where one thread is allowed."""
    _plain_work()[name]()


if __name__ == "__main__":
    _main()
