"""CSV as simulators write it: any delimiter, comments, a line of units, a byte order mark."""

import codecs
import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from robotball.errors import InputError
from robotball.rotations import Array

COMMENT = ("#", "%", "//")
MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
UNITS = "units"  # the header's line of them, as JSON


def write_csv(
    columns: Mapping[str, Array], units: Mapping[str, str], header: Mapping[str, str]
) -> str:
    """The text of a CSV file, its header in comment lines `# name: text`, a line of text each."""
    texts = {**header, UNITS: json.dumps(dict(units), ensure_ascii=False)}
    lines = [f"# {name}: {line}" for name, text in texts.items() for line in text.split("\n")]
    lines.append(",".join(columns))
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines += [",".join(map(repr, row)) for row in rows]
    return "\n".join(lines) + "\n"


def read_csv(
    data: bytes,
) -> tuple[dict[str, Array], dict[str, str], dict[str, str], tuple[str, ...]]:
    """Columns, units, header and notes of a file's bytes; raises InputError for what is no table.

    The line of names may be a comment, and a line of units may follow it. Numbers may have decimal
    commas where another character is between them.
    """
    text, notes = _text(data)
    comments: list[str] = []
    rows: list[tuple[int, str]] = []
    for number, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), 1):
        stripped = line.strip()
        if stripped.startswith(COMMENT):
            comments.append(line.lstrip().lstrip("#%/").removeprefix(" "))
        elif stripped:
            rows.append((number, stripped))
    if not rows:
        raise InputError("the file holds no numbers")
    header = _header(comments)
    units = _units_of(header.pop(UNITS, ""))
    delimiter = _delimiter(rows[0][1])
    first = _cells(rows[0][1], delimiter)
    if all(map(_is_number, first)):
        names = _cells(comments[-1].strip(), _delimiter(comments[-1])) if comments else []
        if len(names) != len(first):
            raise InputError("there is no line with the columns' names, as t,x,y,qw,qx,qy,qz")
    else:
        names, rows = first, rows[1:]
        if rows and not any(map(_is_number, _cells(rows[0][1], delimiter))):
            cells = _cells(rows.pop(0)[1], delimiter)
            units = dict(zip(names, cells, strict=False)) | units
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"two columns are called {twice!r}")
    if not rows:
        raise InputError("there are no rows of numbers below the columns' names")
    return dict(zip(names, _numbers(names, rows, delimiter).T, strict=True)), units, header, notes


def _text(data: bytes) -> tuple[str, tuple[str, ...]]:
    encoding = "utf-8"
    notes: tuple[str, ...] = ()
    for mark, marked in MARKS.items():
        if data.startswith(mark):
            encoding, notes = marked, ("it begins with a byte order mark, which is skipped",)
    try:
        return data.decode(encoding), notes
    except UnicodeDecodeError:
        raise InputError("it is no text in UTF-8 or UTF-16") from None


def _header(comments: list[str]) -> dict[str, str]:
    """The comments of the form `name: text`; those of one name are the lines of one text."""
    found: dict[str, list[str]] = {}
    for line in comments:
        match = re.match(r"(\w+):(?: (.*))?$", line)
        if match:
            found.setdefault(match[1], []).append(match[2] or "")
    return {name: "\n".join(lines) for name, lines in found.items()}


def _units_of(text: str) -> dict[str, str]:
    """Units by JSON, or as `t s, x mm`."""
    try:
        given: Any = json.loads(text)
    except ValueError:
        pairs = (part.replace(":", " ").replace("=", " ").split() for part in text.split(","))
        return {pair[0]: pair[1] for pair in pairs if len(pair) == 2}
    return {str(k): str(v) for k, v in given.items()} if isinstance(given, dict) else {}


def _delimiter(line: str) -> str | None:
    """What is between the cells of a line; None is white space."""
    return next((each for each in (";", "\t", ",") if each in line), None)


def _cells(line: str, delimiter: str | None) -> list[str]:
    return [cell.strip().strip('"').strip() for cell in line.split(delimiter)]


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _numbers(names: list[str], rows: list[tuple[int, str]], delimiter: str | None) -> Array:
    """(n, columns) of the rows, each with its line in the file."""
    return np.array(list(_checked(names, rows, delimiter)))


def _checked(
    names: list[str], rows: list[tuple[int, str]], delimiter: str | None
) -> Iterator[list[float]]:
    for number, line in rows:
        cells = _cells(line if delimiter == "," else line.replace(",", "."), delimiter)
        if len(cells) != len(names):
            raise InputError(
                f"line {number} has {len(cells)} values, and there are {len(names)} columns"
            )
        try:
            yield [float(cell) for cell in cells]
        except ValueError:
            i = next(i for i, cell in enumerate(cells) if not _is_number(cell))
            what = f"is {cells[i]!r}" if cells[i] else "is empty"
            raise InputError(f"line {number}: {names[i]} {what}, and must be a number") from None
