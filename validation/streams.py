"""The standard streams of a command: what they cannot show and who stops reading ends nothing."""

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from robotball.errors import InputError
from robotball.files.replacing import STANDARD_OUTPUT


class Lasting(io.TextIOWrapper):
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

    @contextlib.contextmanager
    def _going_on(self) -> Iterator[None]:
        try:
            yield
        except BrokenPipeError:
            self._drop()
        except OSError as error:
            self._drop()
            raise InputError(f"the output cannot be written: {error.strerror}") from None

    def _drop(self) -> None:
        """Send what it still holds, and all that is to come, to nowhere."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.fileno())
        os.close(nowhere)


def open_closed() -> None:
    """Open each standard stream that is closed to nowhere, lest another file take its number."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            number = os.open(os.devnull, os.O_RDWR)  # the lowest that is free
            os.set_inheritable(number, True)
            stream = os.fdopen(number, mode)
            setattr(sys, name, stream)
            setattr(sys, f"__{name}__", stream)  # which keeps it open where another takes its place


def make_lasting() -> None:
    """Let standard output and error outlast their readers, and show `?` for what they lack.

    Streams that a caller has put in their place are left as they are.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if type(stream) is io.TextIOWrapper:
            stream.flush()
            lasting = Lasting(
                stream.buffer,
                encoding=stream.encoding,
                errors="replace",
                line_buffering=stream.line_buffering,
            )
            setattr(sys, name, lasting)


@contextlib.contextmanager
def standard_output_of(command: object) -> Iterator[None]:
    """Where an option of a command is `-`, standard output holds that result alone.

    Tables and messages go to standard error then. Raises InputError for more than one such option.
    """
    count = sum(path == STANDARD_OUTPUT for path in _paths(command))
    if count > 1:
        raise InputError("standard output takes one result: give `-` to one option alone")
    with contextlib.redirect_stdout(sys.stderr) if count else contextlib.nullcontext():
        yield


def _paths(options: Any) -> Iterator[Path]:
    """The paths among the options of a command, in groups of them too."""
    for field in fields(options):
        value = getattr(options, field.name)
        if isinstance(value, Path):
            yield value
        elif is_dataclass(value):
            yield from _paths(value)
