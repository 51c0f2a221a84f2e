"""Work on as many cores as are allowed: compiled loops in threads, Python's code in processes.

Compiled loops release the interpreter's lock, which Python's own code holds.

Each process shares a pipe with one thread here and nothing with any other process. Where processes
share a queue, as those of concurrent.futures and pebble do, one that is killed may keep the queue's
lock: after several random kills all others wait for it, or the whole pool breaks.
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

_NO_MORE = 2**62  # past the end of any queue

_most: ContextVar[int | None] = ContextVar("most", default=None)
# The libraries' own threads would take the cores of the other processes.
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
# Its server imports the work once, and then starts a process in milliseconds.
_FORKSERVER = multiprocessing.get_context("forkserver")
_CHILDREN = threading.Lock()  # multiprocessing polls all processes when one starts, in any thread
_TRIES = 10  # starts of a process that is killed before it is ready
_IDLE = 60.0  # s that a process waits for a job before it ends, as after a sweep on a dask worker
_GRACE = 1.0  # s for a process to end in; compiled code, which writes no file, is killed then
_PARTS = 20  # a limit is waited for in so many parts: a time in which we are stopped takes one

_Job = TypeVar("_Job")
_Result = TypeVar("_Result")
Answer: TypeAlias = tuple[Any, list[str]]  # the result of a job, and the texts of its warnings


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
    with futures.ThreadPoolExecutor(threads, initializer=_most.set, initargs=(1,)) as executor:
        try:
            running = [executor.submit(work, queue) for _ in range(threads)]
            for each in futures.as_completed(running):
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


def in_processes(
    work: Callable[[_Job], _Result], jobs: Sequence[_Job], least: int = 2, *, or_here: bool = False
) -> Iterator[_Result]:
    """Yield the results of jobs in their order, from as many processes as `at_most` allows.

    work: a module's function, `partial` of one, or an object that can be called; like jobs and
    results it can be pickled. With one process, or fewer jobs than `least`, it is called here: a
    process takes a second to start. Its warnings and errors are the caller's. The processes end
    with the iterator. or_here: work and jobs that cannot be pickled, as with a user's functions in
    them, are done here. Raises ChildProcessError where one of them dies.
    """
    count = min(allowed(), len(jobs))
    pickled = pickled_jobs(work, jobs) if or_here and count > 1 else None
    if count < 2 or len(jobs) < least or (or_here and pickled is None):
        yield from map(work, jobs)
        return
    with pool(partial(_of_pickled, work) if pickled else work, count) as submit:
        waiting: Iterator[Any] = iter(pickled or jobs)
        # As many as keep every process busy: the results of a film's frames would fill the memory.
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
    """Return the jobs as other processes are given them, None where they or the work cannot be."""
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
        raise ChildProcessError("a process was ended from outside") from None


def prepare(*modules: str) -> None:
    """Have modules imported for the processes that will need them, beside other work here."""
    if allowed() > 1:
        _start_server(modules)


@contextmanager
def pool(work: Callable[[Any], Any], count: int) -> Iterator[Callable[..., futures.Future[Answer]]]:
    """Give a function that has a job, and its limit [s], answered by one of so many workers.

    Its futures are those of `Worker.answer`. The processes end with the block, whatever they do.
    """
    workers = [Worker(work) for _ in range(count)]
    free = list(workers)

    def answer(job: Any, limit: float | None = None) -> Answer:
        # There are as many threads as workers, so one is free.
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
    """A process ended before its job did.

    status: of its exit; the signal's number, negative, where it was killed; None where it was ended
    for a job that took longer than its limit.
    """

    def __init__(self, status: int | None) -> None:
        super().__init__(status)
        self.status = status


class Worker:
    """A process that does jobs for one thread, started when first needed and again after its end.

    work: a function that can be pickled.
    """

    def __init__(self, work: Callable[[Any], Any]) -> None:
        self._work = work
        self._process: BaseProcess | None = None
        self._closed = False

    def answer(self, job: Any, limit: float | None = None) -> Answer:
        """Return what `work` makes of a job; its errors are raised here.

        Raises EndedError where the process dies, or is killed as the job takes longer than `limit`
        [s], and ChildProcessError where none can be started.
        """
        # Between two jobs nothing comes through the pipe but its end.
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
        """Let the process end soon, and start no other; for any thread."""
        with _CHILDREN:
            # With the lock, or a process that is being started now would be missed.
            self._closed = True
            if (process := self._process) is not None:
                process.terminate()

    def end(self, late: float = 0.0) -> int:
        """Return the exit status of the process, killed if it still runs at a monotonic time."""
        process, self._process = self._process, None
        if process is None:
            return 0
        connection.wait([process.sentinel], max(0.0, late - time.monotonic()))
        with _CHILDREN:
            process.kill()
            process.join()
            return process.exitcode or 0

    def _start(self) -> None:
        for _ in range(_TRIES):
            self.end()
            self._pipe, theirs = _FORKSERVER.Pipe()
            # A daemon: Python waits at its own end for every other process that it has started.
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
            if self.end() > 0:  # by an exception, as where the work cannot be imported
                break
        raise ChildProcessError(
            "a process was ended from outside, or by a script that starts processes whenever it is "
            'imported: put what it does below `if __name__ == "__main__":`'
        )

    def _answers(self, limit: float | None) -> bool:
        if limit is None:
            return self._pipe.poll(None)
        return any(self._pipe.poll(limit / _PARTS) for _ in range(_PARTS))


def _start_server(modules: Iterable[str]) -> None:
    """Start the server of processes, which imports modules for them; one that runs stays.

    Its processes have one thread a library. They leave Ctrl-C and a closed terminal to us, as they
    take over what the server has from its start.
    """
    # A module of the current folder is imported there only if it would be imported here.
    ours = any(each.exists() and each.samefile(os.curdir) for each in map(Path, sys.path))
    added = _ONE_THREAD if ours else _ONE_THREAD | {"PYTHONSAFEPATH": "1"}
    before = {name: os.environ[name] for name in added if name in os.environ}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    os.environ.update(added)
    try:
        resource_tracker.ensure_running()  # whose start would unblock SIGINT
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
        # The caller's script too, as the work may be a function of its own.
        _FORKSERVER.set_forkserver_preload(["__main__", *modules, __name__])
        forkserver.ensure_running()
    finally:
        for name in added:
            del os.environ[name]
        os.environ.update(before)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _serve(pipe: connection.Connection, work: Callable[[Any], Any]) -> None:
    """Do jobs in this process, after saying that it is ready."""
    signal.signal(signal.SIGTERM, _end)
    # A parent that is killed cannot end us, and compiled code would not see its pipe's end.
    parent = multiprocessing.parent_process()
    assert parent is not None
    end_when_closed(parent.sentinel)
    with at_most(1), suppress(EOFError, BrokenPipeError, ConnectionResetError):
        pipe.send(None)
        while pipe.poll(_IDLE):
            pipe.send(answered(work, pipe.recv()))


def _end(*_: object) -> None:
    """End this process at once; no `finally` of the job is waited for, which may take long."""
    remove_unfinished()
    os._exit(128 + signal.SIGTERM)


def _modules(work: Any) -> list[str]:
    """Return the modules of a function, or of all functions in a `partial`."""
    if not isinstance(work, partial):
        return [work.__module__] if callable(work) else []
    return [module for part in (work.func, *work.args) for module in _modules(part)]


def answered(work: Callable[[Any], Any], job: Any) -> tuple[Any, BaseException | None, list[str]]:
    """Return the result of a job, or its error, and the texts of its warnings."""
    result, error = None, None
    with warnings.catch_warnings(record=True) as caught:
        # All of them: they are issued again for the caller, whose filter then decides.
        warnings.simplefilter("always", SceneWarning)
        try:
            result = work(job)
        except Exception as raised:
            error = raised
    lines = [str(w.message) for w in caught if issubclass(w.category, SceneWarning)]
    return result, error, lines


def end_when_closed(pipe: int) -> None:
    """Have SIGIO end this process when the other end of a pipe closes, even in compiled code.

    Where the system ignores SIGIO, as macOS does, the process ends after its job.
    """
    fcntl.fcntl(pipe, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(pipe, fcntl.F_SETFL, os.O_ASYNC)
