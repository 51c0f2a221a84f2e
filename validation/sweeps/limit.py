"""A limit on the time of a cell, kept in any thread: first by an exception, then by force."""

import ctypes
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


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
    """Ends this process by SIGALRM where the block has not ended at twice `limit` s.

    That signal's default action needs no step in Python, so it ends a call of compiled code too.
    """
    signal.setitimer(signal.ITIMER_REAL, 2.0 * (limit or 0.0))  # 0 is never
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
