"""Measure how often `--accuracy` misses the requested error, for random balls. Takes hours.

A miss is a run with a larger path error than requested, without a warning or a fault. Results are
kept in out/estimates.jsonl, so `python -m bench.estimates` continues after a break.
"""

import sys
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robotball import SceneWarning, integrate, simulate
from robotball.motion import path_error
from tests.random_balls import ball_of_points
from validation.output import progress_bar, scientific
from validation.sweeps import Cell, Result, sweep

_BALLS = 1000
ACCURACIES = (1e-5, 1e-7, 1e-9)  # each for four balls in turn, with 0 to 3 rotors
_TIMES = np.linspace(0.0, 10.0, 501)
_LIMIT = 300.0  # s per ball
_FILE = Path("out", "estimates.jsonl")


def cells(count: int) -> list[Cell]:
    """Return the first `count` balls, each with a requested accuracy."""
    return [
        {"ball": number, "accuracy": ACCURACIES[number // 4 % len(ACCURACIES)]}
        for number in range(count)
    ]


def measure(cell: Mapping[str, Any]) -> dict[str, Any]:
    """Return estimated and actual path error, and whether there was a warning.

    Both errors are None if the run broke off; reference: the equations' error.
    """
    scene = ball_of_points(cell["ball"])
    theory = integrate(scene, _TIMES)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SceneWarning)
        motion = simulate(scene, _TIMES, accuracy=cell["accuracy"])
    whole = len(motion.times) == len(_TIMES)
    return {
        "estimated": motion.report.estimated_error if whole else None,
        "actual": path_error(motion, theory) if whole else None,
        "reference": theory.reference_error,
        "warned": any("is not reached" in str(warning.message) for warning in caught),
        "faults": [str(fault) for fault in motion.report.faults],
    }


def missed(result: Result) -> bool:
    record = result.record
    if record is None or record["warned"] or record["faults"] or record["actual"] is None:
        return False
    return bool(record["actual"] > result.cell["accuracy"])


def lines(results: Sequence[Result]) -> list[str]:
    records = [result.record for result in results if result.record is not None]
    ratios = [run["actual"] / run["estimated"] for run in records if run["actual"] is not None]
    misses = [result for result in results if missed(result)]
    summary = [
        f"{len(records)} balls: {sum(run['warned'] for run in records)} warned, "
        f"{sum(bool(run['faults']) for run in records)} with a fault, {len(misses)} missed",
        "actual over estimated error: "
        + ", ".join(
            f"{name} {np.quantile(ratios, part):.2g}"
            for name, part in (("median", 0.5), ("99 %", 0.99), ("largest", 1.0))
        ),
    ]
    for result in misses:
        assert result.record is not None
        numbers = (result.record[name] for name in ("estimated", "actual", "reference"))
        estimated, actual, reference = map(scientific, numbers)
        summary.append(
            f"missed: ball {result.cell['ball']}, {result.cell['accuracy']:g} requested, "
            f"{estimated} estimated, {actual} actual, {reference} error of the equations"
        )
    return summary


def _main(count: int = _BALLS) -> None:
    _FILE.parent.mkdir(exist_ok=True)
    with progress_bar(count) as show:
        results = sweep(measure, cells(count), _FILE, limit=_LIMIT, show=show)
    print(*lines(results), sep="\n")


if __name__ == "__main__":
    _main(*map(int, sys.argv[1:]))
