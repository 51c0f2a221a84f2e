"""Traced code and dual numbers reproduce the functions that they come from."""

import inspect
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from robotball.theory.ensembles import flatten
from robotball.theory.ensembles.flatten import LANES, Dual, lane_function

pytestmark = pytest.mark.core


def sample(x: Any, y: Any) -> tuple[Any, Any]:
    """Use every operation that tracing and dual numbers support."""
    z = (x - 2) * y / (1 + x * y) - x * y / 2 + 0 * x
    return -z + (3 - x) * (2 / y - x), 1 * y + 0


def test_traced_code_and_dual_numbers_give_the_function_and_its_derivative() -> None:
    """Compared with the function and with its central differences.

    Traced products are commuted. Measured 4.5e-11 in the derivative: rounding of the difference.
    """

    def step(read: Any) -> dict[int, Any]:
        return dict(enumerate(sample(read(0), read(1)), start=2))

    w = np.linspace(0.5, 3.0, 4 * LANES)
    numba.njit(lane_function("compute", LANES, step))(w)
    x, y, *traced = w.reshape(4, LANES)
    expected = sample(x, y)
    assert np.abs(traced[0] - expected[0]).max() < 1e-15
    assert np.array_equal(traced[1], expected[1])
    moving = sample(Dual(x, 0.6), Dual(y, -0.8))
    for i in range(2):
        ahead, behind = (sample(x + h * 0.6, y - h * 0.8)[i] for h in (1e-5, -1e-5))
        assert np.abs(moving[i].value - expected[i]).max() < 1e-15
        assert np.abs(moving[i].slope - (ahead - behind) / 2e-5).max() < 2e-10


def test_the_source_of_a_lane_function_can_be_read() -> None:
    """numba reads it from the given file; since Python 3.13 a missing source is an error."""
    function = lane_function("with_a_source", LANES, dict)
    assert inspect.getsourcefile(function) == flatten.__file__
    assert inspect.getsource(function).split()[:2] == ["def", "in_every_lane(w:"]


def test_each_lane_function_does_its_own_step(tmp_path: Path) -> None:
    """Two steps and two lane counts, compiled and then loaded from the cache of numba.

    A name belongs to one step, because the cache distinguishes steps only by name.
    """
    script = """
import sys
import numba, numpy as np
from robotball.theory.ensembles import flatten
from robotball.theory.ensembles.flatten import lane_function
def step(read, factor):
    return {1: factor * read(0)}
for name, factor, lanes in ("double", 2.0, 1), ("wide", 2.0, 2), ("triple", 3.0, 1):
    run = numba.njit("void(f8[::1])", cache=True)(lane_function(name, lanes, step, factor))
    workspace = np.array([1.0, 5.0, 0.0, 0.0])
    run(workspace)
    print(*workspace, run.stats.cache_misses.total())
try:
    lane_function("double", 1, step, 3.0)
except ValueError as error:
    print(error)
"""
    machine = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", script]
    for misses in 1, 0:
        assert subprocess.check_output(command, env=machine, text=True).splitlines() == [
            f"1.0 2.0 0.0 0.0 {misses}",
            f"1.0 5.0 2.0 10.0 {misses}",
            f"1.0 3.0 0.0 0.0 {misses}",
            "the lane function double does another step: choose another name",
        ]
