"""Ctrl-C and SIGTERM end a command soon, wherever it is, and leave no unfinished file."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from robotball.files.replacing import remove_unfinished

SIGNALS = (signal.SIGINT, signal.SIGTERM)
GRACE = 2.0  # s that Python has to end the command; compiled code may not let it


class Interrupted(KeyboardInterrupt):
    """What a signal ends a block by.

    Python remembers a KeyboardInterrupt itself that has passed an `exec` of text, as a dataclass is
    made by, and dies of the signal at last, however it was met.
    """


def open_closed() -> None:
    """Open each standard stream that is closed to nowhere, lest another file take its number."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            number = os.open(os.devnull, os.O_RDWR)  # the lowest that is free
            os.set_inheritable(number, True)
            stream = os.fdopen(number, mode)
            setattr(sys, name, stream)
            setattr(sys, f"__{name}__", stream)  # which keeps it open where another takes its place


def status_of(number: int) -> int:
    """The exit status of what a signal has ended, as shells give it: 130 after Ctrl-C."""
    return 128 + number


@contextmanager
def ended_by_signals() -> Iterator[list[int]]:
    """Ends the block by Interrupted at a signal, and the process if that takes too long.

    Python acts on a signal between two of its own steps. While compiled code runs there are none,
    but the signal's number arrives in a pipe, at whose other end a thread waits. Whatever the
    block makes of the interrupt, as a library may that was being imported, it leaves by SystemExit.
    Gives the numbers of the signals that came.
    """
    came: list[int] = []
    left = threading.Event()

    def interrupt(number: int, _frame: FrameType | None) -> None:
        came.append(number)
        raise Interrupted

    former: dict[int, Any] = {}
    read, write = os.pipe()
    os.set_blocking(write, False)
    threading.Thread(target=_end_at_last, args=(read, left), daemon=True).start()
    try:
        signal.set_wakeup_fd(write, warn_on_full_buffer=False)
        for each in SIGNALS:  # inside the block, as one may come at once
            if signal.getsignal(each) != signal.SIG_IGN:  # as nohup leaves it
                former[each] = signal.signal(each, interrupt)
        yield came
    except BaseException:
        if not came:
            raise
    finally:
        left.set()
        signal.set_wakeup_fd(-1)
        os.close(write)
        for number, handler in former.items():
            signal.signal(number, handler)
    if came:
        sys.exit(status_of(came[0]))


def _end_at_last(read: int, left: threading.Event) -> None:
    """Wait for a signal's number; end the process where the block is not left GRACE after it."""
    while numbers := os.read(read, 1):
        if numbers[0] in SIGNALS and not left.wait(GRACE):
            remove_unfinished()
            os._exit(status_of(numbers[0]))
    os.close(read)
