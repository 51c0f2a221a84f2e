"""Write files completely or not at all.

`replacing` writes to a temporary file beside the target and renames that file at the end, so
readers never find half a file.
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
_UNFINISHED: set[Path] = set()  # temporary files of this process, for `remove_unfinished`


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path. Its file replaces `path` when the block ends without an error.

    Missing folders are created, and links are followed. A device, a pipe or standard output (`-`)
    is not replaced; the content is written into it. Raises InputError if `path` cannot be written.
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
        # The stem and suffix are cut, so that the temporary name is not too long if the target has
        # the longest allowed name. The name has random digits instead of the process number, which
        # may be the same on machines that share the folder.
        unique = os.urandom(8).hex()
        temporary = target.with_name(f".{path.stem[:20]}.{unique}{path.suffix[:20]}")
        with _unfinished(temporary):
            yield temporary
            temporary.replace(target)


@contextmanager
def _unfinished(temporary: Path) -> Iterator[None]:
    _UNFINISHED.add(temporary)
    try:
        yield
    finally:
        temporary.unlink(missing_ok=True)
        _UNFINISHED.discard(temporary)


def remove_unfinished() -> None:
    """Delete all temporary files; called by a process that ends without unwinding its stack."""
    for temporary in list(_UNFINISHED):
        temporary.unlink(missing_ok=True)


@contextmanager
def refused(path: Path) -> Iterator[None]:
    """Turn an OSError from writing into an InputError with the path."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None


def followed(path: Path) -> Path:
    """Return the file that `path` refers to, following links.

    Raises OSError if links form a cycle or the name is not a possible file name.
    """
    try:
        target = path.resolve()
    except RuntimeError:  # until Python 3.12
        target = path
    # Not Path.is_symlink, which returns False for too long a name since Python 3.14.
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        if stat.S_ISLNK(os.lstat(target).st_mode):
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
    return target


def is_own(folder: Path) -> bool:
    """Return whether this user owns a folder and any link to it, and only this user can write."""
    status = folder.stat()
    return (
        folder.lstat().st_uid == status.st_uid == os.getuid()
        and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        and os.access(folder, os.W_OK | os.X_OK)
    )


def foreign_in(folder: Path) -> Path | None:
    """Return the first entry of a folder of executed code that others could change, or None.

    An entry must belong to this user. Other users must not be able to write to it, nor a group that
    can enter the folder, except if the entry has hard links elsewhere. A symbolic link may point to
    a file of root. Hidden files, such as locks, are skipped.
    """
    if not is_own(folder):
        return folder
    closed = not folder.stat().st_mode & stat.S_IRWXG
    others = stat.S_IWOTH if closed else stat.S_IWOTH | stat.S_IWGRP
    folders = [os.fspath(folder)]
    while folders:
        with os.scandir(folders.pop()) as entries:
            for entry in entries:
                status, owners = entry.stat(follow_symlinks=False), [os.getuid()]
                if stat.S_ISDIR(status.st_mode):
                    folders.append(entry.path)
                elif entry.name.startswith("."):
                    continue
                if stat.S_ISLNK(status.st_mode):
                    try:
                        status, owners = entry.stat(), [os.getuid(), 0]
                    except OSError:  # a link to a missing file, from which nothing can be loaded
                        continue
                shared = stat.S_ISREG(status.st_mode) and status.st_nlink > 1
                group = stat.S_IWGRP if shared else 0
                if status.st_uid not in owners or status.st_mode & (others | group):
                    return Path(entry.path)
    return None


def no_regular_file(path: Path) -> bool:
    """Return whether `path` is `-` or exists and is not a regular file."""
    return path == STANDARD_OUTPUT or (path.exists() and not path.is_file())


def _write_into(path: Path, whole: Path) -> None:
    with whole.open("rb") as text:
        if path != STANDARD_OUTPUT:
            with path.open("wb") as file:
                shutil.copyfileobj(text, file)
        elif sys.__stdout__ is not None:
            sys.__stdout__.flush()
            # It is not an error if a reader such as `head` closes the pipe early.
            with contextlib.suppress(BrokenPipeError), open(1, "wb", closefd=False) as file:
                shutil.copyfileobj(text, file)
