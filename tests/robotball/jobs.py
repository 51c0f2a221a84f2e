"""Jobs for other processes, which start quickly because they import only this file."""

import os
import sys
import time
from pathlib import Path
from typing import Any

from robotball.errors import InputError, warn
from robotball.files.replacing import replacing
from robotball.processes import allowed


def late(job: int) -> tuple[int, int, int]:
    """Return the number, process and allowed threads; the first of seven jobs take longest."""
    time.sleep(0.02 * (7 - job))
    return job, os.getpid(), allowed()


def faulty(job: int) -> int:
    """Warn in job 1, refuse job 2, and end the process in job 3."""
    if job == 1:
        warn("job 1 is odd")
    if job == 2:
        raise InputError("job 2 cannot be done")
    if job == 3:
        os._exit(job)
    return job


def signalled(number: int) -> int:
    """Send a signal to this process."""
    os.kill(os.getpid(), number)
    return number


def half_written(folder: Path, job: int) -> None:
    """Job 0 keeps writing a file; job 1 finds the disk full at once."""
    if job == 0:
        with replacing(folder / "picture.png") as temporary:
            temporary.write_bytes(b"half of a picture")
            time.sleep(60)
    while not list(folder.iterdir()):
        time.sleep(0.01)
    raise InputError("No space left on device")


def known(module: str) -> bool:
    """Return whether a module is already imported."""
    return module in sys.modules


class Parcel:
    """A job that counts how often it is pickled, and may refuse to be."""

    def __init__(self, number: int, can: bool) -> None:
        self.number, self.can, self.times = number, can, 0

    def __reduce__(self) -> tuple[Any, ...]:
        self.times += 1
        if not self.can:
            raise TypeError("it cannot be pickled")
        return Parcel, (self.number, self.can)


def opened(parcel: Parcel) -> tuple[int, int]:
    """Return the job's number and the process."""
    return parcel.number, os.getpid()
