"""Read and write tables of numbers with a header, as CSV, NPZ or Parquet; read logs of records.

Numbers are restored to the last bit. The CSV reader accepts what simulators write: any delimiter,
comments, a line of units, a byte order mark. The numbers of nested records, such as JSON lines and
the messages of a ROS bag, become columns. A column's name consists of the keys that lead to the
number, such as "imu.angular_velocity.x". If a record has names for the numbers of a list, such as a
JointState, the column has such a name instead of an index: "joint_states.roll_joint.position".
"""

import contextlib
import io
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import islice
from numbers import Real
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from robotball.errors import InputError, named
from robotball.files import MB, opened, readable
from robotball.files.replacing import replacing
from robotball.robot.drives import Samples
from robotball.rotations import Array

_COMMENT = ("#", "%", "//")  # begin of a comment in Python and gnuplot, in MATLAB, in C++
_CHUNK = 20_000  # lines read at once, because the text of a long file would fill the memory
_LONGEST = 4_000_000_000  # bytes of a file; a one-day motion sampled every 20 ms takes 2.5e9 as CSV
_MAX_MEMORY = 1_000_000_000  # bytes of all numbers; the one-day motion takes 0.9e9
_FLOAT_BYTES = 8
# Names of JSON members of an NPZ and of metadata of a Parquet file. A CSV has units in its header.
_HEADER, _UNITS = "header", "units"
_LONGEST_LIST = 8  # lists with more numbers, such as covariances and images, are left out
_DEEPEST = 16  # nested keys
_NS = 1_000_000_000
RECORDS = "records"  # header entry of a table whose rows may lack any column
# Units that need no conversion. Whether values are rates, angles or torques depends on the drive.
_TIME, VALUES = ("s",), ("rad/s", "rad", "N m", "Nm", "N*m", "N·m")

_Line = tuple[int, str]  # line number, from 1, and text


@dataclass(frozen=True)
class Table:
    """Columns of equal length, units of columns, and texts of the header, each by name."""

    columns: Mapping[str, Array]
    units: Mapping[str, str]
    header: Mapping[str, str]


def write_table(path: Path, table: Table) -> None:
    """Write a table as .csv, .npz or .parquet. Raises InputError for other suffixes."""
    writers = {".csv": _write_csv, ".npz": _write_npz, ".parquet": _write_parquet}
    write = _of_suffix(path, writers)
    with replacing(path) as temporary:
        write(temporary, table)


def read_table(path: Path, gaps: bool = False) -> Table:
    """Return the table in a file. Raises InputError with the file's name if it is not valid.

    gaps: whether empty cells of a text file are read as NaN; otherwise they are an error.
    """
    lines, mat, bag = (partial(_read_records, r) for r in (_read_json_lines, _read_mat, _read_bag))
    texts = dict.fromkeys((".csv", ".tsv", ".txt"), partial(_read_csv, empty="nan" if gaps else ""))
    readers = {**texts, ".npz": _read_npz, ".parquet": _read_parquet}
    readers |= {".jsonl": lines, ".ndjson": lines, ".mat": mat}
    readers |= dict.fromkeys((".bag", ".db3", ".mcap"), bag)
    read = _of_suffix(path, readers)
    fault = f"not a readable {path.suffix[1:].upper()} file"
    with opened(path, _LONGEST) as file, named(path), readable(fault):
        table = read(file)
    lengths = {name: len(column) for name, column in table.columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"{path}: columns have different lengths: {lengths}")
    return table


def _of_suffix(path: Path, functions: Mapping[str, Any]) -> Any:
    suffix = path.suffix.lower()
    if suffix not in functions:
        raise InputError(f"{path}: a table must end with {', '.join(functions)}, not {suffix!r}")
    return functions[suffix]


def read_samples(path: Path) -> Samples:
    """Return the samples of a drive from a file with two columns, time [s] and value.

    Raises InputError with the file's name if the file has other content or units other than SI.
    """
    table = read_table(path)
    if len(table.columns) != 2:
        there = ", ".join(table.columns)
        raise InputError(f"{path}: samples need two columns, time and value; there are {there}")
    for name, units in zip(table.columns, (_TIME, VALUES), strict=True):
        if (unit := table.units.get(name)) and unit not in units:
            raise InputError(f"{path}: {name} is in {unit}; samples need {', '.join(units[:3])}")
    times, values = (tuple(column.tolist()) for column in table.columns.values())
    with named(path):
        return Samples(times=times, values=values)


