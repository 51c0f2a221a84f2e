"""Everything that is compiled, compiled ahead of its first use, as set-up does."""

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

from robotball.robot.formulas import ROLLING_MODELS
from robotball.theory.compiled import Compiled
from robotball.theory.ensembles import crossings, orbits, steppers
from robotball.theory.ensembles.flatten import FEW, LANES
from robotball.theory.multibody import derivative


def compile_all() -> None:
    """Compile all that is compiled, or load it, and show how much is done."""
    jobs: list[Callable[[], Any]] = [
        partial(getattr, function, "code")
        for module in (derivative, orbits, crossings)
        for function in vars(module).values()
        if isinstance(function, Compiled)
    ]
    for rolling in ROLLING_MODELS:
        jobs.append(partial(steppers.stepper, steppers.PATH, rolling, FEW))
        for system in (steppers.PATH, steppers.RETURN, steppers.ARC, steppers.DEVIATION):
            jobs.append(partial(steppers.stepper, system, rolling, LANES))
    on_terminal = sys.stderr.isatty()
    for done, job in enumerate(jobs, 1):
        job()
        last = done == len(jobs)
        # A terminal shows one line that counts up; a log gets the last one alone.
        if on_terminal or last:
            line = f"robotball: compiled {done} of {len(jobs)}"
            print(line, end="\n" if last else "\r", file=sys.stderr, flush=True)
