"""Parallel work: every job once, in order, and on no more cores than allowed.

Threads give the same digits at any number; processes pass on errors and warnings, and end with
their caller.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from robotball import InputError, SceneWarning, load_scene
from robotball.dynamics.cycles import limit_cycles
from robotball.dynamics.long_run import basins, exponents_of
from robotball.dynamics.sections import section_starts, sections_of
from robotball.processes import Queue, allowed, at_most, in_processes, in_threads
from robotball.theory.ensembles.orbits import orbits, take
from tests.robotball.jobs import Parcel, faulty, half_written, late, opened, signalled

BALL = load_scene("fig14").parameters
GENERATOR = np.random.default_rng(5)
STARTS = section_starts(GENERATOR.uniform(-4, 4, 13), GENERATOR.uniform(0, 6, 13), 25.0)


def mark(queue: Any, done: Any) -> None:
    """Count the jobs taken from a queue."""
    i = take(queue)
    while i < len(done):
        done[i] += 1
        i = take(queue)


compiled_mark = numba.njit(nogil=True)(mark)


@pytest.mark.parametrize("threads", [1, 7])
def test_every_job_is_taken_once(threads: int) -> None:
    """A million, as fast as possible; a plain counter gives some of them twice."""
    done = np.zeros(1_000_000, np.int64)
    with at_most(threads):
        in_threads(lambda queue: compiled_mark(queue, done), 100)
    assert (done == 1).all()


@pytest.mark.parametrize(("most", "at_once"), [(12, 3), (2, 2), (1, 1)])
def test_as_many_threads_run_as_are_allowed_and_useful(most: int, at_once: int) -> None:
    """They wait for each other, so fewer would block; inside one, no further threads start."""
    meeting = threading.Barrier(at_once, timeout=60.0)
    inside = []

    def work(_: Queue) -> None:
        meeting.wait()
        inside.append(allowed())

    with at_most(3):
        in_threads(work, most)
    assert inside == [1 if at_once > 1 else 3] * at_once


@pytest.mark.parametrize(
    "work",
    [
        lambda: vars(orbits(BALL, *STARTS, np.array([0.0, 3.0, 10.0]))).values(),
        lambda: vars(sections_of(BALL, *STARTS, 3)).values(),
        lambda: [exponents_of(BALL, *STARTS, 20.0, 10.0).largest],
        lambda: [basins(BALL, *STARTS, 30.0).labels],
        lambda: [cycle.gamma for cycle in limit_cycles(load_scene("fig07").parameters)],
    ],
    ids=["orbits", "section", "exponents", "basins", "limit cycles"],
)
def test_the_digits_are_the_same_at_any_number_of_threads(work: Callable[[], Any]) -> None:
    """13 starts, so the last lanes are empty; compared to the last bit."""
    results = []
    for count in (1, 3, 16):
        with at_most(count):
            results.append(list(work()))
    assert results[0]
    for other in results[1:]:
        for one, same in zip(results[0], other, strict=True):
            assert np.array_equal(one, same, equal_nan=True)


def test_an_error_in_a_thread_is_raised_and_ends_the_others() -> None:
    """With its message; the other thread would take numbers without end."""
    begun = threading.Event()

    def work(queue: Queue) -> None:
        if begun.is_set():
            raise InputError("a start that cannot be used")
        begun.set()
        deadline = time.monotonic() + 60.0
        while queue[0] < 1000:
            assert time.monotonic() < deadline

    with at_most(2), pytest.raises(InputError, match="a start that cannot be used"):
        in_threads(work, 20)


# Processes --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("most", "least", "count"), [(2, 2, 2), (1, 2, 1), (4, 8, 1)])
def test_results_come_in_the_order_of_the_jobs(most: int, least: int, count: int) -> None:
    """From processes with one thread each, or from this process if there are few jobs."""
    with at_most(most):
        results = list(in_processes(late, range(7), least))
    assert [job for job, _, _ in results] == list(range(7))
    processes = {process for _, process, _ in results}
    assert len(processes) == count
    assert (os.getpid() in processes) == (count == 1)
    assert {threads for _, _, threads in results} == {1 if count > 1 else most}


@pytest.mark.parametrize("most", [1, 2])
def test_warnings_and_errors_are_passed_to_the_caller(most: int) -> None:
    """With their messages, in any number of processes; a dead process raises ChildProcessError."""
    with at_most(most), pytest.warns(SceneWarning, match="job 1 is odd"):
        assert list(in_processes(faulty, [0, 1, 4])) == [0, 1, 4]
    with at_most(most), pytest.raises(InputError, match="job 2 cannot be done"):
        list(in_processes(faulty, [0, 2, 4]))
    if most > 1:
        with at_most(most), pytest.raises(ChildProcessError, match="killed from outside"):
            list(in_processes(faulty, [3, 3]))


@pytest.mark.parametrize("can", [True, False])
def test_jobs_that_cannot_be_pickled_are_done_here(can: bool) -> None:
    """All of them if one cannot be pickled; otherwise each is pickled once."""
    jobs = [Parcel(0, True), Parcel(1, can)]
    with at_most(2):
        results = [*in_processes(opened, jobs, or_here=True)]
    assert [number for number, _ in results] == [0, 1]
    assert {process == os.getpid() for _, process in results} == {not can}
    assert [job.times for job in jobs] == [1, 1]


def test_processes_leave_terminal_signals_to_the_caller() -> None:
    """Ctrl-C and a closed terminal signal them, too; the caller ends them and cleans up."""
    jobs = [signal.SIGINT, signal.SIGHUP]
    with at_most(2):
        assert list(in_processes(signalled, jobs)) == jobs


def test_a_terminated_process_leaves_no_partial_file(tmp_path: Path) -> None:
    """For example, if the disk is full for one picture, the drawing of the other is ended."""
    with at_most(2), pytest.raises(InputError, match="No space left"):
        list(in_processes(partial(half_written, tmp_path), range(2)))
    assert list(tmp_path.iterdir()) == []


SCRIPT = """
from robotball.processes import at_most, in_processes
from tests.robotball.jobs import known
def main():
    with at_most(2):
        print(*in_processes(known, ["tests.robotball.jobs", "wave"]))
"""


@pytest.mark.parametrize("guarded", [True, False])
def test_a_guarded_script_can_start_processes(tmp_path: Path, guarded: bool) -> None:
    """Processes import the module of the work; without the guard they would run the script."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT + ("if __name__ == '__main__':\n    main()" if guarded else "main()"))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, env=environment)
    if guarded:
        assert (done.stdout, done.stderr) == ("True False\n", "")
        return
    assert done.stdout == ""
    assert 'if __name__ == "__main__":' in done.stderr.splitlines()[-1]
