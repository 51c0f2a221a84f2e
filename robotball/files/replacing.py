"""Files that are written whole or not at all.

`replacing` writes beside the final name and renames at the end, so that nobody ever finds half a
file.
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

from robotball.errors import InputError

STANDARD_OUTPUT = Path("-")


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


def is_own(folder: Path) -> bool:
    """Return whether this user owns a folder, and the link to it, and no other may write there."""
    there = folder.stat()
    return (
        folder.lstat().st_uid == there.st_uid == os.getuid()
        and not there.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        and os.access(folder, os.W_OK | os.X_OK)
    )


def foreign_in(folder: Path) -> Path | None:
    """Return the first folder or file that others may change, in one whose code is run, or None.

    Everything in the folder must belong to this user, and not be writable by others. The group may
    write there unless it can enter the folder. What a link names may belong to the system. Hidden
    files are not looked at: they are locks and notes of the programs that made the folder.
    """
    if not is_own(folder):
        return folder
    closed = not folder.stat().st_mode & stat.S_IRWXG
    others = stat.S_IWOTH if closed else stat.S_IWOTH | stat.S_IWGRP
    folders = [os.fspath(folder)]
    while folders:
        with os.scandir(folders.pop()) as entries:
            for entry in entries:
                found, owners = entry.stat(follow_symlinks=False), [os.getuid()]
                if stat.S_ISDIR(found.st_mode):
                    folders.append(entry.path)
                elif entry.name.startswith("."):
                    continue
                if stat.S_ISLNK(found.st_mode):
                    try:
                        found, owners = entry.stat(), [os.getuid(), 0]
                    except OSError:  # it leads nowhere, and nothing is loaded by it
                        continue
                if found.st_uid not in owners or found.st_mode & others:
                    return Path(entry.path)
    return None


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
