"""The results of a sweep as a table."""

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from validation.output import write_text
from validation.sweeps.cells import Result


def write_table(path: Path, results: Sequence[Result]) -> None:
    """CSV, a row a cell: the columns of the cells, those of the records, and the failure.

    None is empty, lists and mappings are JSON. Of a name that cell and record share, the cell's
    value stands. Equal results make equal files.
    """
    cells = [result.cell for result in results]
    records = [result.record or {} for result in results]
    columns = dict.fromkeys(name for row in (*cells, *records) for name in row)
    text = io.StringIO()
    table = csv.DictWriter(text, [*columns, "failure"], lineterminator="\n")
    table.writeheader()
    for cell, record, result in zip(cells, records, results, strict=True):
        row = {**record, **cell, "failure": result.failure}
        table.writerow({name: _plain(value) for name, value in row.items()})
    write_text(path, text.getvalue())


def _plain(value: Any) -> Any:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value
