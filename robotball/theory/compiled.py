"""Compile functions by numba, each for one signature, and keep the machine code on disk.

numba's own cache reads and writes the files. It would run code that is stale, because it notices a
change of a function's own file alone and of no other that is compiled into it, and code of anyone
who may write its folder. Here the folder is the user's alone, and a function's part of it is named
by a digest of all that the code is made from.
"""

import hashlib
import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from llvmlite.binding import get_host_cpu_name
from numba.extending import register_jitable

from robotball.errors import warn
from robotball.files.replacing import foreign_in, is_own

Function = TypeVar("Function", bound=Callable[..., Any])

_one_at_a_time = threading.Lock()  # numba takes the folder from a setting of the whole process


def inlined(function: Function) -> Function:
    """Make a function one that compiled functions may call; it is compiled into each of them."""
    # Without wrappers, as neither Python nor C calls what is compiled of it.
    return register_jitable(no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)


class Compiled:
    """A function that is compiled for its one signature, or loaded, when it is first needed.

    source, options: as `compiled_from` takes them.
    """

    def __init__(self, function: Any, source: str, signature: str, options: dict[str, Any]) -> None:
        self._function, self._source = function, source
        self._signature, self._options = signature, options
        self._code: Any = None

    def __call__(self, *arguments: Any) -> Any:
        return self.code(*arguments)

    @property
    def code(self) -> Any:
        """What numba makes of the function: compiled, or loaded, once in a process."""
        with _one_at_a_time:
            if self._code is None:
                self._code = self._compiled_or_loaded()
        return self._code

    def _compiled_or_loaded(self) -> Any:
        folder = _folder_for(self._source, self._options)
        if folder is None or not folder.exists():
            _say_once("robotball: compiling to machine code, only this once: 10 s to a minute")
        try:
            return self._compiled(folder)
        except OSError as error:
            _warn_once(f"compiled code is not kept, and compiled anew every time: {error}")
            folder = None
        except Exception:
            # numba lets through whatever pickle raises for a file that is cut short or damaged.
            if folder is None:
                raise
            shutil.rmtree(folder, ignore_errors=True)
        return self._compiled(folder)

    def _compiled(self, folder: Path | None) -> Any:
        before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder or "")
        try:
            # Without the interpreter's lock; a division by zero is infinite, and no exception.
            options = {"nogil": True, "error_model": "numpy", "cache": folder is not None}
            dispatcher = numba.njit(**options, **self._options)(self._function)
        finally:
            numba.config.CACHE_DIR = before
        # Where numba cannot write it goes on to folders of its own, which are not checked.
        if folder is not None and folder not in Path(dispatcher.stats.cache_path).parents:
            raise OSError(f"nothing can be written to {folder}")
        dispatcher.compile(self._signature)
        dispatcher.disable_compile()
        return dispatcher


def compiled_from(source: str, signature: str, **options: Any) -> Callable[[Function], Any]:
    """Return a decorator that makes a function a `Compiled` one, kept on disk.

    source: the text of everything that the function is compiled from, its own and that of all it
    calls; options: more of numba.njit. With another source or other options it is compiled anew.
    Where nothing can be kept, a warning says so, and the function is compiled in memory.
    """
    return lambda function: Compiled(function, source, signature, options)


def text_of(*files: str | Path) -> str:
    """Return the text of all files."""
    return "".join(Path(file).read_text(encoding="utf-8") for file in files)


def _folder_for(source: str, options: dict[str, Any]) -> Path | None:
    """Return the folder of one function: the same in every process that would compile the same."""
    home = cache_folder()
    # The text of a set has its items in another order in every process.
    plain = {name: sorted(o) if isinstance(o, set) else o for name, o in options.items()}
    # numba's index has the processor too. But processes on two of them that share a home would each
    # write the first file of an index, and one of them would then be loaded for the other.
    processor = numba.config.CPU_NAME or get_host_cpu_name(), numba.config.CPU_FEATURES
    made_from = repr((numba.__version__, processor, plain, source))
    digest = hashlib.sha256(made_from.encode()).hexdigest()[:32]
    if home is None:
        return None
    if (home / digest).exists() and (foreign := foreign_in(home / digest)) is not None:
        _warn_once(
            f"compiled code is not kept, and compiled anew every time: {foreign} belongs to "
            f"another user, or others may write there; delete {home / digest}"
        )
        return None
    return home / digest


@cache
def _warn_once(line: str) -> None:
    warn(line)


@cache
def _say_once(line: str) -> None:
    with suppress(OSError):  # the file that takes it may be on a full disk
        print(line, file=sys.stderr, flush=True)


def cache_folder() -> Path | None:
    """Return where compiled code is kept: in the user's cache, or else a temporary folder.

    None, with a warning, where neither belongs to this user alone: what is loaded from it is run.
    """
    home = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    for folder in (home / "robotball", Path(tempfile.gettempdir(), f"robotball-{os.getuid()}")):
        try:
            there = folder.expanduser()
            there.mkdir(mode=0o700, parents=True, exist_ok=True)
            if is_own(there):
                return there
        except (OSError, RuntimeError):  # RuntimeError: the user has no home
            continue
    _warn_once(
        "compiled code is not kept, and compiled anew every time: no folder for it belongs to this "
        f"user alone; set XDG_CACHE_HOME (tried {home})"
    )
    return None
