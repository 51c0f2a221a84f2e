"""`make bench`: many motions on one core and on all, in turn; the digits must be the same."""

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table

from robotball.engines.reduced.compiled.kernels import orbits
from robotball.parameters import Parameters
from robotball.qualitative.basins import basins
from robotball.qualitative.lyapunov import exponents
from robotball.qualitative.phase_portrait import phase_portrait
from robotball.qualitative.sections import section, section_starts
from robotball.threads import at_most, cores
from validation.studies.portraits.measure import PLANES

ROUNDS = 9
D = 0.9
I = (1 / 0.8 - D, 1 / 0.6 - D, 1 / 0.7 - D)
FIG_11B = Parameters("rubber", I, D, 1.0, (0.0, 0.0, 2.0), (2.0, 3.0, 0.0))
FIG_7 = PLANES["axial"].ball(1.0, 1.0)
MANY = 1024
TIMES = np.array([0.0, 100.0])

Digits = Sequence[NDArray[Any]]


def work() -> dict[str, Callable[[], Digits]]:
    """What is timed, by name, with its digits."""
    rng = np.random.default_rng(1)
    starts = section_starts(rng.uniform(-4, 4, MANY), rng.uniform(0, 6, MANY), 25.0)
    some = starts[0][:256], starts[1][:256]

    def portrait() -> Digits:
        found = phase_portrait(FIG_7)
        return np.array([cycle.period for cycle in found.cycles]), np.array(
            list(found.basins.values())
        )

    return {
        "ensemble": lambda: (orbits(FIG_11B, *starts, TIMES, 1e-9).contact_points,),
        "section": lambda: (section(FIG_11B, *starts, 25, tolerance=1e-9).times,),
        "exponents": lambda: (exponents(FIG_11B, *some, 1000.0, 100.0).largest,),
        "basins": lambda: (basins(FIG_11B, *some, 500.0).labels,),
        "portrait": portrait,
    }


def main() -> None:
    """The table."""
    console = Console()
    console.print(
        f"The best of {ROUNDS} rounds on one core and on {cores()}, in turn: another's work on the "
        "machine slows\nsome rounds, and the best least."
    )
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("", "1 core [ms]", f"{cores()} cores [ms]", "ratio"):
        table.add_column(heading, justify="right")
    for name, run in work().items():
        best = {1: np.inf, cores(): np.inf}
        digits: list[Digits] = []
        for _ in range(1 + ROUNDS):
            for count in best:
                with at_most(count):
                    began = time.perf_counter()
                    digits.append(run())
                    if len(digits) > len(best):  # the first round warms up
                        best[count] = min(best[count], time.perf_counter() - began)
        for each in digits:
            assert all(map(np.array_equal, each, digits[0])), name
        one, all_of_them = best[1], best[cores()]
        table.add_row(
            name, f"{one * 1e3:.0f}", f"{all_of_them * 1e3:.0f}", f"{one / all_of_them:.2f}"
        )
    console.print(table)


if __name__ == "__main__":
    main()
