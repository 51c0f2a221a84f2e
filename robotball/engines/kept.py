"""Compiled code kept on disk: whole and its user's own, or compiled anew.

numba's own cache trusts the folder and the files that it finds. Here the folder is nobody else's,
and every file begins with a digest of the rest.
"""

import hashlib
import os
import pickle
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from robotball.errors import InputError, warn
from robotball.files import replacing

Function = TypeVar("Function", bound=Callable[..., Any])

DIGEST = hashlib.sha256().digest_size
OTHERS_MAY_WRITE = 0o022  # in a folder's mode


def compiled_from(source: str, signature: str, **options: Any) -> Callable[[Function], Any]:
    """Numba's njit for one signature, its result kept.

    source: all that the function is compiled from, its own text and what that takes in from others;
    options: njit's. With another source or other options it is compiled anew.
    """

    def decorate(function: Function) -> Any:
        dispatcher = numba.njit(**options)(function)
        # A set's text has its items in no order.
        told = {name: sorted(o) if isinstance(o, set) else o for name, o in options.items()}
        dispatcher._cache = Kept(function.__qualname__, f"{source}\n{told}")
        dispatcher.compile(signature)
        dispatcher.disable_compile()
        return dispatcher

    return decorate


class Kept:
    """What numba asks of a cache (numba.core.caching._Cache), for one function."""

    def __init__(self, name: str, source: str) -> None:
        self.name, self.source = name, source

    @property
    def cache_path(self) -> str:
        return str(cache_folder())

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The compiled function, or None."""
        target.refresh()
        path = self._path(signature, target)
        data = None if path is None else read(path)
        return None if data is None else CompileResult._rebuild(target, *pickle.loads(data))

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep it, or warn where it cannot be kept."""
        path = self._path(signature, result.target_context)
        if path is not None:
            write(path, dumps(result._reduce()))

    def enable(self) -> None:
        """It is never off."""

    disable = flush = enable

    def _path(self, signature: Any, target: Any) -> Path | None:
        folder = cache_folder()
        made_by = (numba.__version__, sys.implementation.cache_tag, target.codegen().magic_tuple())
        key = repr((made_by, self.name, str(signature), self.source))
        digest = hashlib.sha256(key.encode()).hexdigest()[:32]
        return None if folder is None else folder / f"{self.name}-{digest}.compiled"


def read(path: Path) -> bytes | None:
    """What was written to a file; None where there is none, and where it is damaged."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    data = content[DIGEST:]
    return data if content[:DIGEST] == hashlib.sha256(data).digest() else None


def write(path: Path, data: bytes) -> None:
    """Write a file for `read`; warns where that is not possible."""
    try:
        with replacing(path) as temporary:
            temporary.write_bytes(hashlib.sha256(data).digest() + data)
    except InputError as error:
        _warn_once(f"compiled code is not kept, and compiled anew every time: {error}")


@cache
def _warn_once(line: str) -> None:
    warn(line)


def cache_folder() -> Path | None:
    """Where compiled code is kept: in the user's cache, or else in a temporary folder of his own.

    None, with a warning, where neither belongs to this user alone: what is loaded from it is run.
    """
    home = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    for folder in (home / "robotball", Path(tempfile.gettempdir(), f"robotball-{os.getuid()}")):
        try:
            there = folder.expanduser()
            there.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _is_own(there):
                return there
        except (OSError, RuntimeError):  # RuntimeError: the user has no home
            continue
    _warn_once(
        "compiled code is not kept, and compiled anew every time: no folder for it belongs to this "
        f"user alone; set XDG_CACHE_HOME (tried {home})"
    )
    return None


def _is_own(folder: Path) -> bool:
    """Whether a folder, and the link to it if it is one, are this user's, for no other to write."""
    there = folder.stat()
    return (
        folder.lstat().st_uid == there.st_uid == os.getuid()
        and not there.st_mode & OTHERS_MAY_WRITE
        and os.access(folder, os.W_OK | os.X_OK)
    )
