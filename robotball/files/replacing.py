"""Files that are whole or not there."""

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

from robotball.errors import InputError

STANDARD_OUTPUT = Path("-")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path whose file takes the place of `path` when the block ends well.

    The folder is made if need be. A link is followed: the file that it names is replaced. What is
    no regular file, as a device or a pipe, is not replaced but written into, and so is standard
    output, as `-`. Raises InputError where nothing can be written.
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
        # Cut, so that a name of any length that is allowed stays so. Machines that share the folder
        # have processes of equal numbers, so the name has random ones.
        unique = os.urandom(8).hex()
        temporary = target.with_name(f".{path.stem[:20]}.{unique}{path.suffix[:20]}")
        with _unfinished(temporary):
            yield temporary
            temporary.replace(target)


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
    """Takes all temporary files away, for a process that ends at once."""
    for temporary in list(_UNFINISHED):
        temporary.unlink(missing_ok=True)


def discard(path: Path) -> None:
    """Takes a regular file away, if there is one; raises InputError where that is forbidden."""
    with refused(path):
        if path.is_file():
            path.unlink()


@contextmanager
def refused(path: Path) -> Iterator[None]:
    """Makes an InputError, with the path, of what the system says against writing it."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None


def followed(path: Path) -> Path:
    """The file that `path` names, links followed.

    Raises OSError where they run in a circle, and for a name that no file can have.
    """
    try:
        target = path.resolve()
    except RuntimeError:  # until Python 3.12
        target = path
    # Asked of the system: since Python 3.14 a Path says of a name too long that nothing is there.
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        if stat.S_ISLNK(os.lstat(target).st_mode):
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    return target


def no_regular_file(path: Path) -> bool:
    """Whether there is something at `path`, links followed, that is no regular file; or `-`."""
    return path == STANDARD_OUTPUT or (path.exists() and not path.is_file())


def _write_into(path: Path, whole: Path) -> None:
    with whole.open("rb") as text:
        if path != STANDARD_OUTPUT:
            with path.open("wb") as file:
                shutil.copyfileobj(text, file)
        elif sys.__stdout__ is not None:
            sys.__stdout__.flush()
            # A reader who has seen enough, as head, has what he asked for.
            with contextlib.suppress(BrokenPipeError), open(1, "wb", closefd=False) as file:
                shutil.copyfileobj(text, file)
