"""Many motions on all cores, by threads: the compiled loops release the interpreter's lock.

Jobs of Python's own code on all cores: processes, as such code holds the interpreter's lock.
"""

import math
import multiprocessing
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import partial
from itertools import islice
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from robotball.errors import SceneWarning, check_count
from robotball.files.replacing import remove_unfinished

if TYPE_CHECKING:
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


ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
FORKSERVER = multiprocessing.get_context("forkserver")
"""Its server imports the work once, and then starts a process in milliseconds."""
CHILDREN = threading.Lock()
"""A process that is started looks after all others, which two threads must not do at a time."""
GRACE = 1.0  # s to end in, of which a process in compiled code, that writes no file, makes nothing

Job = TypeVar("Job")
Result = TypeVar("Result")


def in_processes(
    work: Callable[[Job], Result], jobs: Sequence[Job], least: int = 2
) -> Iterator[Result]:
    """The results of jobs in their order, from as many processes as `threads.at_most` allows.

    work: a module's function, `partial` of one, or an object that can be called; like jobs and
    results it can be pickled. With one process, or fewer jobs than `least`, it is called here: a
    process takes a second to start. What it warns of is warned of here, and what it raises is
    raised here; the processes end with the iterator.
    """
    count = min(allowed(), len(jobs))
    if count < 2 or len(jobs) < least:
        yield from map(work, jobs)
        return
    waiting = iter(enumerate(jobs))
    done: dict[int, Result] = {}
    processes, busy = [], 0
    try:
        for _ in range(count):
            processes.append(_started(work))
        for (_, pipe), job in zip(processes, waiting, strict=False):
            pipe.send(job)
            busy += 1
        following = 0
        while busy:
            for ready in wait([pipe for _, pipe in processes]):
                assert isinstance(ready, Connection)
                try:
                    i, result, error, lines = ready.recv()
                except EOFError:
                    raise ChildProcessError("a process was ended from outside") from None
                for line in lines:
                    warnings.warn(line, SceneWarning, stacklevel=2)
                if error is not None:
                    raise error
                done[i] = result
                busy -= 1
                for job in islice(waiting, 1):
                    ready.send(job)
                    busy += 1
            while following in done:
                yield done.pop(following)
                following += 1
    finally:
        for process, pipe in processes:
            pipe.close()
            process.terminate()
        late = time.monotonic() + GRACE
        for process, _ in processes:
            with CHILDREN:
                process.join(max(0.0, late - time.monotonic()))
                process.kill()
                process.join()


def prepare(module: str) -> None:
    """Have a module imported, while other work is done here, for the processes that will need it.

    What they are asked for first decides; a process of its own holds it from there on.
    """
    if allowed() > 1:
        FORKSERVER.set_forkserver_preload([module, __name__])
        with for_a_worker(module):
            forkserver.ensure_running()


def _started(work: Callable[[Any], Any]) -> tuple[Any, Connection]:
    module = (work.func if isinstance(work, partial) else work).__module__
    FORKSERVER.set_forkserver_preload([module, __name__])
    ours, theirs = FORKSERVER.Pipe()
    process = FORKSERVER.Process(target=_serve, args=(theirs, work), daemon=True)
    with theirs, for_a_worker(module):
        process.start()
    return process, ours


def _serve(pipe: Connection, work: Callable[[Any], Any]) -> None:
    """What a process does, until the pipe is closed, as it is where the other end has died."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end)
    with suppress(EOFError, OSError), at_most(1):
        while True:
            i, job = pipe.recv()
            result, error = None, None
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always", SceneWarning)
                try:
                    result = work(job)
                except Exception as raised:
                    error = raised
            lines = [str(w.message) for w in caught if issubclass(w.category, SceneWarning)]
            pipe.send((i, result, error, lines))


def _end(*_: object) -> None:
    remove_unfinished()
    os._exit(0)


@contextmanager
def for_a_worker(module: str) -> Iterator[None]:
    """What is started in the block has one thread a library, and leaves Ctrl-C to us.

    Nor does it run the script again that asked for it, unless that is the module of its work.
    """
    with CHILDREN:
        resource_tracker.ensure_running()  # whose start would unblock SIGINT
        before = {name: os.environ[name] for name in ONE_THREAD if name in os.environ}
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        os.environ.update(ONE_THREAD)
        main = sys.modules["__main__"]
        if module != "__main__":
            sys.modules["__main__"] = ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main
            for name in ONE_THREAD:
                del os.environ[name]
            os.environ.update(before)
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
