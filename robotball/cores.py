"""Work on all cores.

Compiled loops release the interpreter's lock and run in threads. Python's own code holds that lock,
so its jobs run in processes.
"""

import fcntl
import multiprocessing
import os
import signal
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    as_completed,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from itertools import islice
from multiprocessing import connection, forkserver, resource_tracker
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from robotball.errors import SceneWarning, check_count
from robotball.files.replacing import remove_unfinished

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Queue: TypeAlias = "NDArray[np.int64]"

NO_MORE = 2**62  # past the end of any queue

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
            queue[0] = NO_MORE
            raise


def cores() -> int:
    """Return how many cores this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)  # which macOS has not
    return len(affinity(0)) if affinity else os.cpu_count() or 1


ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
FORKSERVER = multiprocessing.get_context("forkserver")
"""Its server imports the work once, and then starts a process in milliseconds."""
GRACE = 1.0  # s for a process to end in; one in compiled code, which writes no file, is killed then

Job = TypeVar("Job")
Result = TypeVar("Result")


def in_processes(
    work: Callable[[Job], Result], jobs: Sequence[Job], least: int = 2
) -> Iterator[Result]:
    """Yield the results of jobs in their order, from as many processes as `at_most` allows.

    work: a module's function, `partial` of one, or an object that can be called; like jobs and
    results it can be pickled. With one process, or fewer jobs than `least`, it is called here: a
    process takes a second to start. Its warnings and errors are the caller's. The processes end
    with the iterator. Raises ChildProcessError where one of them dies.
    """
    count = min(allowed(), len(jobs))
    if count < 2 or len(jobs) < least:
        yield from map(work, jobs)
        return
    start_server((work.func if isinstance(work, partial) else work).__module__)
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(count, FORKSERVER, _begin, (work,))
    try:
        waiting = iter(jobs)
        # As many as keep every process busy: the results of a film's frames would fill the memory.
        in_order = deque(pool.submit(_call, job) for job in islice(waiting, 2 * count))
        running, done = set(in_order), set()
        while running:
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            for _, error, lines in [future.result() for future in finished]:
                for line in lines:
                    warnings.warn(line, SceneWarning, stacklevel=2)
                if error is not None:
                    raise error
            done |= finished
            more = [pool.submit(_call, job) for job in islice(waiting, len(finished))]
            running.update(more)
            in_order.extend(more)
            while in_order and in_order[0] in done:
                done.discard(first := in_order.popleft())
                yield first.result()[0]
    except BrokenProcessPool:
        raise ChildProcessError(
            "a process was ended from outside, or by a script that starts processes whenever it is "
            'imported: put what it does below `if __name__ == "__main__":`'
        ) from None
    finally:
        # The pool itself would wait for the jobs that run.
        processes = set(multiprocessing.active_children()) - others
        for process in processes:
            process.terminate()
        late = time.monotonic() + GRACE
        for process in processes:
            connection.wait([process.sentinel], max(0.0, late - time.monotonic()))
            process.kill()
        pool.shutdown(cancel_futures=True)


_work: Callable[[Any], Any]


def _begin(work: Callable[[Any], Any]) -> None:
    """Prepare a process for its jobs: it ends, and leaves no unfinished file, when it is told to.

    It gets SIGIO where the process that asked for it has died.
    """
    global _work
    _work = work
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in (signal.SIGTERM, signal.SIGIO):
        signal.signal(number, _end)
    end_with_parent()
    _most.set(1)


def _end(*_: object) -> None:
    remove_unfinished()
    os._exit(0)


def _call(job: Any) -> tuple[Any, Exception | None, list[str]]:
    """Return the result of a job, or its error, and the texts of its warnings."""
    result, error = None, None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SceneWarning)
        try:
            result = _work(job)
        except Exception as raised:
            error = raised
    lines = [str(w.message) for w in caught if issubclass(w.category, SceneWarning)]
    return result, error, lines


def end_with_parent() -> None:
    """Have SIGIO end this process when the one that started it ends, even in compiled code.

    Where the system ignores SIGIO, as macOS does, the process ends after its cell.
    """
    parent = multiprocessing.parent_process()
    assert parent is not None
    end_when_closed(parent.sentinel)


def end_when_closed(pipe: int) -> None:
    """Have SIGIO end this process when the other end of a pipe closes."""
    fcntl.fcntl(pipe, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(pipe, fcntl.F_SETFL, os.O_ASYNC)


def prepare(module: str) -> None:
    """Have a module imported for the processes that will need it, while other work is done here."""
    if allowed() > 1:
        start_server(module)


def start_server(module: str) -> None:
    """Start the server of processes, which imports a module for them; one that runs stays.

    Its processes have one thread a library, and leave Ctrl-C to us, as they take over what the
    server has from its start.
    """
    resource_tracker.ensure_running()  # whose start would unblock SIGINT
    before = {name: os.environ[name] for name in ONE_THREAD if name in os.environ}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    os.environ.update(ONE_THREAD)
    try:
        FORKSERVER.set_forkserver_preload(["__main__", module, __name__])
        forkserver.ensure_running()
    finally:
        for name in ONE_THREAD:
            del os.environ[name]
        os.environ.update(before)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
