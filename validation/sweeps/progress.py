"""How far a sweep is, in words: cells done, failed, and the time left."""

import time
from collections.abc import Sequence

from validation.progress import Show
from validation.sweeps.cells import Result


class Progress:
    """Tells `show` after every result; those there `before` say nothing about the speed."""

    def __init__(self, show: Show | None, before: Sequence[Result], total: int) -> None:
        self.show, self.total = show, total
        self.before = self.done = len(before)
        self.failed = sum(result.failure is not None for result in before)
        self.start = time.monotonic()
        self._tell()

    def add(self, result: Result) -> None:
        self.done += 1
        self.failed += result.failure is not None
        self._tell()

    def _tell(self) -> None:
        if self.show is None:
            return
        words = [f"{self.done} of {self.total} cells"]
        if self.failed:
            words.append(f"{self.failed} failed")
        if self.before < self.done < self.total:
            each = (time.monotonic() - self.start) / (self.done - self.before)
            words.append(f"{duration(each * (self.total - self.done))} left")
        self.show(self.done, ", ".join(words))


def duration(seconds: float) -> str:
    """A time to come, as precisely as it can be known."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
