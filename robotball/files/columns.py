"""Read and write tables of numbers with a header, as CSV, NPZ or Parquet.

Columns come back to the last bit. CSV is read as simulators write it: with any delimiter, comments,
a line of units, a byte order mark. In order: the table and its files, samples of a drive, then each
kind of file.
"""

import codecs
import contextlib
import io
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from robotball.errors import InputError, named
from robotball.files import MB, opened, readable
from robotball.files.replacing import replacing
from robotball.robot.drives import Samples
from robotball.rotations import Array

_COMMENT = ("#", "%", "//")  # Python's and gnuplot's, MATLAB's, C++'s
_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
_LINES = 20_000  # that are read at once, so that a file's text never stands whole in memory
_LONGEST = 4_000_000_000  # bytes: a motion of a day, every 20 ms, takes 2.5e9 as CSV
_MOST_BYTES = 1_000_000_000  # bytes in memory, of all numbers: that motion takes 0.9e9
_WORD = 8  # bytes of a number
# Members of an NPZ, and metadata of a Parquet, that hold JSON; units are in the header of a CSV.
_HEADER, _UNITS = "header", "units"
_PARQUET_EXTRA = (
    "Parquet needs pyarrow: install robotball's extra `parquet`, or use .csv or .npz instead"
)
# Units that need no conversion: whether the value is a rate, an angle or a torque, the drive says.
_TIME, VALUES = ("s",), ("rad/s", "rad", "N m", "Nm", "N*m", "N·m")


_Line = tuple[int, str]  # its number in the file, from 1, and its text


@dataclass(frozen=True)
class Table:
    """A table: numbers, all of one length, and units by the columns' names; texts of a header.

    notes: what had to be understood on reading, a line each.
    """

    columns: Mapping[str, Array]
    units: Mapping[str, str]
    header: Mapping[str, str]
    notes: tuple[str, ...] = ()


def write_table(path: Path, table: Table) -> None:
    """Write a table as a file of the kind that its suffix says. Raises InputError for others."""
    writers = {".csv": _write_csv, ".npz": _write_npz, ".parquet": _write_parquet}
    write = _of_suffix(path, writers)
    with replacing(path) as temporary:
        write(temporary, table)


def read_table(path: Path, gaps: bool = False) -> Table:
    """Return the table of a file. Raises InputError, with the file, where it holds none.

    gaps: whether a cell of text may be empty, which is NaN then.
    """
    texts = dict.fromkeys((".csv", ".tsv", ".txt"), partial(_read_csv, empty="nan" if gaps else ""))
    read = _of_suffix(path, {**texts, ".npz": _read_npz, ".parquet": _read_parquet})
    # A reader says what is wrong with the bytes; the file's name is put before it here.
    what = f"it is no {path.suffix[1:].upper()} file that can be read"
    with opened(path, _LONGEST) as file, named(path), readable(what):
        table = read(file)
    lengths = {name: len(column) for name, column in table.columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"{path}: columns are of different lengths: {lengths}")
    return table


def _of_suffix(path: Path, by_suffix: Mapping[str, Any]) -> Any:
    suffix = path.suffix.lower()
    if suffix not in by_suffix:
        kinds = ", ".join(by_suffix)
        raise InputError(f"{path}: a table's file is one of {kinds}, not {suffix!r}")
    return by_suffix[suffix]


def read_samples(path: Path) -> Samples:
    """Return the samples of a file of two columns, a time [s] and a value.

    Raises InputError, with the file, where it holds none, or a unit that is not SI's.
    """
    table = read_table(path)
    if len(table.columns) != 2:
        raise InputError(
            f"{path}: samples take two columns, time and value, not {', '.join(table.columns)}"
        )
    for name, known in zip(table.columns, (_TIME, VALUES), strict=True):
        if (unit := table.units.get(name)) and unit not in known:
            raise InputError(f"{path}: {name} is in {unit}; samples take {', '.join(known[:3])}")
    times, values = (tuple(column.tolist()) for column in table.columns.values())
    with named(path):
        return Samples(times=times, values=values)