def _write_csv(path: Path, table: Table) -> None:
    """Write a CSV file. Each line of a header's text becomes a comment line `# name: text`."""
    texts = {**table.header, _UNITS: json.dumps(dict(table.units), ensure_ascii=False)}
    lines = [f"# {name}: {line}" for name, text in texts.items() for line in text.split("\n")]
    lines.append(",".join(table.columns))
    rows = zip(*(column.tolist() for column in table.columns.values()), strict=True)
    # repr gives the shortest text that restores every bit.
    lines += [",".join(map(repr, row)) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _read_csv(file: BinaryIO, empty: str) -> Table:
    """Return the table in a CSV file. Raises InputError if the file is not a table.

    The column names may be in a comment, and a line of units may follow the names. Decimal commas
    are accepted if another character separates the cells.
    """
    # utf-8-sig, because Excel writes a byte order mark, which would become part of the first name.
    try:
        with io.TextIOWrapper(file, "utf-8-sig") as text:
            return _table(enumerate(text, 1), empty)
    except UnicodeDecodeError:
        raise InputError("the file is not text in UTF-8; save it in this encoding") from None


def _table(lines: Iterator[_Line], empty: str) -> Table:
    # Read the file once, in chunks, and collect comments, which may have units and column names.
    comments: list[str] = []
    rows = _data_lines(lines, comments)
    start = [*islice(rows, 1)]
    if not start:
        raise InputError("the file holds no numbers")
    delimiter = _delimiter(start[0][1])
    first = _cells(start[0][1], delimiter)
    units_below: dict[str, str] = {}
    if all(map(_is_number, first)):
        names = _cells(comments[-1].strip(), _delimiter(comments[-1])) if comments else []
        if len(names) != len(first):
            raise InputError("add a line with the names of the columns, such as t,x,y,qw,qx,qy,qz")
    else:
        names, start = first, [*islice(rows, 1)]
        # If the line after the names has no number, it has the units.
        if start and not any(map(_is_number, _cells(start[0][1], delimiter))):
            units_below = dict(zip(names, _cells(start.pop()[1], delimiter), strict=False))
    if len(set(names)) < len(names):
        duplicate = next(name for name in names if names.count(name) > 1)
        raise InputError(f"two columns are called {duplicate!r}")
    parts = [_numbers(names, start, delimiter, comments, empty)]
    while chunk := [*islice(lines, _CHUNK)]:
        parts.append(_numbers(names, chunk, delimiter, comments, empty))
        _check_size(sum(part.nbytes for part in parts))
    if not any(map(len, parts)):
        raise InputError("no rows of numbers below the column names")
    header = _header(comments)
    units = units_below | _units_of(header.pop(_UNITS, ""))
    return Table(dict(zip(names, np.concatenate(parts).T, strict=True)), units, header)


def _data_lines(lines: Iterable[_Line], comments: list[str]) -> Iterator[_Line]:
    """Yield the lines with data. Append comment lines to `comments`, and skip empty lines."""
    for number, line in lines:
        stripped = line.strip()
        if stripped.startswith(_COMMENT):
            comments.append(line.strip("\n").lstrip().lstrip("#%/").removeprefix(" "))
        elif stripped:
            yield number, stripped


def _header(comments: list[str]) -> dict[str, str]:
    """Return the comments of the form `name: text`. A repeated name continues the name's text."""
    texts: dict[str, list[str]] = {}
    for line in comments:
        match = re.match(r"(\w+):(?: (.*))?$", line)
        if match:
            texts.setdefault(match[1], []).append(match[2] or "")
    return {name: "\n".join(lines) for name, lines in texts.items()}


def _units_of(text: str) -> dict[str, str]:
    """Return units given as JSON or as `t s, x mm`."""
    pairs = (part.replace(":", " ").replace("=", " ").split() for part in text.split(","))
    return _texts(text) or {pair[0]: pair[1] for pair in pairs if len(pair) == 2}


def _delimiter(line: str) -> str | None:
    """Return the character that separates the cells of a line; None is white space."""
    # Try the comma last: if a line has semicolons or tabs, commas are decimal commas.
    return next((mark for mark in (";", "\t", ",") if mark in line), None)


def _cells(line: str, delimiter: str | None) -> list[str]:
    return [cell.strip().strip('"').strip() for cell in line.split(delimiter)]


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _numbers(
    names: list[str], lines: list[_Line], delimiter: str | None, comments: list[str], empty: str
) -> Array:
    """Return the numbers (n, columns) of the lines, and `empty` for an empty cell.

    Comments are appended to `comments`.
    """
    # Try NumPy on the whole chunk first; if it fails, read line by line to name the bad cell.
    texts = [line if delimiter == "," else line.replace(",", ".") for _, line in lines]
    with contextlib.suppress(ValueError):  # a comment, a quoted cell, or text
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
            raise InputError(f"line {number} has {len(cells)} values, for {len(names)} columns")
        try:
            yield [float(cell or empty) for cell in cells]
        except ValueError:
            i = next(i for i, cell in enumerate(cells) if not _is_number(cell))
            cell = repr(cells[i]) if cells[i] else "empty"
            raise InputError(f"line {number}: {names[i]} must be a number, not {cell}") from None


def _json_members(table: Table) -> dict[str, str]:
    return {_HEADER: json.dumps(dict(table.header)), _UNITS: json.dumps(dict(table.units))}


def _write_npz(path: Path, table: Table) -> None:
    members: dict[str, Any] = {**_json_members(table), **table.columns}
    with path.open("wb") as file:  # if NumPy got a path, it would add a suffix
        np.savez(file, allow_pickle=False, **members)


def _read_records(read: Callable[[BinaryIO], dict[str, Array]], file: BinaryIO) -> Table:
    columns = dict(_columns(read(file)))
    _check_size(sum(column.nbytes for column in columns.values()))
    if not columns:
        raise InputError("the file holds no numbers")
    return Table(columns, {}, {RECORDS: "true"})


def _read_npz(file: BinaryIO) -> Table:
    # Unpickling could run arbitrary code.
    with np.load(file, allow_pickle=False) as members:
        # Check the size before unpacking: a few kB of zeros may unpack to gigabytes.
        _check_size(sum(member.file_size for member in members.zip.filelist))
        # NumPy returns a member that is not an array as bytes.
        arrays = {name: np.asarray(members[name]) for name in members.files}
    _check_size(sum(array.size for array in arrays.values()) * _FLOAT_BYTES)
    header, units = (_texts(arrays.pop(name, None)) for name in (_HEADER, _UNITS))
    return Table(dict(_columns(arrays)), units, header)


def _check_size(size: int) -> None:
    if size > _MAX_MEMORY:
        limit = _MAX_MEMORY / MB
        raise InputError(f"the table needs {size / MB:.4g} MB, above {limit:g} MB: shorten it")


def _texts(member: Any) -> dict[str, str]:
    """Return the texts of a JSON object by name; {} if the member is not a JSON object."""
    try:
        content = json.loads(str(member))
    except ValueError:
        return {}
    # A member of this name may come from another program and have any JSON.
    if not isinstance(content, dict):
        return {}
    return {str(name): str(text) for name, text in content.items()}


def _columns(arrays: Mapping[str, Any]) -> Iterator[tuple[str, Array]]:
    """Yield columns (n,) unchanged, and an array (n, k) as columns `name.0`, `name.1`, …."""
    for name, array in arrays.items():
        if array.dtype.kind not in "fiub":
            continue  # not numeric: other data of the simulator
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
        line = "Parquet needs pyarrow: install robotball's extra `parquet`, or use .csv or .npz"
        raise InputError(line) from None
    return pyarrow, parquet


def _write_parquet(path: Path, table: Table) -> None:
    pyarrow, parquet = _pyarrow()
    whole = pyarrow.table({name: np.asarray(data) for name, data in table.columns.items()})
    parquet.write_table(whole.replace_schema_metadata(_json_members(table)), path)


def _read_parquet(file: BinaryIO) -> Table:
    pyarrow, parquet = _pyarrow()
    packed = parquet.ParquetFile(file)
    _check_size(packed.metadata.num_rows * packed.metadata.num_columns * _FLOAT_BYTES)
    whole = packed.read()
    types = pyarrow.types
    arrays = {
        field.name: column.to_numpy()
        for field, column in zip(whole.schema, whole.columns, strict=True)
        if types.is_floating(field.type) or types.is_integer(field.type)
    }
    keys, metadata = (_HEADER, _UNITS), whole.schema.metadata or {}
    texts = (metadata.get(key.encode(), b"").decode(errors="replace") for key in keys)
    header, units = map(_texts, texts)
    return Table(dict(_columns(arrays)), units, header)


def _numbers_in(value: Any, name: str = "", depth: int = 0) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a nested record, with their names."""
    if hasattr(value, "__dataclass_fields__"):  # a ROS message
        value = vars(value)
    if isinstance(value, np.ndarray):
        value = value.tolist() if value.size <= _LONGEST_LIST else ()
    if isinstance(value, Real) and not isinstance(value, bool):
        yield name, float(value)
    elif isinstance(value, Mapping) and depth < _DEEPEST:
        labels = value.get("name")
        labels = [str(label) for label in labels] if isinstance(labels, list) else []
        start = f"{name}." if name else ""
        for key, inner in value.items():
            values = [] if isinstance(inner, str | Mapping) or not np.size(inner) else inner
            if labels and np.ndim(values) == 1 and len(values) == len(labels) and key != "name":
                for label, number in zip(labels, values, strict=True):
                    yield from _numbers_in(number, f"{start}{label}.{key}", depth + 1)
            else:
                yield from _numbers_in(inner, f"{start}{key}", depth + 1)
    elif isinstance(value, list | tuple) and len(value) <= _LONGEST_LIST and depth < _DEEPEST:
        for i, inner in enumerate(value):
            yield from _numbers_in(inner, f"{name}.{i}", depth + 1)


def _columns_of(rows: list[dict[str, float]]) -> dict[str, Array]:
    """Return the columns of records, with NaN for each number that a record does not have."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}


def _read_json_lines(file: BinaryIO) -> dict[str, Array]:
    """Return the columns of a file with one JSON object per line."""
    records = []
    for number, line in enumerate(file, 1):
        try:
            record = json.loads(line) if line.strip() else {}
        except ValueError as error:
            raise InputError(f"line {number} is not JSON: {error}") from None
        if record:
            records.append(dict(_numbers_in(record)))
    return _columns_of(records)


def _read_bag(file: BinaryIO) -> dict[str, Array]:
    """Return the columns of a ROS bag, with one row for each time stamp; times are in ns."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        line = "ROS bags need rosbags: install robotball's extra `bags`, or write a .csv file"
        raise InputError(line) from None
    rows = dict[int, dict[str, float]]()
    default = get_typestore(Stores.LATEST)
    with AnyReader([Path(file.name)], default_typestore=default) as reader:
        for connection, received, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            record = dict(_numbers_in(message, connection.topic.strip("/")))
            stamp = {name: record.pop(name) for name in [*record] if "stamp." in name}
            sec, nanosec = (*map(int, stamp.values()), 0, 0)[:2]
            rows.setdefault(sec * _NS + nanosec or received, {}).update(record)
    return _columns_of([{"t [ns]": float(at), **rows[at]} for at in sorted(rows)])


def _read_mat(file: BinaryIO) -> dict[str, Array]:
    """Return the columns of a MATLAB file: its longest vectors, and matrices with as many rows."""
    from scipy.io import loadmat  # late: the import takes a tenth of a second

    try:
        members = loadmat(file.name, appendmat=False, simplify_cells=True)
    except NotImplementedError:
        raise InputError("MATLAB files of version 7.3 are not supported; save with -v7") from None
    arrays = dict(_vectors(members))
    longest = max((len(array) for array in arrays.values()), default=0)
    return {name: array for name, array in arrays.items() if len(array) == longest}


def _vectors(members: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Array]]:
    for name, value in members.items():
        if isinstance(value, Mapping):
            yield from _vectors(value, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray) and value.ndim in (1, 2):
            yield f"{prefix}{name}", value if value.shape[0] == max(value.shape) else value.T
