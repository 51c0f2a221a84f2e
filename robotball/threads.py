"""Many motions on all cores, by threads: the compiled loops release the interpreter's lock."""

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from robotball.errors import check_count

if TYPE_CHECKING:  # NumPy is not imported before it is needed
    import numpy as np
    from numpy.typing import NDArray

Queue: TypeAlias = "NDArray[np.int64]"

NO_MORE = 2**62  # past the end of any queue
GROUPS = Path("/sys/fs/cgroup")

_most: ContextVar[int | None] = ContextVar("most", default=None)


@contextmanager
def at_most(count: int | None) -> Iterator[None]:
    """In the block so many threads work at once; as many as there are cores for None.

    The digits of a result are the same at any number. Raises InputError for less than one.
    """
    token = _most.set(None if count is None else check_count("threads", count, 1))
    try:
        yield
    finally:
        _most.reset(token)


def allowed() -> int:
    """How many may work at once here."""
    return _most.get() or cores()


def in_threads(work: Callable[[Queue], None], most: int) -> None:
    """Call `work` in at most so many threads at once, and in no more than are allowed.

    work: takes numbers from the queue (1,), which holds the next, until all is done, and writes its
    results into their places; to be of use it must release the interpreter's lock.
    """
    import numpy as np

    queue = np.zeros(1, np.int64)
    threads = min(most, allowed())
    if threads < 2:
        work(queue)
        return
    from concurrent.futures import ThreadPoolExecutor, as_completed

    # What is called in a thread is for that thread alone.
    with ThreadPoolExecutor(threads, initializer=_most.set, initargs=(1,)) as executor:
        try:
            for each in as_completed([executor.submit(work, queue) for _ in range(threads)]):
                each.result()
        except BaseException:
            queue[0] = NO_MORE
            raise


def cores() -> int:
    """Those that this process may use: by its affinity, and by the quota of its container."""
    affinity = getattr(os, "sched_getaffinity", None)
    own = len(affinity(0)) if affinity else os.cpu_count() or 1
    return max(1, math.ceil(min(own, quota())))


def quota(groups: Path = GROUPS, own: Path = Path("/proc/self/cgroup")) -> float:
    """Cores' time that Linux's control groups leave to this process; infinite without a limit.

    groups: where they are mounted; own: the file that names those of this process.
    """
    least = math.inf
    for line in _text(own).splitlines():
        controllers, path = line.split(":", 2)[1:]
        if controllers and "cpu" not in controllers.split(","):
            continue
        root = groups / "cpu" if controllers else groups
        # In a container the path may be the host's: then the root alone is there.
        place = root / path.lstrip("/")
        for folder in (place, *place.parents):
            if not folder.is_relative_to(root):
                break
            files = ("cpu.cfs_quota_us", "cpu.cfs_period_us") if controllers else ("cpu.max",)
            words = [word for file in files for word in _text(folder / file).split()]
            if len(words) == 2 and words[0] not in ("max", "-1"):
                least = min(least, int(words[0]) / int(words[1]))
    return least


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except OSError:
        return ""
