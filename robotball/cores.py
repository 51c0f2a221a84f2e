"""Work in threads, on as many cores as are allowed.

Compiled loops release the interpreter's lock, so threads run them on all cores. Python's own code
holds that lock; `robotball.processes` is for it.
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, TypeAlias

from robotball.errors import check_count

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Queue: TypeAlias = "NDArray[np.int64]"

_NO_MORE = 2**62  # past the end of any queue

_most: ContextVar[int | None] = ContextVar("most", default=None)


@contextmanager
def at_most(count: int | None) -> Iterator[None]:
    """Let so many threads work at once in the block; None allows as many as there are cores.

    The digits of a result are the same at any number. Raises InputError for less than one.
    """
    token = _most.set(None if count is None else check_count("threads", count, 1))
    try:
        yield
    finally:
        _most.reset(token)


def allowed() -> int:
    """Return how many threads or processes may work at once here."""
    return _most.get() or cores()


def in_threads(work: Callable[[Queue], None], most: int) -> None:
    """Call `work` in at most so many threads at once, and in no more than are allowed.

    work: takes numbers from the queue (1,), which holds the next, until all is done, and writes its
    results into their places; to be of use it must release the interpreter's lock.
    """
    # Here, as to count cores must not load it.
    import numpy as np

    queue = np.zeros(1, np.int64)
    threads = min(most, allowed())
    if threads < 2:
        work(queue)
        return
    # A loop that is called in one of the threads must not start threads of its own.
    with ThreadPoolExecutor(threads, initializer=_most.set, initargs=(1,)) as executor:
        try:
            for each in as_completed([executor.submit(work, queue) for _ in range(threads)]):
                each.result()
        except BaseException:
            # The other threads end with the job that they have, also where Ctrl-C is pressed.
            queue[0] = _NO_MORE
            raise


def cores() -> int:
    """Return how many cores this process may use."""
    # A container or a scheduler may allow fewer cores than the machine has.
    affinity = getattr(os, "sched_getaffinity", None)  # which macOS has not
    return len(affinity(0)) if affinity else os.cpu_count() or 1
