"""Read and write scenes, bodies and motions; open the user's files safely.

`contents` and `opened` read only regular files, up to a size limit; `readable` turns a reader's
errors into an InputError. `replacing` writes files; the other modules implement the formats.
"""

import errno
import os
import stat
from codecs import BOM_UTF8
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from robotball.errors import InputError

MB = 1e6  # bytes
_MAX_BYTES = 10_000_000  # of a scene, robot or record file; catalog scenes have at most 1.4 kB
MODEL_FILES = (".xml", ".mjcf", ".urdf")
# Exceptions that readers raise for damaged, too deeply nested or foreign bytes. Readers' own error
# classes are recognized by module name, because not all of these modules are loaded.
_DAMAGED = (ArithmeticError, EOFError, LookupError, MemoryError)
_UNREADABLE = (*_DAMAGED, OSError, RuntimeError, TypeError, ValueError)
_READERS = ("_lzma", "msgspec", "pyarrow.lib", "tokenize", "zipfile", "zlib")


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
        if not (isinstance(error, _UNREADABLE) or type(error).__module__ in _READERS):
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

    Raises InputError, naming the path, for a file that is longer or unreadable, a device or a pipe.
    """
    try:
        status = path.stat()
        # /dev/zero never ends, and a pipe blocks until somebody writes. For a folder, `open` itself
        # raises a clear error.
        if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
            raise OSError(errno.EINVAL, "not a regular file; copy its contents into one")
        if status.st_size > longest:
            size, limit = status.st_size / MB, longest / MB
            raise OSError(errno.EFBIG, f"{size:.4g} MB, above the limit of {limit:g}; shorten it")
        file = path.open("rb")
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    with file:
        yield file
