"""What the cells say together: outcomes, what was missed, and where the limits are."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from validation.output import print_whole
from validation.studies.extremes.maps import ERROR_TOLERANCE
from validation.studies.extremes.measure import ACCURATE, WRONG, Outcome, largest_error
from validation.sweeps import Result

# Beyond these a step makes the state grow, and a run soon has none.
STABILITY = ("rotation", "friction_damping", "contact_spring", "servo_gain")


def outcome_of(result: Result) -> Outcome:
    """The outcome of a cell, also of one that the sweep had to give up."""
    if result.record is not None:
        return Outcome[result.record["outcome"]]
    assert result.failure is not None
    return Outcome.UNFINISHED if result.outlasted else Outcome.FAILED


def foretold(result: Result) -> bool:
    """Whether the precheck warned of it."""
    return bool(result.record and result.record.get("foretold"))


def noticed(result: Result) -> bool:
    """Whether the monitor found a fault during the run."""
    return bool(result.record and result.record.get("faults"))


def error_of(result: Result) -> float | None:
    """The larger of path error and momentum error; None where there is none."""
    return largest_error(result.record or {})


def missed(result: Result) -> bool:
    """Whether a run is wrong, and neither the precheck nor the monitor said so."""
    error = error_of(result)
    return error is not None and error > WRONG and not (foretold(result) or noticed(result))


def tally(results: Iterable[Result]) -> Counter[Outcome]:
    """How many cells have each outcome."""
    return Counter(map(outcome_of, results))


@dataclass(frozen=True)
class Measured:
    """A predicted limit beside the measured one, both in parts of the predicted one.

    kept: the farthest that a run went without breaking; broken: the nearest at which one broke and
    no other limit was nearer, None where there is none. A prediction is right where both are 1.
    cells: how many are beyond the limit.

    What breaks beyond a limit of stability is the state: the run diverges or the ball jumps off.
    Beyond any other it is the tolerance that the run was held to.
    """

    name: str
    kept: float
    broken: float | None
    cells: int


def measured_limits(results: Sequence[Result]) -> Iterator[Measured]:
    """The limits that some of the cells are beyond, as those cells tell."""
    known = [(each, _nearness(each)) for each in results if each.record]
    for name in dict.fromkeys(name for _, nearness in known for name in nearness):
        beyond = sum(nearness.get(name, 0.0) > 1 for _, nearness in known)
        if not beyond:
            continue
        stability = name in STABILITY
        broke = _blew_up if stability else _broke
        mine = [(each, nearness) for each, nearness in known if name in nearness]
        kept = [nearness[name] for each, nearness in mine if not broke(each)]
        broken = [
            nearness[name]
            for each, nearness in mine
            if broke(each) and nearness[name] == _nearest(nearness, stability)
        ]
        yield Measured(name, max(kept, default=0.0), min(broken, default=None), beyond)


def _nearest(nearness: Mapping[str, float], stability: bool) -> float:
    return max(value for name, value in nearness.items() if not stability or name in STABILITY)


def _blew_up(result: Result) -> bool:
    return outcome_of(result) in (Outcome.DIVERGED, Outcome.LOST_CONTACT)


def _broke(result: Result) -> bool:
    error = error_of(result)
    return error is None or error > ERROR_TOLERANCE or noticed(result)


def _nearness(result: Result) -> dict[str, float]:
    """How much of each limit is used; of a refused cell none."""
    numbers = (result.record or {}).get("nearness", {})
    return {name: np.inf if value is None else value for name, value in numbers.items()}


def summary(found: Mapping[str, Sequence[Result]]) -> list[dict[str, Any]]:
    """A record for each map and integrator: outcomes, what was missed, and the limits."""
    records = []
    for name, results in found.items():
        for integrator in dict.fromkeys(each.cell["integrator"] for each in results):
            mine = [each for each in results if each.cell["integrator"] == integrator]
            counts = tally(mine)
            records.append(
                {
                    "map": name,
                    "integrator": integrator,
                    "cells": len(mine),
                    "outcomes": {kind.name: counts[kind] for kind in Outcome},
                    "missed": sum(map(missed, mine)),
                    "limits": [asdict(limit) for limit in measured_limits(mine)],
                }
            )
    return records


def totals(results: Sequence[Result]) -> dict[str, int]:
    """How many runs were wrong, and who said so; how many were accurate, and called faulty.

    wrong: off by more than a tenth, or broken off, if by a limit of steps; reported_by_engine:
    those of them that ended in a state which is no number; alarms: accurate, but warned of or
    noticed.
    """
    ran = [each for each in results if outcome_of(each) is not Outcome.REFUSED]
    wrong = [each for each in ran if (error := error_of(each)) is None or error > WRONG]
    accurate = [each for each in ran if (error := error_of(each)) is not None and error <= ACCURATE]
    return {
        "runs": len(results),
        "wrong": len(wrong),
        "reported_by_engine": sum(outcome_of(each) is Outcome.DIVERGED for each in wrong),
        "foretold": sum(map(foretold, wrong)),
        "noticed": sum(map(noticed, wrong)),
        "missed": sum(not (foretold(each) or noticed(each)) for each in wrong),
        "accurate": len(accurate),
        "alarms": sum(foretold(each) or noticed(each) for each in accurate),
    }


def show(records: Sequence[Mapping[str, Any]], console: Console) -> None:
    """Print how many cells have which outcome, then the limits as predicted and as measured."""
    outcomes = _table("map", "integrator", *(each.sign or "=" for each in Outcome), "missed")
    limits = _table("map", "integrator", "predicted limit", "kept up to", "broken from", "beyond")
    for each in records:
        place = (each["map"], each["integrator"])
        counts = (*each["outcomes"].values(), each["missed"])
        outcomes.add_row(*place, *(str(count or "") for count in counts))
        for limit in each["limits"]:
            numbers = (f"{limit[key]:.2g}" if limit[key] else "-" for key in ("kept", "broken"))
            limits.add_row(*place, limit["name"], *numbers, str(limit["cells"]))
    print_whole(outcomes, console)
    for kind in Outcome:
        console.print(f"  {kind.sign or '='}  {kind.sentence}")
    console.print("  missed: wrong, with neither a warning before the run nor a fault in it\n")
    print_whole(limits, console)
    console.print("kept up to, broken from: in parts of the predicted limit; beyond: cells past it")


def _table(*headings: str) -> Table:
    # Eighty columns hold it, so the smallest padding there is.
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    for i, heading in enumerate(headings):
        left = i < 2 or heading == "predicted limit"
        table.add_column(heading, justify="left" if left else "right", no_wrap=True)
    return table
