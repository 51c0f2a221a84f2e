"""Are failures missed, and are alarms false? Two seeded sets of random runs.

A run has failed where its path is over a tenth of its length off the equations', or where it broke
off. It is reported where the precheck warned of it or the monitor found a fault.
"""

import logging
import warnings
from collections import Counter
from dataclasses import dataclass
from typing import Any

from robotball import InputError, integrate
from robotball.engines.mujoco.precheck import exceeded
from validation.comparison.agreement import compare
from validation.progress import Show
from validation.studies.extremes.measure import WRONG
from validation.studies.extremes.random_runs import RandomRun, extreme, ordinary

REFERENCE_STEPS = 20_000  # of the equations; runs that need more are not judged


@dataclass(frozen=True)
class Judged:
    """What came of a run: its path error (None where it broke off) and what was said of it.

    within: whether its errors are within its tolerance; warned: by the precheck; refused: why it
    was not run, if it was not.
    """

    run: RandomRun
    path_error: float | None
    within: bool
    warned: tuple[str, ...]
    faults: tuple[str, ...]
    refused: str = ""

    @property
    def reported(self) -> bool:
        return bool(self.warned or self.faults or self.refused)

    @property
    def failed(self) -> bool:
        return not self.refused and (self.path_error is None or not self.path_error <= WRONG)

    @property
    def missed(self) -> bool:
        return self.failed and not self.reported

    @property
    def false_alarm(self) -> bool:
        return self.reported and self.within


@dataclass(frozen=True)
class Detection:
    """What was missed among the extreme runs, and which alarms of ordinary ones were false."""

    extreme: tuple[Judged, ...]
    ordinary: tuple[Judged, ...]

    @property
    def missed(self) -> list[Judged]:
        return [each for each in self.extreme if each.missed]

    @property
    def false_alarms(self) -> list[Judged]:
        return [each for each in self.ordinary if each.false_alarm]

    @property
    def counts(self) -> dict[str, int]:
        """How many of the extreme runs came to what."""
        counts: Counter[str] = Counter()
        for each in self.extreme:
            counts["refused"] += bool(each.refused)
            counts["failed"] += each.failed
            counts["warned of before"] += each.failed and bool(each.warned)
            counts["noticed during"] += each.failed and bool(each.faults)
            counts["missed"] += each.missed
        return dict(counts)

    @property
    def lines(self) -> list[str]:
        """The result in words."""
        counts = ", ".join(f"{name} {count}" for name, count in self.counts.items())
        return [
            f"{len(self.extreme)} extreme runs: {counts}",
            *(f"missed: {_words(each)}" for each in self.missed),
            f"{len(self.ordinary)} ordinary runs: {len(self.false_alarms)} false alarms",
            *(f"false alarm: {_words(each)}" for each in self.false_alarms),
        ]

    def record(self) -> dict[str, Any]:
        """The result as plain data."""
        return {
            "extreme": self.counts,
            "missed": [_words(each) for each in self.missed],
            "false_alarms": [_words(each) for each in self.false_alarms],
        }


def measure_detection(count: int, seed: int, show: Show | None = None) -> Detection:
    """So many extreme runs and as many ordinary ones, judged."""
    logging.getLogger("absl").setLevel(logging.ERROR)
    show = show or (lambda done, what: None)
    sets: list[tuple[Judged, ...]] = []
    for done, (name, make) in enumerate((("extreme", extreme), ("ordinary", ordinary))):
        judged_runs = []
        for number in range(count):
            show(done * count + number, f"{name} runs")
            judged_runs.append(judged(make(seed, number)))
        sets.append(tuple(judged_runs))
    return Detection(*sets)


def judged(run: RandomRun) -> Judged:
    """A run by the engine and by the equations, and what was said of it."""
    with warnings.catch_warnings(action="ignore"):
        try:
            theory = integrate(run.scene, run.times, max_steps=REFERENCE_STEPS)
            warned = exceeded(run.scene, run.settings, run.times)
            agreement = compare(run.scene, run.settings, theory=theory)
        except InputError as error:
            return Judged(run, None, False, (), (), str(error))
    measured = (agreement.path_error, agreement.momentum_error)
    return Judged(
        run,
        agreement.path_error,
        all(value is not None and value <= run.settings.error_tolerance for value in measured),
        tuple(map(str, warned)),
        tuple(map(str, agreement.faults)),
    )


def _words(of: Judged) -> str:
    said = "; ".join((*of.warned, *of.faults, of.refused)).strip("; ")
    axes = ", ".join(of.run.axes)
    return ", ".join(filter(None, (of.run.scene.name, of.run.settings.name, axes, said)))
