"""Compile functions with numba, each for one signature, and cache the machine code on disk.

numba's cache reads and writes the files. Without further measures it would run stale code, because
it checks only the file of a function and not the files of the function's callees. It would also run
code of anyone who can write to its folder. Here the folder belongs to the user alone, and the name
of a function's subfolder contains a digest of everything from which the code is compiled.
"""

import gc
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

_NOT_CACHED = "compiled code cannot be cached and is compiled again in every process"
_one_at_a_time = threading.Lock()  # because numba's cache folder is set for the whole process


def inlined(function: Function) -> Function:
    """Let compiled functions call this function, which is compiled into each of them."""
    # No wrappers are needed, because neither Python nor C calls the compiled code.
    return register_jitable(no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)


class Compiled:
    """A function that is compiled for one signature, or loaded from the cache, on first use.

    source, options: as in `compiled_from`.
    """

    def __init__(self, function: Any, source: str, signature: str, options: dict[str, Any]) -> None:
        self._function, self._source = function, source
        self._signature, self._options = signature, options
        self._code: Any = None

    def __call__(self, *arguments: Any) -> Any:
        return self.code(*arguments)

    @property
    def code(self) -> Any:
        """numba's dispatcher, compiled or loaded once in a process."""
        with _one_at_a_time:
            if self._code is None:
                self._code = self._compiled_or_loaded()
        return self._code

    def _compiled_or_loaded(self) -> Any:
        folder = _folder_for(self._source, self._options)
        if folder is None or not folder.exists():
            _say_once("robotball: compiling to machine code, only once: 10 s to a minute")
        try:
            return self._compiled(folder)
        except OSError as error:
            _warn_once(f"{_NOT_CACHED}: {error}")
            folder = None
        except Exception:
            # numba passes on any exception of pickle for a truncated or damaged file.
            if folder is None:
                raise
            shutil.rmtree(folder, ignore_errors=True)
        return self._compiled(folder)

    def _compiled(self, folder: Path | None) -> Any:
        before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder or "")
        collects = gc.isenabled()
        gc.disable()  # garbage collection would take a fifth of the time
        try:
            # The code releases the interpreter's lock. A division by zero gives infinity instead of
            # an exception.
            options = {"nogil": True, "error_model": "numpy", "cache": folder is not None}
            dispatcher = numba.njit(**options, **self._options)(self._function)
            # If numba could not write to this folder, it would use folders that are not checked.
            if folder is not None and folder not in Path(dispatcher.stats.cache_path).parents:
                raise OSError(f"cannot write to {folder}")
            dispatcher.compile(self._signature)
        finally:
            numba.config.CACHE_DIR = before
            if collects:
                gc.enable()
        dispatcher.disable_compile()
        return dispatcher


def compiled_from(source: str, signature: str, **options: Any) -> Callable[[Function], Any]:
    """Return a decorator that makes a function a `Compiled` function, cached on disk.

    source: the text of everything from which the function is compiled, including its callees;
    options: for numba.njit. The function is compiled again if the source or the options change. If
    it cannot be cached, it is compiled in memory, with a warning.
    """
    return lambda function: Compiled(function, source, signature, options)


def text_of(*files: str | Path) -> str:
    """Return the text of all files."""
    return "".join(Path(file).read_text(encoding="utf-8") for file in files)


def _folder_for(source: str, options: dict[str, Any]) -> Path | None:
    """Return the folder of a function; processes that would compile the same code share it."""
    home = cache_folder()
    # The order of a set's items differs between processes.
    plain = {name: sorted(o) if isinstance(o, set) else o for name, o in options.items()}
    # numba's index also contains the processor. But if two machines share a home folder, each would
    # write the first file of an index, and one machine would load the code of the other.
    processor = numba.config.CPU_NAME or get_host_cpu_name(), numba.config.CPU_FEATURES
    made_from = repr((numba.__version__, processor, plain, source))
    digest = hashlib.sha256(made_from.encode()).hexdigest()[:32]
    if home is None:
        return None
    if (home / digest).exists() and (foreign := foreign_in(home / digest)) is not None:
        _warn_once(
            f"{_NOT_CACHED}: {foreign} belongs to another user, or others may write there: delete "
            f"{home / digest}"
        )
        return None
    return home / digest


@cache
def _warn_once(line: str) -> None:
    warn(line)


@cache
def _say_once(line: str) -> None:
    with suppress(OSError):  # standard error may be a file on a full disk
        print(line, file=sys.stderr, flush=True)


def cache_folder() -> Path | None:
    """Return the folder for compiled code: in the user's cache, or else a temporary folder.

    Loaded code is executed, so the folder must belong to this user alone. If neither folder does,
    there is a warning, and None is returned.
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
        f"{_NOT_CACHED}: no folder for it belongs to this user alone: set XDG_CACHE_HOME (tried "
        f"{home})"
    )
    return None
