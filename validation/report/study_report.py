"""Report the JSON file of a study: tables, versions, and pictures."""

import json
from collections.abc import Mapping, Sequence
from glob import escape
from pathlib import Path
from typing import Any

from robotball import InputError
from robotball.files import contents, readable

from . import folded, page, paragraph, picture, plain, table, text

_LONGEST = 60  # rows of a table
_WIDEST = 60  # characters of a cell


def study_report(source: Path) -> str:
    """Return the page of a study's JSON file, with its picture `x.png`, or all pictures `x….png`.

    Raises InputError if the file cannot be read or is not from a study.
    """
    data = contents(source)
    with readable(f"{source} is not valid JSON"):
        record = json.loads(data)
    parts = record if isinstance(record, list) else [record]
    # Records of studies have versions, which other JSON files rarely have.
    if not parts or not all(
        isinstance(part, dict) and isinstance(part.get("versions"), dict) for part in parts
    ):
        raise InputError(f"{source} is not the record of a study: it has no versions")
    body = [f"<h1>{text(source.stem)}</h1>", paragraph(f"A study's record, {source.name}.")]
    single = source.with_suffix(".png")
    several = source.parent.glob(f"{escape(source.stem)}*.png")  # one for each map
    pictures = map(picture, [single] if single.exists() else sorted(several))
    body += [*pictures, *(_tables("runs", parts) if record is parts else _sections(record))]
    body.append(folded("Versions", plain(parts[0]["versions"]), short=True))
    return page(f"robotball: {source.stem}", body)


def _sections(record: Mapping[str, Any]) -> list[str]:
    """Return a table of a record's plain values, and a table for each list of records."""
    single = {name: _cell(value) for name, value in record.items() if _is_plain(value)}
    body = [plain(single)] if single else []
    for name, value in record.items():
        if isinstance(value, list) and value and all(isinstance(row, dict) for row in value):
            body += _tables(name, value)
    return body


def _tables(name: str, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    columns = [key for key, value in rows[0].items() if _is_plain(value)]
    cells = [[_cell(row.get(key)) for key in columns] for row in rows[:_LONGEST]]
    first = f"; the first {_LONGEST} are shown" if len(rows) > _LONGEST else ""
    return [
        f"<h2>{text(name.replace('_', ' '))}</h2>",
        paragraph(f"{len(rows)} rows{first}.", "faint"),
        table([key.replace("_", " ") for key in columns], cells),
    ]


def _is_plain(value: object) -> bool:
    return value is None or isinstance(value, str | int | float)


def _cell(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.4g}"
    content = str(value)
    return content if len(content) <= _WIDEST else f"{content[: _WIDEST - 1]}…"
