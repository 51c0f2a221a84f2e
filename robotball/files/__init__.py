"""Files on disk: users' files are read up to a limit, ours are written whole or not at all.

`contents` and `opened` read regular files alone. `replacing` writes beside the final name and
renames at the end, so that nobody ever finds half a file. The modules of this package know the
formats.
"""

import contextlib
import errno
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from robotball.errors import InputError

LONGEST = (
    10_000_000  # bytes of a scene, a robot or a record; those of the catalog have 1.4 kB at most
)
MB = 1e6
STANDARD_OUTPUT = Path("-")


def contents(path: Path, longest: int = LONGEST) -> bytes:
    """Return the bytes of a regular file. Raises InputError as `opened` does."""
    with opened(path, longest) as file:
        return file.read()


@contextmanager
def opened(path: Path, longest: int = LONGEST) -> Iterator[BinaryIO]:
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
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except ValueError as error:  # a null byte in the name
        raise InputError(f"{path}: {error}") from None
    with file:
        yield file


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path, whose file takes the place of `path` when the block ends well.

    The folder is made if need be. A link is followed: the file that it names is replaced. A device
    or a pipe is not replaced but written into, and so is standard output, as `-`. Raises InputError
    where nothing can be written.
    """
    with refused(path):
        if no_regular_file(path):
            with tempfile.TemporaryDirectory() as folder:
                temporary = Path(folder, f"whole{path.suffix}")
                with _unfinished(temporary):
                    yield temporary
                    _write_into(path, temporary)
            return
        target = followed(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        # The name is cut, so that one of the greatest length that is allowed stays so. It has
        # random digits and no process number: machines that share the folder may have equal ones.
        unique = os.urandom(8).hex()
        temporary = target.with_name(f".{path.stem[:20]}.{unique}{path.suffix[:20]}")
        with _unfinished(temporary):
            yield temporary
            temporary.replace(target)


# The temporary files of this process that `remove_unfinished` has to find.
_UNFINISHED: set[Path] = set()


@contextmanager
def _unfinished(temporary: Path) -> Iterator[None]:
    _UNFINISHED.add(temporary)
    try:
        yield
    finally:
        temporary.unlink(missing_ok=True)
        _UNFINISHED.discard(temporary)


def remove_unfinished() -> None:
    """Delete all temporary files, for a process that ends without unwinding its stack."""
    for temporary in list(_UNFINISHED):
        temporary.unlink(missing_ok=True)


def discard(path: Path) -> None:
    """Delete a regular file, if there is one. Raises InputError where that is forbidden."""
    with refused(path):
        if path.is_file():
            path.unlink()


@contextmanager
def refused(path: Path) -> Iterator[None]:
    """Turn an OSError of writing into an InputError with the path."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None


def followed(path: Path) -> Path:
    """Return the file that `path` names, links followed.

    Raises OSError where links run in a circle, and for a name that no file can have.
    """
    try:
        target = path.resolve()
    except RuntimeError:  # until Python 3.12
        target = path
    # The system is asked, because since Python 3.14 Path.is_symlink answers False to a name that is
    # too long, as if nothing were there.
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        if stat.S_ISLNK(os.lstat(target).st_mode):
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    return target


def no_regular_file(path: Path) -> bool:
    """Return whether `path` is `-`, or names something that is there and no regular file."""
    return path == STANDARD_OUTPUT or (path.exists() and not path.is_file())


def _write_into(path: Path, whole: Path) -> None:
    with whole.open("rb") as text:
        if path != STANDARD_OUTPUT:
            with path.open("wb") as file:
                shutil.copyfileobj(text, file)
        elif sys.__stdout__ is not None:
            sys.__stdout__.flush()
            # A reader that has seen enough, as head, closes the pipe; that is no error.
            with contextlib.suppress(BrokenPipeError), open(1, "wb", closefd=False) as file:
                shutil.copyfileobj(text, file)
