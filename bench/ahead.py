"""Compile everything before its first use: python -m bench.ahead, as `make setup` does."""

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

from robotball.robot.formulas import ROLLING_MODELS
from robotball.theory.ensembles import crossings, orbits, steppers
from robotball.theory.ensembles.flatten import FEW, LANES
from robotball.theory.multibody import derivative

_LOOPS: tuple[Any, ...] = (
    derivative.differentiate_stages,
    orbits.march_lanes,
    orbits.follow,
    crossings.cross,
)
# Compiled for each rolling model, with the number of lanes.
_SYSTEMS = (steppers.PATH, steppers.RETURN, steppers.ARC, steppers.DEVIATION)
_STEPS = ((steppers.PATH, FEW), *((system, LANES) for system in _SYSTEMS))


def compile_all() -> None:
    """Compile or load all machine code, and show the progress on standard error."""
    jobs: list[Callable[[], Any]] = [partial(getattr, loop, "code") for loop in _LOOPS]
    for rolling in ROLLING_MODELS:
        jobs += [partial(steppers.stepper, system, rolling, lanes) for system, lanes in _STEPS]
    on_terminal = sys.stderr.isatty()
    for done, job in enumerate(jobs, 1):
        job()
        last = done == len(jobs)
        # A terminal shows one line that counts up, a log only the last line.
        if on_terminal or last:
            line = f"robotball: compiled {done} of {len(jobs)}"
            print(line, end="\n" if last else "\r", file=sys.stderr, flush=True)


if __name__ == "__main__":
    compile_all()
