"""Reads files of the user's: regular ones alone, up to a limit."""

import errno
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from robotball.errors import InputError

LONGEST = 10_000_000  # bytes of a scene, a robot or a record
MB = 1e6


def contents(path: Path, longest: int = LONGEST) -> bytes:
    """The bytes of a file that `opened` opens."""
    with opened(path, longest) as file:
        return file.read()


@contextmanager
def opened(path: Path, longest: int = LONGEST) -> Iterator[BinaryIO]:
    """A regular file to be read, links followed.

    Raises InputError, with the path, for one that cannot be read or is longer, and for a device or
    a pipe, which may have no end or keep its reader waiting.
    """
    try:
        found = path.stat()
        if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
            raise OSError(errno.EINVAL, "it is no regular file; copy what it gives into one")
        if found.st_size > longest:
            size, limit = found.st_size / MB, longest / MB
            raise OSError(errno.EFBIG, f"it has {size:.4g} MB, and may have {limit:g}; shorten it")
        file = path.open("rb")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except ValueError as error:  # a null byte in the name
        raise InputError(f"{path}: {error}") from None
    with file:
        yield file
