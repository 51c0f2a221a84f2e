"""Read logs that are no tables: JSON lines, ROS bags, MCAP and MATLAB files.

The numbers of nested records become columns, named by the keys that lead to them, such as
"imu.angular_velocity.x". A list beside names, as in a JointState, uses these:
"joint_states.roll_joint.position".
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from numbers import Real
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from robotball.errors import InputError
from robotball.rotations import Array

_LONGEST = 8  # numbers of a list that become columns; covariances and images are longer
_DEEPEST = 16  # nested keys
_NS = 1_000_000_000


def numbers_in(value: Any, name: str = "", depth: int = 0) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a nested record, with their names."""
    if hasattr(value, "__dataclass_fields__"):  # a ROS message
        value = vars(value)
    if isinstance(value, np.ndarray):
        value = value.tolist() if value.size <= _LONGEST else ()
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
                    yield from numbers_in(number, f"{start}{label}.{key}", depth + 1)
            else:
                yield from numbers_in(inner, f"{start}{key}", depth + 1)
    elif isinstance(value, list | tuple) and len(value) <= _LONGEST and depth < _DEEPEST:
        for i, inner in enumerate(value):
            yield from numbers_in(inner, f"{name}.{i}", depth + 1)


def columns_of(records: Iterable[Mapping[str, float]]) -> dict[str, Array]:
    """Return the columns of records; NaN in records that do not have a number."""
    rows = list(records)
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}


def read_json_lines(file: BinaryIO) -> dict[str, Array]:
    """Return the columns of a file with one JSON object per line."""
    records = []
    for number, line in enumerate(file, 1):
        try:
            record = json.loads(line) if line.strip() else {}
        except ValueError as error:
            raise InputError(f"line {number} is not JSON: {error}") from None
        if record:
            records.append(dict(numbers_in(record)))
    return columns_of(records)


def read_bag(file: BinaryIO) -> dict[str, Array]:
    """Return the columns of a ROS bag: one row for each time stamp, the time in ns."""
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
            record = dict(numbers_in(message, connection.topic.strip("/")))
            stamp = {name: record.pop(name) for name in [*record] if "stamp." in name}
            sec, nanosec = (*map(int, stamp.values()), 0, 0)[:2]
            rows.setdefault(sec * _NS + nanosec or received, {}).update(record)
    return columns_of({"t [ns]": float(at), **rows[at]} for at in sorted(rows))


def read_mat(file: BinaryIO) -> dict[str, Array]:
    """Return the columns of a MATLAB file: its longest vectors, and matrices with as many rows."""
    from scipy.io import loadmat  # late: it takes a tenth of a second

    try:
        members = loadmat(file.name, appendmat=False, simplify_cells=True)
    except NotImplementedError:
        raise InputError("MATLAB files of version 7.3 are not read; save with -v7") from None
    arrays = dict(_arrays(members))
    longest = max((len(array) for array in arrays.values()), default=0)
    return {name: array for name, array in arrays.items() if len(array) == longest}


def _arrays(members: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Array]]:
    for name, value in members.items():
        if isinstance(value, Mapping):
            yield from _arrays(value, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray) and value.ndim in (1, 2):
            yield f"{prefix}{name}", value if value.shape[0] == max(value.shape) else value.T


READERS = {".jsonl": read_json_lines, ".ndjson": read_json_lines, ".mat": read_mat}
READERS |= dict.fromkeys((".bag", ".db3", ".mcap"), read_bag)
