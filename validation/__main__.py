"""The `robotball` command as a process: streams, signals, exit status.

`python -m validation` is the same. A character that a stream cannot show, and a reader that goes
away, end no command. Ctrl-C, SIGTERM and a closed terminal (SIGHUP) end it soon, wherever it is,
and leave no unfinished file. The processes of a command import this module, so it imports little.
"""

import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from robotball.errors import InputError
from robotball.files.replacing import remove_unfinished

_DEFECT = 3  # the exit status where robotball itself is wrong
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_SIGNALLED = 128  # and the signal's number: what shells give, so 130 after Ctrl-C
_GRACE = 2.0  # s that Python has to end the command; compiled code may not let it


def main() -> None:
    """Run the command, and exit with its status; with 3 where robotball itself is wrong."""
    # Whatever a child imports, as MuJoCo's packages start Pythons too, is not from this folder.
    os.environ["PYTHONSAFEPATH"] = "1"
    sys.unraisablehook = _show_unraisable
    _open_closed()
    _make_lasting()
    with _ended_by_signals() as signals:
        from .cli import main as command

        try:
            command()
        except Exception:
            if not signals:
                traceback.print_exc()
            sys.exit(_DEFECT)


def _open_closed() -> None:
    """Open each standard stream that is closed to nowhere, lest another file take its number."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            number = os.open(os.devnull, os.O_RDWR)  # the lowest that is free
            os.set_inheritable(number, True)
            stream = os.fdopen(number, mode)
            setattr(sys, name, stream)
            setattr(sys, f"__{name}__", stream)  # which keeps it open where another takes its place


def _make_lasting() -> None:
    for name in ("stdout", "stderr"):
        # The stream's own text layer is replaced, as its error of a closed pipe would come at exit,
        # where nobody can catch it.
        former = getattr(sys, name)
        lines = former.line_buffering
        lasting = _Lasting(former.buffer, former.encoding, "replace", line_buffering=lines)
        setattr(sys, name, lasting)


class _Lasting(io.TextIOWrapper):
    """A stream that goes on, to nowhere, when its reader has left.

    Raises InputError where it cannot be written for another reason, as on a full disk.
    """

    def write(self, text: str) -> int:
        with self._going_on():
            super().write(text)
        return len(text)

    def flush(self) -> None:
        with self._going_on():
            super().flush()

    @contextmanager
    def _going_on(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            # What the stream still holds, and all that is to come, goes to nowhere.
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            if not isinstance(error, BrokenPipeError):
                raise InputError(f"the output cannot be written: {error.strerror}") from None


class _Interrupted(KeyboardInterrupt):
    """The exception by which a signal ends a block.

    Python remembers a KeyboardInterrupt itself that has passed an `exec` of text, as a dataclass is
    made by, and dies of the signal at last, however it was met.
    """


def _show_unraisable(error: "sys.UnraisableHookArgs") -> None:
    # A signal may arrive in a callback of Python's import system, which drops the interrupt. The
    # waiting thread then ends the process, so a traceback would only alarm the user.
    if not issubclass(error.exc_type, _Interrupted):
        sys.__unraisablehook__(error)


@contextmanager
def _ended_by_signals() -> Iterator[list[int]]:
    """End the block at a signal by an interrupt, and the process if that takes too long.

    Python acts on a signal between two of its own steps. While compiled code runs there are none,
    but the signal's number arrives in a pipe, at whose other end a thread waits. Whatever the
    block makes of the interrupt, as a library may that was being imported, it leaves by SystemExit.
    Gives the numbers of the signals that came.
    """
    came: list[int] = []
    left = threading.Event()

    def interrupt(number: int, _frame: FrameType | None) -> None:
        came.append(number)
        raise _Interrupted

    former: dict[int, Any] = {}
    read, write = os.pipe()
    os.set_blocking(write, False)
    threading.Thread(target=_end_at_last, args=(read, left), daemon=True).start()
    try:
        signal.set_wakeup_fd(write, warn_on_full_buffer=False)
        for each in _SIGNALS:  # inside the block, as one may come at once
            if signal.getsignal(each) != signal.SIG_IGN:  # as nohup leaves it
                former[each] = signal.signal(each, interrupt)
        yield came
    except BaseException:
        if not came:
            raise
    finally:
        left.set()
        # Before the pipe is closed, lest a late signal write to another file of that number.
        signal.set_wakeup_fd(-1)
        os.close(write)
        for number, handler in former.items():
            signal.signal(number, handler)
    if came:
        sys.exit(_SIGNALLED + came[0])


def _end_at_last(read: int, left: threading.Event) -> None:
    """Wait for a signal's number; end the process where the block is not left soon after it."""
    while numbers := os.read(read, 1):
        if numbers[0] in _SIGNALS and not left.wait(_GRACE):
            remove_unfinished()
            os._exit(_SIGNALLED + numbers[0])
    os.close(read)


if __name__ == "__main__":
    main()
