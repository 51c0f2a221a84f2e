"""Report a study's JSON file: its tables, its versions, and the pictures beside it."""

import json
from collections.abc import Mapping, Sequence
from glob import escape
from pathlib import Path
from typing import Any

from robotball import InputError
from robotball.files import contents, readable

from . import folded, page, paragraph, picture, plain, table, text

_LONGEST = 60  # rows of a table; the file has the others
_WIDEST = 60  # characters of a cell


def study_report(source: Path) -> str:
    """Return the page of a JSON file that a study wrote, with its picture `x.png`, or all `x….png`.

    Raises InputError for a file that cannot be read, or that no study wrote.
    """
    data = contents(source)
    with readable(f"{source} is no JSON"):
        record = json.loads(data)
    parts = record if isinstance(record, list) else [record]
    # Every record that a study writes names its versions, and hardly any other JSON does.
    if not parts or not all(
        isinstance(part, dict) and isinstance(part.get("versions"), dict) for part in parts
    ):
        raise InputError(f"{source} is no record of a study: it names no versions")
    body = [f"<h1>{text(source.stem)}</h1>", paragraph(f"A study's record, {source.name}.")]
    own = source.with_suffix(".png")
    # One picture of its own name, or one for each map.
    beside = source.parent.glob(f"{escape(source.stem)}*.png")
    pictures = map(picture, [own] if own.exists() else sorted(beside))
    body += [*pictures, *(_tables("runs", parts) if record is parts else _sections(record))]
    body.append(folded("Versions", plain(parts[0]["versions"]), short=True))
    return page(f"robotball: {source.stem}", body)


def _sections(record: Mapping[str, Any]) -> list[str]:
    """Return a record's plain values as one table, and each list of records as another."""
    single = {name: _cell(value) for name, value in record.items() if _is_plain(value)}
    body = [plain(single)] if single else []
    for name, value in record.items():
        if isinstance(value, list) and value and all(isinstance(each, dict) for each in value):
            body += _tables(name, value)
    return body


def _tables(name: str, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    columns = [key for key, value in rows[0].items() if _is_plain(value)]
    cells = [[_cell(row.get(key)) for key in columns] for row in rows[:_LONGEST]]
    first = f", of which the first {_LONGEST} are shown" if len(rows) > _LONGEST else ""
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
    words = str(value)
    return words if len(words) <= _WIDEST else f"{words[: _WIDEST - 1]}…"
