"""Run work in parallel: compiled loops in threads, Python code in processes.

Compiled loops release the interpreter lock; Python code holds it.

Each process has its own pipe to one thread of this process, and the processes share nothing. If
they shared a queue, as in concurrent.futures and pebble, a killed process might keep the queue's
lock. After a few random kills all other processes would wait for the lock, or the pool would break.
"""

import fcntl
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent import futures
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import partial
from itertools import islice
from multiprocessing import connection, forkserver, resource_tracker
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from robotball.errors import SceneWarning, check_count, warn
from robotball.files.replacing import remove_unfinished

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Queue: TypeAlias = "NDArray[np.int64]"

_PAST_THE_END = 2**62  # a job number beyond any queue

_most: ContextVar[int | None] = ContextVar("most", default=None)
# The threads of numerical libraries would occupy the cores that other processes need.
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
# The fork server imports the work once, and then starts each process within milliseconds.
_FORKSERVER = multiprocessing.get_context("forkserver")
_CHILDREN = threading.Lock()  # when a thread starts a process, multiprocessing polls all processes
_MAX_STARTS = 10  # attempts to start a process that is killed before it is ready
_IDLE = 60.0  # s; a process without a job for so long ends
_GRACE = 1.0  # s for a process to end; then it is killed (compiled code writes no files)
_LIMIT_PARTS = 20  # a time limit is awaited in parts: a suspension of this process costs one part

_Job = TypeVar("_Job")
_Result = TypeVar("_Result")
Answer: TypeAlias = tuple[Any, list[str]]  # the result of a job, and the texts of its warnings


@contextmanager
def at_most(count: int | None) -> Iterator[None]:
    """Limit the parallel threads or processes in the block; None allows one per core.

    The count does not change any digit of the results. Raises InputError if it is below 1.
    """
    token = _most.set(None if count is None else check_count("threads", count, 1))
    try:
        yield
    finally:
        _most.reset(token)


def allowed() -> int:
    """Return how many threads or processes may run at once."""
    return _most.get() or cores()


def in_threads(work: Callable[[Queue], None], most: int) -> None:
    """Call `work` in at most `most` parallel threads, within the limit of `at_most`.

    work: takes job numbers from the queue (1,), which holds the next number, until all jobs are
    done, and writes each result to a separate location. Threads help only if `work` releases the
    interpreter lock.
    """
    import numpy as np  # late: counting cores must not load it

    queue = np.zeros(1, np.int64)
    threads = min(most, allowed())
    if threads < 2:
        work(queue)
        return
    # A loop called in one of the threads must not start further threads.
    with futures.ThreadPoolExecutor(threads, initializer=_most.set, initargs=(1,)) as executor:
        try:
            running = [executor.submit(work, queue) for _ in range(threads)]
            for thread in futures.as_completed(running):
                thread.result()
        except BaseException:
            # Let the other threads finish their current job and end, also after Ctrl-C.
            queue[0] = _PAST_THE_END
            raise


def cores() -> int:
    """Return how many cores this process may use, which a container or scheduler may limit."""
    affinity = getattr(os, "sched_getaffinity", None)  # missing on macOS
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def in_processes(
    work: Callable[[_Job], _Result], jobs: Sequence[_Job], least: int = 2, *, or_here: bool = False
) -> Iterator[_Result]:
    """Yield the results of jobs in order, computed in as many processes as `at_most` allows.

    work: a module-level function, a `partial` of such a function, or a callable object. The work,
    the jobs and the results must be picklable. The work is done in this process if only one
    process is allowed or if there are fewer jobs than `least`, because a process takes a second to
    start. Warnings and errors are passed to the caller. The processes end with the iterator.
    or_here: whether this process does jobs that cannot be pickled, such as users' functions.
    Raises ChildProcessError if a process dies.
    """
    count = min(allowed(), len(jobs))
    pickled = pickled_jobs(work, jobs) if or_here and count > 1 else None
    if count < 2 or len(jobs) < least or (or_here and pickled is None):
        yield from map(work, jobs)
        return
    with pool(partial(_of_pickled, work) if pickled else work, count) as submit:
        waiting: Iterator[Any] = iter(pickled or jobs)
        # Submit only enough jobs to keep every process busy: the images of a whole film would fill
        # the memory.
        in_order = deque(submit(job) for job in islice(waiting, 2 * count))
        running = set(in_order)
        while running:
            finished, running = futures.wait(running, return_when=futures.FIRST_COMPLETED)
            for future in finished:
                for line in _answer(future)[1]:
                    warn(line)
            more = [submit(job) for job in islice(waiting, len(finished))]
            running.update(more)
            in_order.extend(more)
            while in_order and in_order[0].done():
                yield _answer(in_order.popleft())[0]


