"""CSV as simulators write it: any delimiter, comments, a line of units, a byte order mark."""

import codecs
import contextlib
import io
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Any, BinaryIO

import numpy as np

from robotball.errors import InputError
from robotball.rotations import Array

COMMENT = ("#", "%", "//")
MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
LINES = 20_000  # that are read at once, so that a file's text never stands whole in memory
UNITS = "units"  # the header's line of them, as JSON
Line = tuple[int, str]  # its number in the file, from 1, and its text


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
    file: BinaryIO,
) -> tuple[dict[str, Array], dict[str, str], dict[str, str], tuple[str, ...]]:
    """Columns, units, header and notes of a file; raises InputError for what is no table.

    The line of names may be a comment, and a line of units may follow it. Numbers may have decimal
    commas where another character is between them.
    """
    start = file.read(len(codecs.BOM_UTF8))
    encoding = next((MARKS[mark] for mark in MARKS if start.startswith(mark)), None)
    file.seek(0)
    notes = ("it begins with a byte order mark, which is skipped",) if encoding else ()
    lines = enumerate(io.TextIOWrapper(file, encoding or "utf-8"), 1)
    try:
        return *_table(lines), notes
    except UnicodeDecodeError:
        raise InputError("it is no text in UTF-8 or UTF-16") from None


def _table(lines: Iterator[Line]) -> tuple[dict[str, Array], dict[str, str], dict[str, str]]:
    """Columns, units and header."""
    comments: list[str] = []
    rows = _rows(lines, comments)
    begun = [*islice(rows, 1)]
    if not begun:
        raise InputError("the file holds no numbers")
    delimiter = _delimiter(begun[0][1])
    first = _cells(begun[0][1], delimiter)
    below: dict[str, str] = {}
    if all(map(_is_number, first)):
        names = _cells(comments[-1].strip(), _delimiter(comments[-1])) if comments else []
        if len(names) != len(first):
            raise InputError("there is no line with the columns' names, as t,x,y,qw,qx,qy,qz")
    else:
        names, begun = first, [*islice(rows, 1)]
        if begun and not any(map(_is_number, _cells(begun[0][1], delimiter))):
            below = dict(zip(names, _cells(begun.pop()[1], delimiter), strict=False))
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"two columns are called {twice!r}")
    parts = [_numbers(names, begun, delimiter, comments)]
    while piece := [*islice(lines, LINES)]:
        parts.append(_numbers(names, piece, delimiter, comments))
    if not any(map(len, parts)):
        raise InputError("there are no rows of numbers below the columns' names")
    header = _header(comments)
    units = below | _units_of(header.pop(UNITS, ""))
    return dict(zip(names, np.concatenate(parts).T, strict=True)), units, header


def _rows(lines: Iterable[Line], comments: list[str]) -> Iterator[Line]:
    """The lines that are neither empty nor a comment; comments are added to the others."""
    for number, line in lines:
        stripped = line.strip()
        if stripped.startswith(COMMENT):
            comments.append(line.strip("\n").lstrip().lstrip("#%/").removeprefix(" "))
        elif stripped:
            yield number, stripped


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


def _numbers(
    names: list[str], lines: list[Line], delimiter: str | None, comments: list[str]
) -> Array:
    """The numbers (n, columns) of some lines; their comments are added to the others."""
    texts = [line if delimiter == "," else line.replace(",", ".") for _, line in lines]
    with contextlib.suppress(ValueError):  # by a comment, a cell in quotes, or what is no number
        if any(map(str.strip, texts)):
            numbers = np.loadtxt(texts, delimiter=delimiter, comments=None, ndmin=2)
            if numbers.shape[1] == len(names):
                return numbers
    checked = list(_checked(names, _rows(lines, comments), delimiter))
    return np.array(checked).reshape(-1, len(names))


def _checked(
    names: list[str], rows: Iterable[Line], delimiter: str | None
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
