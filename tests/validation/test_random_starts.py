"""Many random starts have the errors of single comparisons."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.engines.engine import request_of
from robotball.processes import at_most
from tests.messages import unnamed
from validation import ManyRuns, compare, compare_many, many_runs
from validation.cli import main

TIMES = rb.sample_times(1.0)


def starts_of(scene: rb.Scene, count: int) -> list[rb.Start]:
    randoms = (np.random.default_rng([7, i]) for i in range(count))
    return [many_runs.random_start(scene, random) for random in randoms]


# Compiled steps of both models; single integrations with a changing drive, and of general robots.
@pytest.mark.parametrize(
    "name", ["fig12", "classical_regular", "wobbling_drive", "offset_routh_sphere"]
)
def test_errors_equal_the_errors_of_single_comparisons(name: str) -> None:
    """They agree to 3e-8; measured 5e-9, because the references have other steps."""
    scene = rb.load_scene(name)
    starts = starts_of(scene, 3)
    with at_most(1):  # or what goes to processes would take seconds
        rows = compare_many(scene, starts, TIMES, settings="fast").rows
    for row, start in zip(rows, starts, strict=True):
        one = compare(replace(scene, start=start), TIMES, settings="fast")
        for error in many_runs.ERRORS:
            assert row[error] == pytest.approx(getattr(one, error), rel=3e-8)
        assert (row["fault"], row["agrees"]) == (None, True)


def test_a_broken_run_is_counted_and_has_no_error() -> None:
    """Weak friction ends a run. Percentiles use the runs with errors."""
    scene, slippery = rb.load_scene("fig12"), replace(rb.preset("fast"), sliding_friction=0.05)
    found = compare_many(scene, starts_of(scene, 3), TIMES, settings=slippery)
    none = found.summary("path_error")
    assert none["faulty"] == 3
    assert {none[name] for name in many_runs.PERCENTILES} == {None}
    row = {"path_error": 1.0, "fault": None, "agrees": True, "seconds": 1.0}
    rows = tuple(row | {"path_error": float(i)} for i in range(101))
    broken = row | {"path_error": None, "fault": "SLIPPED"}
    counts = {"runs": 102, "faulty": 1, "runs_per_second": 1.0}
    percentiles = {"p5": 5.0, "p50": 50.0, "p95": 95.0, "worst": 100.0}
    assert ManyRuns((*rows, broken)).summary("path_error") == counts | percentiles


def test_a_start_depends_on_its_number_alone() -> None:
    """So more starts of the same seed continue the fewer ones."""
    scene, request = rb.load_scene("fig12"), request_of("mujoco", "fast")
    few, many = (many_runs.random_runs(scene, count, 0.5, request, seed=3).rows for count in (2, 3))
    assert [{**row, "seconds": 0.0} for row in few] == [{**row, "seconds": 0.0} for row in many[:2]]


def test_random_starts_run_in_the_environments(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It works like `compare --environments` for a single run."""
    looked: list[Path] = []
    monkeypatch.setattr("robotball.engines.adapter.find_spec", lambda _: None)
    found = "robotball.engines.adapter.interpreter_of"
    monkeypatch.setattr(found, lambda home, _: looked.append(home))
    words = "compare fig12 --starts 1 --engine dart --preset best --environments elsewhere"
    with pytest.raises(SystemExit):
        main(words.split())
    assert unnamed("DART", capsys.readouterr().err) == []
    assert looked == [Path("elsewhere/dart")]