def pickled_jobs(work: object, jobs: Iterable[object]) -> list[bytes] | None:
    """Return the jobs, each pickled, or None if they or the work cannot be pickled."""
    try:
        pickle.dumps(work)
        return [pickle.dumps(job) for job in jobs]
    except (pickle.PicklingError, AttributeError, TypeError):
        return None


def _of_pickled(work: Callable[[Any], _Result], job: bytes) -> _Result:
    return work(pickle.loads(job))


def _answer(future: futures.Future[Answer]) -> Answer:
    try:
        return future.result()
    except EndedError:
        raise ChildProcessError("a worker process was killed from outside") from None


@contextmanager
def pool(work: Callable[[Any], Any], count: int) -> Iterator[Callable[..., futures.Future[Answer]]]:
    """Start `count` workers and yield a function (job, limit [s]) that submits a job to a worker.

    The function returns a future for the result of `Worker.answer`. The processes end with the
    block.
    """
    workers = [Worker(work) for _ in range(count)]
    free = list(workers)

    def answer(job: Any, limit: float | None = None) -> Answer:
        # There are as many threads as workers, so a worker is free.
        worker = free.pop()
        try:
            return worker.answer(job, limit)
        finally:
            free.append(worker)

    executor = futures.ThreadPoolExecutor(count)
    try:
        yield lambda *job: executor.submit(answer, *job)
    finally:
        executor.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.stop()
        late = time.monotonic() + _GRACE
        for worker in workers:
            worker.end(late)
        executor.shutdown()


class EndedError(Exception):
    """A process ended before its job was done.

    status: exit status, or minus the signal number if the process was killed; None if the process
    was ended because the job exceeded its time limit.
    """

    def __init__(self, status: int | None) -> None:
        super().__init__(status)
        self.status = status


class Worker:
    """A process that does jobs for one thread. It starts on first use and restarts after it died.

    work: a picklable function.
    """

    def __init__(self, work: Callable[[Any], Any]) -> None:
        self._work = work
        self._process: BaseProcess | None = None
        self._closed = False

    def answer(self, job: Any, limit: float | None = None) -> Answer:
        """Return `work(job)` and the texts of its warnings, or raise its error.

        Raises EndedError if the process dies or is killed because the job took longer than `limit`
        [s], and ChildProcessError if no process can be started.
        """
        # Between jobs the pipe is readable only if the process has ended.
        if self._process is None or self._pipe.poll():
            self._start()
        try:
            self._pipe.send(job)
            if answered := self._answers(limit):
                result, error, lines = self._pipe.recv()
        except (OSError, EOFError):
            raise EndedError(self.end()) from None
        if not answered:
            self.end()
            raise EndedError(None)
        if error is not None:
            raise error
        return result, lines

    def stop(self) -> None:
        """Terminate the process soon, and start no other process. Any thread may call this."""
        with _CHILDREN:
            # The lock ensures that a process that is just being started is not missed.
            self._closed = True
            if (process := self._process) is not None:
                process.terminate()

    def end(self, late: float = 0.0) -> int:
        """Return the exit status of the process. Kill it if it still runs at `late`.

        late: a time of the monotonic clock [s].
        """
        process, self._process = self._process, None
        if process is None:
            return 0
        connection.wait([process.sentinel], max(0.0, late - time.monotonic()))
        with _CHILDREN:
            process.kill()
            process.join()
            return process.exitcode or 0

    def _start(self) -> None:
        for _ in range(_MAX_STARTS):
            self.end()
            self._pipe, theirs = _FORKSERVER.Pipe()
            # The process is a daemon, otherwise Python would wait for it at exit.
            process = _FORKSERVER.Process(target=_serve, args=(theirs, self._work), daemon=True)
            with suppress(OSError, EOFError):
                with theirs, _CHILDREN:
                    if self._closed:
                        raise futures.CancelledError
                    _start_server(_modules(self._work))
                    process.start()
                    self._process = process
                self._pipe.recv()
                return
            if self.end() > 0:  # an exception, for example because the work cannot be imported
                break
        raise ChildProcessError(
            "a worker process was killed from outside, or by a script that starts processes when "
            'imported: put its top-level code below `if __name__ == "__main__":`'
        )

    def _answers(self, limit: float | None) -> bool:
        if limit is None:
            return self._pipe.poll(None)
        return any(self._pipe.poll(limit / _LIMIT_PARTS) for _ in range(_LIMIT_PARTS))


