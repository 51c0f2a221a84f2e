"""Read and write scenes, bodies and motions; open the user's files safely.

`contents` and `opened` read only regular files, up to a size limit; `readable` turns a reader's
errors into an InputError. `json_text` writes any result as strict JSON. A value without a JSON
equivalent becomes null, a list, an object or a text, because an error would lose the results of a
long computation. The module `replacing` writes files; the other modules implement the formats.
"""

import errno
import json
import math
import os
import stat
from codecs import BOM_UTF8
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from enum import Enum
from numbers import Integral, Real
from pathlib import Path
from typing import Any, BinaryIO

from robotball.errors import InputError

MB = 1e6  # bytes
_MAX_BYTES = 10_000_000  # of a scene, robot or record file; catalog scenes have at most 1.4 kB
_MAX_DEPTH = 100  # nested lists and objects in JSON; readers may refuse more
_MAX_BITS = 1024  # of an integer; an integer with more bits would overflow a float
MODEL_FILES = (".xml", ".mjcf", ".urdf")
# Exceptions that readers raise for damaged, too deeply nested or foreign bytes. Readers' own error
# classes are recognized by module name, because not all of these modules are loaded.
_DAMAGED = (ArithmeticError, EOFError, LookupError, MemoryError)
_UNREADABLE = (*_DAMAGED, OSError, RuntimeError, TypeError, ValueError)
_READERS = ("_lzma", "msgspec", "pyarrow", "rosbags", "scipy", "tokenize", "zipfile", "zlib")


def contents(path: Path, longest: int = _MAX_BYTES) -> bytes:
    """Return the bytes of a regular file, without a byte order mark.

    Raises InputError as `opened` does.
    """
    with opened(path, longest) as file:
        return file.read().removeprefix(BOM_UTF8)


@contextmanager
def readable(prefix: str) -> Iterator[None]:
    """Turn a reader's exceptions in the block into an InputError that starts with `prefix`."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if not (isinstance(error, _UNREADABLE) or type(error).__module__.split(".")[0] in _READERS):
            raise
        raise InputError(f"{prefix}: {error}") from None


def as_path(name: str, path: object) -> Path:
    """Return the user's path as a Path. Raises InputError unless it is a str or path-like."""
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"{name} must be a path or a name, not {path!r}")
    return Path(path)


@contextmanager
def opened(path: Path, longest: int = _MAX_BYTES) -> Iterator[BinaryIO]:
    """Open a regular file of at most `longest` bytes for reading; links are followed.

    Raises InputError with the path if the file is longer or cannot be read, or if it is a device or
    a pipe.
    """
    try:
        status = path.stat()
        # /dev/zero never ends, and a pipe blocks until somebody writes. For a folder, `open` itself
        # raises a clear error.
        if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
            raise OSError(errno.EINVAL, "not a regular file; copy its contents into one")
        if status.st_size > longest:
            size, limit = status.st_size / MB, longest / MB
            raise OSError(errno.EFBIG, f"{size:.4g} MB, more than {limit:g} MB; shorten the file")
        file = path.open("rb")
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    with file:
        yield file


def json_text(value: object, indent: int | None = None) -> str:
    """Return a value as JSON text, on one line if `indent` is None.

    NaN, infinities and integers beyond the range of a float become null. Members of enumerations
    become their values, dataclasses and msgspec structs become objects, arrays and other
    collections become lists, and any other value becomes its text.
    """
    return json.dumps(_plain(value), indent=indent, ensure_ascii=False)


def embedded_json(value: object) -> str:
    """Return JSON in which `<` is escaped, so that it cannot end a script element of a page."""
    return json_text(value).replace("<", "\\u003c")


def _plain(value: Any, above: tuple[int, ...] = ()) -> Any:
    """Return a value as JSON types. above: ids of the containers that contain the value."""
    try:
        match value:
            case None | bool():
                return value
            case Enum():
                return _plain(value.value, above)
            case str():
                return _text(value)
            case Integral():
                return int(value) if int(value).bit_length() <= _MAX_BITS else None
            case Real():
                return float(value) if math.isfinite(value) else None
            case _ if id(value) in above or len(above) >= _MAX_DEPTH or isinstance(value, bytes):
                return _text(value)
            case _ if hasattr(value, "tolist"):  # this module imports neither NumPy nor msgspec
                inside = value.tolist()
                return _text(value) if inside is value else _plain(inside, (*above, id(value)))
            case Mapping():
                items = [*value.items()]
            case _ if is_dataclass(value) and not isinstance(value, type):
                items = [(field.name, getattr(value, field.name)) for field in fields(value)]
            case _ if hasattr(value, "__struct_fields__"):
                items = [(name, getattr(value, name)) for name in value.__struct_fields__]
            case Collection():
                return [_plain(item, (*above, id(value))) for item in value]
            case _:
                return _text(value)
        return {_key(key): _plain(item, (*above, id(value))) for key, item in items}
    except Exception:  # a method of the object failed; the other results must not be lost
        return _text(value)


def _key(key: object) -> str:
    return _text(key.value if isinstance(key, Enum) else key)


def _text(value: object) -> str:
    """Return a value's text, with unpaired surrogates replaced by `?`."""
    try:
        return str(value).encode(errors="replace").decode()
    except Exception:
        return f"<{type(value).__name__}>"