def _write_csv(path: Path, table: Table) -> None:
    """Write the header in comment lines `# name: text`, one for each line of a text."""
    texts = {**table.header, _UNITS: json.dumps(dict(table.units), ensure_ascii=False)}
    lines = [f"# {name}: {line}" for name, text in texts.items() for line in text.split("\n")]
    lines.append(",".join(table.columns))
    rows = zip(*(column.tolist() for column in table.columns.values()), strict=True)
    # By repr, the shortest text that is read back to the last bit.
    lines += [",".join(map(repr, row)) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _read_csv(file: BinaryIO, empty: str) -> Table:
    """Return the table of a CSV file. Raises InputError for what is no table.

    The line of names may be a comment, and a line of units may follow it. Numbers may have decimal
    commas where another character is between them.
    """
    # Excel writes such marks. Without one a name would begin with a character that nobody sees.
    start = file.read(len(codecs.BOM_UTF8))
    encoding = next((_MARKS[mark] for mark in _MARKS if start.startswith(mark)), None)
    file.seek(0)
    notes = ("it begins with a byte order mark, which is skipped",) if encoding else ()
    try:
        with io.TextIOWrapper(file, encoding or "utf-8") as text:
            return replace(_table(enumerate(text, 1), empty), notes=notes)
    except UnicodeDecodeError:
        raise InputError("it is no text in UTF-8 or UTF-16") from None


def _table(lines: Iterator[_Line], empty: str) -> Table:
    # One pass, in pieces: comments are collected on the way, as units and names may be in them.
    comments: list[str] = []
    rows = _data_lines(lines, comments)
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
        # A line below the names without a single number has the units.
        if begun and not any(map(_is_number, _cells(begun[0][1], delimiter))):
            below = dict(zip(names, _cells(begun.pop()[1], delimiter), strict=False))
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"two columns are called {twice!r}")
    parts = [_numbers(names, begun, delimiter, comments, empty)]
    while piece := [*islice(lines, _LINES)]:
        parts.append(_numbers(names, piece, delimiter, comments, empty))
        _check_size(sum(each.nbytes for each in parts))
    if not any(map(len, parts)):
        raise InputError("there are no rows of numbers below the columns' names")
    header = _header(comments)
    units = below | _units_of(header.pop(_UNITS, ""))
    return Table(dict(zip(names, np.concatenate(parts).T, strict=True)), units, header)


def _data_lines(lines: Iterable[_Line], comments: list[str]) -> Iterator[_Line]:
    """Yield the lines that are neither empty nor a comment. Comments are added to the others."""
    for number, line in lines:
        stripped = line.strip()
        if stripped.startswith(_COMMENT):
            comments.append(line.strip("\n").lstrip().lstrip("#%/").removeprefix(" "))
        elif stripped:
            yield number, stripped


def _header(comments: list[str]) -> dict[str, str]:
    """Return the comments of the form `name: text`. Those of one name are lines of one text."""
    found: dict[str, list[str]] = {}
    for line in comments:
        match = re.match(r"(\w+):(?: (.*))?$", line)
        if match:
            found.setdefault(match[1], []).append(match[2] or "")
    return {name: "\n".join(lines) for name, lines in found.items()}


def _units_of(text: str) -> dict[str, str]:
    """Return units that are given as JSON, or as `t s, x mm`."""
    pairs = (part.replace(":", " ").replace("=", " ").split() for part in text.split(","))
    return _texts(text) or {pair[0]: pair[1] for pair in pairs if len(pair) == 2}


def _delimiter(line: str) -> str | None:
    """Return the character between the cells of a line; None is white space."""
    # A comma last: where it is decimal, semicolons or tabs are between the numbers.
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
    names: list[str],
    lines: list[_Line],
    delimiter: str | None,
    comments: list[str],
    empty: str,
) -> Array:
    """Return the numbers (n, columns) of some lines. Comments are added to the others.

    empty: the text that stands for an empty cell.
    """
    # NumPy reads a piece at once; what follows goes line by line, and names the one at fault.
    texts = [line if delimiter == "," else line.replace(",", ".") for _, line in lines]
    with contextlib.suppress(ValueError):  # by a comment, a cell in quotes, or what is no number
        if any(map(str.strip, texts)):
            numbers = np.loadtxt(texts, delimiter=delimiter, comments=None, ndmin=2)
            if numbers.shape[1] == len(names):
                return numbers
    checked = list(_checked(names, _data_lines(lines, comments), delimiter, empty))
    return np.array(checked).reshape(-1, len(names))


