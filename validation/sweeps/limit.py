"""A limit on the time of a cell, kept in any thread: first by an exception, then by force."""

import ctypes
import faulthandler
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class TookTooLong(BaseException):
    """Raised in the midst of the work; no Exception, so that the work does not catch it."""


def too_long(limit: float) -> str:
    """Why a cell has no record, whichever way it was ended."""
    return f"took longer than {limit:g} s"


@contextmanager
def limited(limit: float | None) -> Iterator[None]:
    """Raises TookTooLong in the block, at its next step in Python, once `limit` s have passed.

    A call of compiled code is not interrupted: the exception comes when it returns.
    """
    if limit is None:
        yield
        return
    thread = threading.get_ident()
    timer = threading.Timer(limit, _raise, (thread, ctypes.py_object(TookTooLong)))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
        _raise(thread, None)  # one that came too late is taken back


def _raise(thread: int, kind: object) -> None:
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), kind)


@contextmanager
def killed_after(limit: float | None) -> Iterator[None]:
    """Ends this process where the block has not ended long after `limit` s: see `patience`.

    It needs no step in Python, so it ends a call of compiled code too.
    """
    if limit is None:
        yield
        return
    with Path(os.devnull).open("w") as nowhere:
        faulthandler.dump_traceback_later(patience(limit), exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


def patience(limit: float) -> float:
    """How long [s] a call of compiled code may keep a cell from ending at its limit [s]."""
    return 2.0 * limit