def _start_server(modules: Iterable[str]) -> None:
    """Start the fork server, with modules imported, unless it is running.

    The processes of the server use one thread per numerical library. They inherit the server's
    signal mask, which blocks SIGINT and SIGHUP, so only this process handles Ctrl-C and a closed
    terminal.
    """
    # The server imports modules of the current folder only if this process would.
    ours = any(path.exists() and path.samefile(os.curdir) for path in map(Path, sys.path))
    added = _ONE_THREAD if ours else _ONE_THREAD | {"PYTHONSAFEPATH": "1"}
    before = {name: os.environ[name] for name in added if name in os.environ}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    os.environ.update(added)
    try:
        resource_tracker.ensure_running()  # if it started later, it would unblock SIGINT
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
        # __main__ too, because the work may be a function of the caller's script.
        _FORKSERVER.set_forkserver_preload(["__main__", *modules, __name__])
        forkserver.ensure_running()
    finally:
        for name in added:
            del os.environ[name]
        os.environ.update(before)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _serve(pipe: connection.Connection, work: Callable[[Any], Any]) -> None:
    """Report that this process is ready, then do jobs until the pipe closes or is idle."""
    signal.signal(signal.SIGTERM, _end)
    # A killed parent cannot terminate us, and compiled code does not notice a closed pipe.
    parent = multiprocessing.parent_process()
    assert parent is not None
    end_when_closed(parent.sentinel)
    with at_most(1), suppress(EOFError, BrokenPipeError, ConnectionResetError):
        pipe.send(None)
        while pipe.poll(_IDLE):
            pipe.send(answered(work, pipe.recv()))


def _end(*_: object) -> None:
    """End this process at once, without the job's `finally` blocks, which may take long."""
    remove_unfinished()
    os._exit(128 + signal.SIGTERM)


def _modules(work: Any) -> list[str]:
    if not isinstance(work, partial):
        return [work.__module__] if callable(work) else []
    return [module for part in (work.func, *work.args) for module in _modules(part)]


def answered(work: Callable[[Any], Any], job: Any) -> tuple[Any, BaseException | None, list[str]]:
    """Return (result, error, warning texts) of a job; the result or the error is None."""
    result, error = None, None
    with warnings.catch_warnings(record=True) as caught:
        # Record all warnings. They are issued again for the caller, whose filters then apply.
        warnings.simplefilter("always", SceneWarning)
        try:
            result = work(job)
        except Exception as raised:
            error = raised
    lines = [str(w.message) for w in caught if issubclass(w.category, SceneWarning)]
    return result, error, lines


def end_when_closed(pipe: int) -> None:
    """Make SIGIO end this process when the other end of the pipe closes, even in compiled code.

    On systems that ignore SIGIO by default, such as macOS, the process ends after its job.
    """
    fcntl.fcntl(pipe, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(pipe, fcntl.F_SETFL, os.O_ASYNC)
