"""A cell of a sweep and what came of it: as data, as a line of JSON, as a row of a table."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from validation.output import write_rows

Cell = Mapping[str, Any]
"""Plain data, as JSON has it, that says everything about one run: it is the run's identity."""
OUTLASTED = "took longer than"
"""How the failure of a cell begins that was ended at its limit of time."""
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

    @property
    def outlasted(self) -> bool:
        """Whether the cell was ended at its limit of time."""
        return self.failure is not None and self.failure.startswith(OUTLASTED)


def identity(cell: Mapping[str, Any]) -> str:
    """The same text for equal cells; raises ValueError or TypeError where it is no plain data."""
    return json.dumps(cell, sort_keys=True, allow_nan=False)


def reason(error: BaseException) -> str:
    """An exception in one line."""
    words = " ".join(str(error).split())
    return f"{type(error).__name__}: {words}" if words else type(error).__name__


def to_line(cell: Cell, record: Mapping[str, Any] | None, failure: str | None) -> str:
    """A result as a line; raises ValueError or TypeError where the record is no plain data."""
    whole = {"cell": cell, "record": record, "failure": failure}
    return json.dumps(whole, allow_nan=False, ensure_ascii=False)


def from_line(line: str | bytes) -> Result:
    """The result of a line; raises ValueError or TypeError where it is none."""
    return Result(**json.loads(line))


def write_table(path: Path, results: Sequence[Result]) -> None:
    """CSV, a row a cell: the columns of the cells, those of the records, and the failure.

    None is empty, lists and mappings are JSON. Of a name that cell and record share, the cell's
    value stands. Equal results make equal files.
    """
    cells = [result.cell for result in results]
    records = [result.record or {} for result in results]
    columns = dict.fromkeys(name for row in (*cells, *records) for name in row)
    rows = [
        {name: _plain(value) for name, value in {**record, **cell}.items()}
        | {"failure": result.failure}
        for cell, record, result in zip(cells, records, results, strict=True)
    ]
    write_rows(path, rows, [*columns, "failure"])


def _plain(value: Any) -> Any:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value