def _checked(
    names: list[str], rows: Iterable[_Line], delimiter: str | None, empty: str
) -> Iterator[list[float]]:
    for number, line in rows:
        cells = _cells(line if delimiter == "," else line.replace(",", "."), delimiter)
        if len(cells) != len(names):
            raise InputError(
                f"line {number} has {len(cells)} values, and there are {len(names)} columns"
            )
        try:
            yield [float(cell or empty) for cell in cells]
        except ValueError:
            i = next(i for i, cell in enumerate(cells) if not _is_number(cell))
            what = f"is {cells[i]!r}" if cells[i] else "is empty"
            raise InputError(f"line {number}: {names[i]} {what}, and must be a number") from None


def _own_members(table: Table) -> dict[str, str]:
    """Return a table's header and units as JSON, by the names of their members in a file."""
    return {_HEADER: json.dumps(dict(table.header)), _UNITS: json.dumps(dict(table.units))}


def _write_npz(path: Path, table: Table) -> None:
    members: dict[str, Any] = {**_own_members(table), **table.columns}
    with path.open("wb") as file:  # by its name, NumPy would add a suffix of its own
        np.savez(file, allow_pickle=False, **members)


def _read_npz(file: BinaryIO) -> Table:
    # A pickle may run any code of a stranger's.
    with np.load(file, allow_pickle=False) as members:
        # Before anything is unpacked: a few kB of zeros may be gigabytes.
        _check_size(sum(each.file_size for each in members.zip.filelist))
        # A member that is no array comes as its bytes.
        arrays = {name: np.asarray(members[name]) for name in members.files}
    _check_size(sum(each.size for each in arrays.values()) * _WORD)
    header, units = (_texts(arrays.pop(name, None)) for name in (_HEADER, _UNITS))
    return Table(dict(_columns(arrays)), units, header)


def _check_size(size: int) -> None:
    """Raise InputError where a table would take so many bytes of memory."""
    if size > _MOST_BYTES:
        raise InputError(
            f"it takes {size / MB:.4g} MB of memory, and may take {_MOST_BYTES / MB:g}; shorten it"
        )


def _texts(member: Any) -> dict[str, str]:
    """Return the names and texts of a member that holds JSON; none where it holds no such."""
    try:
        found = json.loads(str(member))
    except ValueError:
        return {}
    # Another program's member of that name may hold any JSON.
    if not isinstance(found, dict):
        return {}
    return {str(name): str(text) for name, text in found.items()}


def _columns(arrays: Mapping[str, Any]) -> Iterator[tuple[str, Array]]:
    """Yield columns (n,) as they are, and those of an array (n, k) as `name.0`, `name.1`, …."""
    for name, array in arrays.items():
        if array.dtype.kind not in "fiub":
            continue  # what a simulator keeps beside its trajectory
        numbers = np.asarray(array, dtype=float)
        if array.ndim == 1:
            yield name, numbers
        elif array.ndim == 2:
            yield from ((f"{name}.{i}", column) for i, column in enumerate(numbers.T))


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise InputError(_PARQUET_EXTRA) from None
    return pyarrow, parquet


def _write_parquet(path: Path, table: Table) -> None:
    pyarrow, parquet = _pyarrow()
    whole = pyarrow.table({name: np.asarray(each) for name, each in table.columns.items()})
    parquet.write_table(whole.replace_schema_metadata(_own_members(table)), path)


def _read_parquet(file: BinaryIO) -> Table:
    pyarrow, parquet = _pyarrow()
    packed = parquet.ParquetFile(file)
    _check_size(packed.metadata.num_rows * packed.metadata.num_columns * _WORD)
    whole = packed.read()
    types = pyarrow.types
    arrays = {
        field.name: column.to_numpy()
        for field, column in zip(whole.schema, whole.columns, strict=True)
        if types.is_floating(field.type) or types.is_integer(field.type)
    }
    metadata = whole.schema.metadata or {}
    header, units = (
        _texts(metadata.get(name.encode(), b"").decode(errors="replace"))
        for name in (_HEADER, _UNITS)
    )
    return Table(dict(_columns(arrays)), units, header)
