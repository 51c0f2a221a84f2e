"""The page on controllers has the numbers that examples/controllers.py gives."""

import re
import runpy
import warnings
from dataclasses import replace
from typing import Any

import pytest

import robotball as rb
from tests.imports import PROJECT

PAGE = (PROJECT / "docs" / "controllers.md").read_text(encoding="utf-8")
EXAMPLE = runpy.run_path(str(PROJECT / "examples" / "controllers.py"))
LOOPS, missed = EXAMPLE["LOOPS"], EXAMPLE["missed"]


def numbers(row: str) -> list[float]:
    """Return the numbers in a row of the page's tables, without units."""
    (cells,) = re.findall(rf"^\| {re.escape(row)} \|(.*)\|$", PAGE, re.M)
    return [float(cell.split()[0]) for cell in cells.split("|")]


def simulated(scene: rb.Scene, theory: Any, settings: str) -> rb.Agreement:
    with warnings.catch_warnings():  # naive is meant to fail
        warnings.simplefilter("ignore")
        return rb.compare(scene, settings=settings, theory=theory)


# Ten to twenty seconds each, so only one is in every run.
EACH = [n if n == "damp" else pytest.param(n, marks=pytest.mark.study) for n in LOOPS]


@pytest.mark.parametrize("name", EACH)
def test_a_closed_loop_has_the_errors_that_the_page_states(name: str) -> None:
    """With accurate below 1e-6 of the path: measured 1e-10 to 4e-10."""
    scene, (off, growth, misses, naive, says) = LOOPS[name], numbers(name)
    theory = rb.integrate(scene)
    assert missed(theory) == pytest.approx(misses, rel=0.05)
    right, wrong = (simulated(scene, theory, preset) for preset in ("accurate", "naive"))
    assert right.agrees
    assert right.path_error < 1e-6
    assert right.path_error == pytest.approx(off, rel=0.5)
    assert right.loop_growth == pytest.approx(growth, rel=0.1)
    assert wrong.path_error == pytest.approx(naive, rel=0.2)
    assert missed(wrong.motion) == pytest.approx(says, rel=0.1)


@pytest.mark.study
def test_the_best_gain_for_naive_is_not_the_best_for_rolling() -> None:
    """With a gain of 16 the rolling ball misses its point by more than twice as much as with 8."""
    of_naive, rolling = (numbers(f"distance from the point, {m}") for m in ("*naive*", "rolling"))
    scene, distances = LOOPS["stop"], []
    for gain in (8.0, 16.0):
        task = replace(scene.controller.function, roll=gain)
        loop = scene.with_controller(replace(scene.controller, function=task))
        theory = rb.integrate(loop)
        distances.append((missed(simulated(loop, theory, "naive").motion), missed(theory)))
    assert [naive for naive, _ in distances] == pytest.approx(of_naive[1:], rel=0.1)
    assert [exact for _, exact in distances] == pytest.approx(rolling[1:], rel=0.1)
    assert distances[1][0] < distances[0][0]
    assert distances[1][1] > 2 * distances[0][1]
