"""The `robotball` command as a process: streams, signals and exit status.

`python -m validation` is the same command. The command continues if a stream cannot show a
character, or if the reader of its output closes the pipe. Ctrl-C, SIGTERM and a closed terminal
(SIGHUP) end the command soon, without unfinished files. Worker processes import this module, so it
imports little.
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

_DEFECT = 3  # exit status after an error of robotball itself
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_SIGNALLED = 128  # plus the number of the signal: the exit status in shells, 130 after Ctrl-C
_GRACE = 2.0  # s for Python to end the command; compiled code may prevent this


def main() -> None:
    """Run the command and exit with its status, or with 3 after an error of robotball itself."""
    # Python processes of MuJoCo's packages must not import modules from the current folder.
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
    """Open closed standard streams to /dev/null, so that no other file gets their numbers."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            number = os.open(os.devnull, os.O_RDWR)  # the lowest free number
            os.set_inheritable(number, True)
            stream = os.fdopen(number, mode)
            setattr(sys, name, stream)
            setattr(sys, f"__{name}__", stream)  # keeps the stream open if sys gets another one


def _make_lasting() -> None:
    for name in ("stdout", "stderr"):
        # The standard text layer would report a closed pipe at exit, where it cannot be caught.
        former = getattr(sys, name)
        lines = former.line_buffering
        lasting = _Lasting(former.buffer, former.encoding, "replace", line_buffering=lines)
        setattr(sys, name, lasting)


class _Lasting(io.TextIOWrapper):
    """A stream that discards its output after the reader has closed the pipe.

    Raises InputError if a write fails for another reason, such as a full disk.
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
            # Discard the buffered and all later output.
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            if not isinstance(error, BrokenPipeError):
                raise InputError(f"the output cannot be written: {error.strerror}") from None


class _Interrupted(KeyboardInterrupt):
    """The exception that a signal raises.

    The signal does not raise KeyboardInterrupt itself: if this is raised in an `exec` of text, such
    as in the definition of a dataclass, Python exits by the signal even if the exception is caught.
    """


def _show_unraisable(error: "sys.UnraisableHookArgs") -> None:
    # A callback of Python's import system drops exceptions. After a signal there, the waiting
    # thread ends the process, so no traceback is needed.
    if not issubclass(error.exc_type, _Interrupted):
        sys.__unraisablehook__(error)


@contextmanager
def _ended_by_signals() -> Iterator[list[int]]:
    """End the block with an exception at a signal, or end the process if that takes too long.

    Python handles a signal between two bytecodes, not during compiled code. But the number of the
    signal immediately arrives in a pipe, which a thread reads. The block ends with SystemExit even
    if a library catches the exception. Yields the numbers of the signals received.
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
        for ending in _SIGNALS:  # inside `try`, because a signal may arrive immediately
            if signal.getsignal(ending) != signal.SIG_IGN:  # nohup ignores SIGHUP
                former[ending] = signal.signal(ending, interrupt)
        yield came
    except BaseException:
        if not came:
            raise
    finally:
        left.set()
        # After closing the pipe, a late signal would write to another file with its number.
        signal.set_wakeup_fd(-1)
        os.close(write)
        for number, handler in former.items():
            signal.signal(number, handler)
    if came:
        sys.exit(_SIGNALLED + came[0])


def _end_at_last(read: int, left: threading.Event) -> None:
    """Wait for a signal, and end the process if the block does not end soon."""
    while numbers := os.read(read, 1):
        if numbers[0] in _SIGNALS and not left.wait(_GRACE):
            remove_unfinished()
            os._exit(_SIGNALLED + numbers[0])
    os.close(read)


if __name__ == "__main__":
    main()
