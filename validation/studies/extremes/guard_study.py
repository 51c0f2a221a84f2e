"""Does the guard miss what fails, and does it cry wolf? Two seeded sets of random runs.

A run has failed where its path is over a tenth of its length off the equations', or where it broke
off; the guard has told where the check before it or the watch during it said anything.
"""

import logging
import sys
import warnings
from collections import Counter
from dataclasses import dataclass

from robotball import InputError, integrate
from robotball.engines.mujoco.precheck import check
from validation.comparison.agreement import compare
from validation.studies.extremes.random_runs import Run, extreme, ordinary

SEED = 20270101
RUNS = 500
REFERENCE_STEPS = 20_000  # of the equations; runs that need more are not judged
FAILED = 0.1  # of the path's length


@dataclass(frozen=True)
class Outcome:
    """What came of a run: its path error (None where it broke off) and what the guard said."""

    run: Run
    path_error: float | None
    within: bool
    warned: tuple[str, ...]
    faults: tuple[str, ...]
    refused: str = ""

    @property
    def told(self) -> bool:
        return bool(self.warned or self.faults or self.refused)

    @property
    def failed(self) -> bool:
        return not self.refused and (self.path_error is None or not self.path_error <= FAILED)

    @property
    def missed(self) -> bool:
        return self.failed and not self.told

    @property
    def false_alarm(self) -> bool:
        return self.told and self.within


def outcome(run: Run) -> Outcome:
    """Both engines' motions of a run, and what the guard said of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            theory = integrate(run.scene, run.times, max_steps=REFERENCE_STEPS)
            warned = check(run.scene, run.settings, run.times)
            agreement = compare(run.scene, run.settings, theory=theory)
        except InputError as error:
            return Outcome(run, None, False, (), (), str(error))
    promise = run.settings.promise
    measured = (agreement.path_error, agreement.momentum_drift)
    return Outcome(
        run,
        agreement.path_error,
        all(value is not None and value <= promise for value in measured),
        tuple(map(str, warned)),
        tuple(map(str, agreement.faults)),
    )


def main(runs: int = RUNS, seed: int = SEED) -> None:
    """Run both sets and print what was missed and what was cried in vain."""
    logging.getLogger("absl").setLevel(logging.ERROR)
    counts: Counter[str] = Counter()
    for number in range(runs):
        each = outcome(extreme(seed, number))
        counts["refused"] += bool(each.refused)
        counts["failed"] += each.failed
        counts["told before"] += each.failed and bool(each.warned)
        counts["told during"] += each.failed and bool(each.faults)
        counts["silent and sound"] += not each.told and not each.failed
        counts["missed"] += each.missed
        if each.missed:
            print("missed:", number, each.run.scene.name, each.run.axes, each.path_error)
    print(f"{runs} extreme runs:", dict(counts))
    cried = []
    for number in range(runs):
        each = outcome(ordinary(seed, number))
        if each.refused:
            print("refused:", number, each.refused)
        if each.false_alarm:
            cried.append(number)
            print(
                "false alarm:",
                number,
                each.run.scene.name,
                each.run.settings.name,
                *each.warned,
                *each.faults,
            )
    print(f"{runs} ordinary runs: {len(cried)} false alarms")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
