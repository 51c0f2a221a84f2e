"""A cell of a sweep, what came of it, and both as one line of JSON."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

Cell = Mapping[str, Any]
"""Plain data, as JSON has it, that says everything about one run: it is the run's identity."""
Work = Callable[[Cell], Mapping[str, Any]]
"""A module's function of a cell; its record is plain data, with None for what has no number."""


@dataclass(frozen=True)
class Result:
    """What came of a cell: a record, or the reason why there is none.

    cell, record: as JSON gives them back, so a tuple is a list; failure: one line.
    """

    cell: dict[str, Any]
    record: dict[str, Any] | None
    failure: str | None


def identity(cell: Mapping[str, Any]) -> str:
    """The same text for equal cells; raises ValueError or TypeError where it is no plain data."""
    return json.dumps(cell, sort_keys=True, allow_nan=False)


def to_line(cell: Cell, record: Mapping[str, Any] | None, failure: str | None) -> str:
    """A result as a line; raises ValueError or TypeError where the record is no plain data."""
    whole = {"cell": cell, "record": record, "failure": failure}
    return json.dumps(whole, allow_nan=False, ensure_ascii=False)


def from_line(line: str | bytes) -> Result:
    """The result of a line; raises ValueError or TypeError where it is none."""
    return Result(**json.loads(line))
