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
    """A stream that goes on, to nowhere, when its reader has left."""

    def write(self, text: str) -> int:
        try:
            return super().write(text)
        except BrokenPipeError:
            drop(self)
            return len(text)

    def flush(self) -> None:
        try:
            super().flush()
        except BrokenPipeError:
            drop(self)


def drop(stream: io.TextIOBase | Any) -> None:
    """Send what a stream still holds, and all that is to come, to nowhere."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


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
