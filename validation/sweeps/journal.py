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
from robotball.files.replacing import no_regular_file
from validation.output import versions, writable_file
from validation.sweeps.cells import Result, Work, from_line, identity

ELSEWHERE = "give another folder with --out"


@dataclass(frozen=True)
class Journal:
    """An open file of results; `results`: what it holds, by the identity of the cell."""

    path: Path
    file: BinaryIO
    results: dict[str, Result]

    def add(self, line: str) -> Result:
        """The result of a line, which is on disk when this returns; InputError if it can't be."""
        with _refusals(self.path):
            _write(self.file, line)
        result = from_line(line)
        self.results[identity(result.cell)] = result
        return result


@contextmanager
def journal(path: Path, work: Work) -> Iterator[Journal]:
    """The journal at `path` of the cells that `work` has done, new or to be continued.

    Raises InputError where the file can't be read or written, is no journal, is of another work or
    made by other versions, or is being written by another sweep.
    """
    with _refusals(path):
        writable_file(path).parent.mkdir(parents=True, exist_ok=True)
        if no_regular_file(path):
            raise InputError(f"{path} is no regular file, as a sweep's record is: {ELSEWHERE}")
        file = path.open("ab+", buffering=0)
    with file:
        with _refusals(path):
            results = _continued(file, path, work)
        yield Journal(path, file, results)


@contextmanager
def _refusals(path: Path) -> Iterator[None]:
    """What the system refuses in the block is said in one line."""
    try:
        yield
    except BlockingIOError:
        raise InputError(
            f"{path} is being written by another sweep: wait for it, or {ELSEWHERE}"
        ) from None
    except OSError as error:
        raise InputError(f"{path} cannot be used: {error.strerror or error}") from None


def _continued(file: BinaryIO, path: Path, work: Work) -> dict[str, Result]:
    """The results in the file, which is locked and ready for more: a header and whole lines."""
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # until it is closed or we are killed
    header = {"work": f"{work.__module__}.{work.__qualname__}", "versions": versions()}
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
    return _results(lines, path)


def _encoded(line: str) -> bytes:
    return line.encode() + b"\n"


def _write(file: BinaryIO, line: str) -> None:
    rest = _encoded(line)
    while rest:  # a disk that fills up takes a part
        rest = rest[file.write(rest) :]
    os.fsync(file.fileno())


def _check_header(line: bytes, ours: dict[str, Any], path: Path) -> None:
    try:
        theirs = json.loads(line)
        work, made_by = theirs["work"], dict(theirs["versions"])
    except (ValueError, TypeError, KeyError):
        raise InputError(f"{path} is not the record of a sweep: move it, or {ELSEWHERE}") from None
    if work != ours["work"]:
        raise InputError(
            f"{path} is the record of {work}, not of {ours['work']}: move it, or {ELSEWHERE}"
        )
    for part, version in ours["versions"].items():
        if made_by.get(part) != version:
            raise InputError(
                f"{path} was made with {part} {made_by.get(part)}, and this is {version}: results "
                f"of both would be mixed; delete it, or {ELSEWHERE}"
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
