"""Samples of a rate from a CSV file."""

import re
from pathlib import Path

from robotball.errors import InputError
from robotball.rates import Samples

LONGEST = 10_000_000  # bytes


def read_samples(path: Path) -> Samples:
    """The samples of a file: a time [s] and a value in each line, below a heading if there is one.

    Commas, semicolons or spaces stand between them. Raises InputError, with the file and the line.
    """
    try:
        if path.stat().st_size > LONGEST:
            raise InputError(f"{path} is longer than {LONGEST / 1e6:g} MB")
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except ValueError:  # bytes that are no text, a null byte in the name
        raise InputError(f"{path} is no text") from None
    rows: list[tuple[float, float]] = []
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            time, value = (float(word) for word in re.split(r"[\s,;]+", line.strip()))
        except ValueError:
            if rows or number > 1:
                raise InputError(
                    f"{path}: line {number} must be a time and a value, not {line.strip()!r}"
                ) from None
        else:
            rows.append((time, value))
    try:
        return Samples(times=tuple(t for t, _ in rows), values=tuple(v for _, v in rows))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
