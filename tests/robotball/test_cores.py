"""Work on several cores: everything once, the same digits, and no more cores than are allowed."""

import threading
import time
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pytest

from robotball import InputError, load_scene
from robotball.cores import Queue, allowed, at_most, in_threads
from robotball.engines.ensembles.orbits import orbits, take
from robotball.qualitative.basins import basins
from robotball.qualitative.long_run import exponents
from robotball.qualitative.portraits import limit_cycles
from robotball.qualitative.sections import section, section_starts

BALL = load_scene("fig14").parameters
GENERATOR = np.random.default_rng(5)
STARTS = section_starts(GENERATOR.uniform(-4, 4, 13), GENERATOR.uniform(0, 6, 13), 25.0)


def mark(queue: Any, done: Any) -> None:
    """Count what is taken from a queue."""
    i = take(queue)
    while i < len(done):
        done[i] += 1
        i = take(queue)


compiled_mark = numba.njit(nogil=True)(mark)


@pytest.mark.parametrize("threads", [1, 7])
def test_every_motion_is_done_once(threads: int) -> None:
    """Of a million, taken as fast as can be; a plain counter gives some of them twice."""
    done = np.zeros(1_000_000, np.int64)
    with at_most(threads):
        in_threads(lambda queue: compiled_mark(queue, done), 100)
    assert (done == 1).all()


@pytest.mark.parametrize(("most", "at_once"), [(12, 3), (2, 2), (1, 1)])
def test_as_many_threads_work_at_once_as_are_allowed_and_of_use(most: int, at_once: int) -> None:
    """They wait for each other, which fewer could not; and within one there is no other."""
    meeting = threading.Barrier(at_once, timeout=20.0)
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
        lambda: vars(section(BALL, *STARTS, 3)).values(),
        lambda: [exponents(BALL, *STARTS, 20.0, 10.0).largest],
        lambda: [basins(BALL, *STARTS, 30.0).labels],
        lambda: [each.gamma for each in limit_cycles(load_scene("fig07").parameters)],
    ],
    ids=["orbits", "section", "exponents", "basins", "limit cycles"],
)
def test_the_digits_are_the_same_at_any_number_of_threads(work: Callable[[], Any]) -> None:
    """13 starts, of which the last leave lanes empty: to the last bit."""
    found = []
    for count in (1, 3, 16):
        with at_most(count):
            found.append(list(work()))
    assert found[0]
    for other in found[1:]:
        for one, same in zip(found[0], other, strict=True):
            assert np.array_equal(one, same, equal_nan=True)


def test_an_error_in_a_thread_is_the_callers_and_ends_the_others() -> None:
    """With its own words; the other takes numbers as long as there are some."""
    begun = threading.Event()

    def work(queue: Queue) -> None:
        if begun.is_set():
            raise InputError("a start that cannot be used")
        begun.set()
        deadline = time.monotonic() + 20.0
        while queue[0] < 1000:
            assert time.monotonic() < deadline

    with at_most(2), pytest.raises(InputError, match="a start that cannot be used"):
        in_threads(work, 20)


def test_less_than_one_thread_is_refused() -> None:
    """In one line with the value."""
    with pytest.raises(InputError, match="threads must be at least 1, not 0"), at_most(0):
        pass
