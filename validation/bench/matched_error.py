"""Tools compared at the same error: every one at several tolerances, all in turn.

The least processor time of several rounds, of all threads together, is set against the error, and
times are compared at one error, read off between tolerances; set-up and compilation are outside the
clock.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Run = Callable[[], Any]


@dataclass
class Contender:
    """One tool at one task, and what was measured of it.

    prepare: tolerance -> what is timed; error: of what that returns; work: how much of it a run
    does, in the units of the table; seconds, errors: by tolerance, the seconds per unit of work.
    """

    name: str
    prepare: Callable[[float], Run]
    error: Callable[[Any], float]
    tolerances: tuple[float, ...]
    work: float = 1.0
    rounds: int = 7
    seconds: dict[float, float] = field(default_factory=dict)
    errors: dict[float, float] = field(default_factory=dict)

    def at(self, error: float) -> float:
        """The time at an error [s], by a power law between the two nearest tolerances."""
        order = sorted(self.tolerances, key=self.errors.__getitem__)
        errors, seconds = ([values[t] for t in order] for values in (self.errors, self.seconds))
        if not errors[0] <= error <= errors[-1]:
            raise ValueError(f"{self.name} was not measured at an error of {error:g}: {errors}")
        return float(np.exp(np.interp(np.log(error), np.log(errors), np.log(seconds))))


def compare(title: str, error: float, *contenders: Contender) -> None:
    """Time all contenders in turn and print a table, with ratios to the first at one error."""
    runs = [(c, t, c.prepare(t)) for c in contenders for t in c.tolerances]
    for contender, tolerance, run in runs:
        contender.errors[tolerance] = contender.error(run())
    for i in range(max(c.rounds for c in contenders)):
        for contender, tolerance, run in runs:
            if i < contender.rounds:
                begin = time.process_time()
                run()
                seconds = (time.process_time() - begin) / contender.work
                best = contender.seconds.get(tolerance, np.inf)
                contender.seconds[tolerance] = min(best, seconds)
    print(f"\n{title}\n{'':24}tolerance   error        µs")
    for contender in contenders:
        for t in contender.tolerances:
            micro = contender.seconds[t] * 1e6
            print(f"  {contender.name:22}{t:9.0e}{contender.errors[t]:9.1e}{micro:11.1f}")
    ours = contenders[0].at(error)
    for other in contenders[1:]:
        print(f"  at error {error:.0e} {other.at(error) / ours:.2f} times as fast as {other.name}")
