"""Tables of numbers with a header, as CSV, NPZ or Parquet; columns come back to the last bit."""

import json
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from robotball.errors import InputError
from robotball.files.csv_text import read_csv, write_csv
from robotball.files.reading import MB, opened
from robotball.files.replacing import replacing
from robotball.rotations import Array

LONGEST = 4_000_000_000  # bytes: a motion of a day takes 2.5e9 as CSV
WORD = 8  # bytes of a number
HEADER, UNITS = "header", "units"  # of an NPZ's own members, and of a Parquet's metadata
# What NumPy and zipfile raise for bytes that are no NPZ; TypeError for a single array's file,
# OSError where a member is said to begin before the file.
UNREADABLE = (
    ValueError, TypeError, EOFError, OSError, KeyError, RuntimeError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
PARQUET_EXTRA = (
    "Parquet needs pyarrow: install robotball's extra `parquet`, or use .csv or .npz instead"
)


@dataclass(frozen=True)
class Table:
    """columns: names → numbers, all of one length; units, of columns; header: names → texts.

    notes: what had to be understood on reading, a line each.
    """

    columns: Mapping[str, Array]
    units: Mapping[str, str]
    header: Mapping[str, str]
    notes: tuple[str, ...] = ()


def write_table(path: Path, table: Table) -> None:
    """The table as a file of the kind that its suffix says; raises InputError for another one."""
    writers: dict[str, Callable[[Path, Table], None]] = {
        ".csv": _write_csv,
        ".npz": _write_npz,
        ".parquet": _write_parquet,
    }
    write = _of_suffix(path, writers)
    with replacing(path) as temporary:
        write(temporary, table)


def read_table(path: Path) -> Table:
    """The table of a file; raises InputError, with the file, where it holds none."""
    readers: dict[str, Callable[[BinaryIO], Table]] = {
        ".csv": _read_csv,
        ".tsv": _read_csv,
        ".txt": _read_csv,
        ".npz": _read_npz,
        ".parquet": _read_parquet,
    }
    read = _of_suffix(path, readers)
    with opened(path, LONGEST) as file:
        try:
            table = read(file)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
    lengths = {name: len(column) for name, column in table.columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"{path}: columns are of different lengths: {lengths}")
    return table


def _of_suffix(path: Path, by_suffix: Mapping[str, Any]) -> Any:
    suffix = path.suffix.lower()
    if suffix not in by_suffix:
        kinds = ", ".join(by_suffix)
        raise InputError(f"{path}: a trajectory's file is one of {kinds}, not {suffix!r}")
    return by_suffix[suffix]


def _write_csv(path: Path, table: Table) -> None:
    path.write_text(write_csv(table.columns, table.units, table.header), encoding="utf-8")


def _read_csv(file: BinaryIO) -> Table:
    return Table(*read_csv(file))


def _write_npz(path: Path, table: Table) -> None:
    own: dict[str, Any] = {
        HEADER: np.array(json.dumps(dict(table.header))),
        UNITS: np.array(json.dumps(dict(table.units))),
    }
    with path.open("wb") as file:  # by its name, NumPy would add a suffix of its own
        np.savez(file, allow_pickle=False, **own, **dict(table.columns))


def _read_npz(file: BinaryIO) -> Table:
    try:
        with np.load(file, allow_pickle=False) as members:
            _check_unpacked(sum(each.file_size for each in members.zip.filelist))
            arrays = {name: members[name] for name in members.files}
    except UNREADABLE as error:
        raise InputError(f"it is no NPZ file that can be read: {error}") from None
    header = _texts(arrays.pop(HEADER, None))
    units = _texts(arrays.pop(UNITS, None))
    return Table(dict(_columns(arrays)), units, header)


def _check_unpacked(size: int) -> None:
    """Raises InputError where so many bytes come of a compressed file."""
    if size > LONGEST:
        raise InputError(f"it unpacks to {size / MB:.4g} MB, and may to {LONGEST / MB:g}")


def _texts(member: Any) -> dict[str, str]:
    """The names and texts of a member that holds JSON; none where it holds anything else."""
    try:
        found = json.loads(str(member))
    except ValueError:
        return {}
    if not isinstance(found, dict):
        return {}
    return {str(name): str(text) for name, text in found.items()}


def _columns(arrays: Mapping[str, Any]) -> list[tuple[str, Array]]:
    """Columns (n,) as they are; those of an array (n, k) are `name.0`, `name.1` and so on."""
    columns = []
    for name, array in arrays.items():
        if array.dtype.kind not in "fiub" or array.ndim not in (1, 2):
            continue  # what a simulator keeps beside its trajectory
        numbers = np.asarray(array, dtype=float)
        if array.ndim == 1:
            columns.append((name, numbers))
        else:
            columns += [(f"{name}.{i}", column) for i, column in enumerate(numbers.T)]
    return columns


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise InputError(PARQUET_EXTRA) from None
    return pyarrow, parquet


def _write_parquet(path: Path, table: Table) -> None:
    pyarrow, parquet = _pyarrow()
    metadata = {HEADER: json.dumps(dict(table.header)), UNITS: json.dumps(dict(table.units))}
    whole = pyarrow.table({name: np.asarray(each) for name, each in table.columns.items()})
    parquet.write_table(whole.replace_schema_metadata(metadata), path)


def _read_parquet(file: BinaryIO) -> Table:
    pyarrow, parquet = _pyarrow()
    try:
        packed = parquet.ParquetFile(file)
        _check_unpacked(packed.metadata.num_rows * packed.metadata.num_columns * WORD)
        whole = packed.read()
        types = pyarrow.types
        arrays = {
            name: column.to_numpy()
            for name, column in zip(whole.column_names, whole.columns, strict=True)
            if types.is_floating(column.type) or types.is_integer(column.type)
        }
    except (pyarrow.ArrowException, ValueError, OSError) as error:
        raise InputError(f"it is no Parquet file that can be read: {error}") from None
    metadata = {
        key.decode(errors="replace"): text.decode(errors="replace")
        for key, text in (whole.schema.metadata or {}).items()
    }
    columns = dict(_columns(arrays))
    return Table(columns, _texts(metadata.get(UNITS)), _texts(metadata.get(HEADER)))
