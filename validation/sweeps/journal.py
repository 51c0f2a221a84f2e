"""The file of a sweep: a header, then a line a result, each on disk as soon as it is known."""

import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from robotball import InputError
from validation.output import versions, writable_file
from validation.sweeps.cells import Result, Work, from_line, identity


@dataclass(frozen=True)
class Journal:
    """An open file of results; `results`: what it holds, by the identity of the cell."""

    file: BinaryIO
    results: dict[str, Result]

    def add(self, line: str) -> Result:
        """The result of a line, which is on disk when this returns."""
        _write(self.file, line)
        result = from_line(line)
        self.results[identity(result.cell)] = result
        return result


@contextmanager
def journal(path: Path, work: Work) -> Iterator[Journal]:
    """The journal at `path` of the cells that `work` has done, new or to be continued.

    Raises InputError where the file can't be written, is no journal, is of another work or made by
    other versions, or is being written by another sweep.
    """
    header = {"work": name(work), "versions": versions()}
    writable_file(path).parent.mkdir(parents=True, exist_ok=True)
    with path.open("ab+", buffering=0) as file:
        _lock(file, path)
        file.seek(0)
        text = file.read()
        whole = text[: text.rfind(b"\n") + 1]
        first, *lines = whole.splitlines() or [b""]
        if text and not _encoded(json.dumps(header)).startswith(text):
            _check_header(first, header, path)
        # Of a line that a killed sweep was writing there is only a part, without its end.
        file.truncate(len(whole))
        if not whole:
            _write(file, json.dumps(header))
        yield Journal(file, _results(lines, path))


def name(work: Work) -> str:
    """By what a file knows its work."""
    return f"{work.__module__}.{work.__qualname__}"


def _encoded(line: str) -> bytes:
    return line.encode() + b"\n"


def _write(file: BinaryIO, line: str) -> None:
    file.write(_encoded(line))  # unbuffered: one call
    os.fsync(file.fileno())


def _lock(file: BinaryIO, path: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # until it is closed or we are killed
    except BlockingIOError:
        raise InputError(
            f"{path} is being written by another sweep: wait for it, or name another file"
        ) from None


def _check_header(line: bytes, ours: dict[str, Any], path: Path) -> None:
    try:
        theirs = json.loads(line)
        work, made_by = theirs["work"], dict(theirs["versions"])
    except (ValueError, TypeError, KeyError):
        raise InputError(f"{path} is not the record of a sweep: name another file") from None
    if work != ours["work"]:
        raise InputError(
            f"{path} is the record of {work}, not of {ours['work']}: name another file"
        )
    for part, version in ours["versions"].items():
        if made_by.get(part) != version:
            raise InputError(
                f"{path} was made with {part} {made_by.get(part)}, and this is {version}: results "
                "of both would be mixed; delete it or name another file"
            )


def _results(lines: list[bytes], path: Path) -> dict[str, Result]:
    results = {}
    for number, line in enumerate(lines, start=2):
        try:
            result = from_line(line)
            results[identity(result.cell)] = result
        except (ValueError, TypeError):
            raise InputError(f"line {number} of {path} is no result: delete that line") from None
    return results
