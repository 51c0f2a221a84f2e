"""Scenes, bodies and motions as files; how a user's file is opened.

`contents` and `opened` read regular files alone, up to a limit, and `readable` turns a reader's
errors into an InputError. `replacing` has how files are written, and the others know the formats.
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

# Bytes of a scene, a robot or a record; those of the catalog have 1.4 kB at most.
_MOST_CHARACTERS = 10_000_000
MB = 1e6
# What readers raise for bytes that are damaged, nested too deeply or of another format. Errors of
# a reader's own are known by the names of their modules, as not all of these are loaded.
_UNREADABLE = (
    ArithmeticError, EOFError, LookupError, MemoryError, OSError, RuntimeError, TypeError,
    ValueError,
)  # fmt: skip
_READERS = ("_lzma", "msgspec", "pyarrow.lib", "tokenize", "zipfile", "zlib")


MODEL_FILES = (".xml", ".mjcf", ".urdf")


def contents(path: Path, longest: int = _MOST_CHARACTERS) -> bytes:
    """Return the bytes of a regular file, without a byte order mark.

    Raises InputError as `opened` does.
    """
    with opened(path, longest) as file:
        return file.read().removeprefix(BOM_UTF8)


@contextmanager
def readable(what: str) -> Iterator[None]:
    """Raise InputError, which begins with `what`, for what a reader in the block raises."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if not (isinstance(error, _UNREADABLE) or type(error).__module__ in _READERS):
            raise
        raise InputError(f"{what}: {error}") from None


def as_path(what: str, path: object) -> Path:
    """Return a path that a user gave. Raises InputError unless it is a str or a Path."""
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"{what} must be a path or a name, not {path!r}")
    return Path(path)


@contextmanager
def opened(path: Path, longest: int = _MOST_CHARACTERS) -> Iterator[BinaryIO]:
    """Open a regular file of at most `longest` bytes for reading, links followed.

    Raises InputError, with the path, for a file that cannot be read or is longer, and for a device
    or a pipe.
    """
    try:
        found = path.stat()
        # /dev/zero has no end, and a pipe keeps its reader waiting until somebody writes. A folder
        # is left to `open`, whose message says what it is.
        if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
            raise OSError(errno.EINVAL, "it is no regular file; copy what it gives into one")
        if found.st_size > longest:
            size, limit = found.st_size / MB, longest / MB
            raise OSError(errno.EFBIG, f"it has {size:.4g} MB, and may have {limit:g}; shorten it")
        file = path.open("rb")
    except (OSError, ValueError) as error:  # of a null byte in the name, the latter
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    with file:
        yield file
