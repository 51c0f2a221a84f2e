"""The failure maps: their cells, the outcomes of runs, and the measured limits."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robotball as rb
from bench.random_runs import extreme, ordinary
from robotball import FaultKind
from robotball.engines.mujoco.settings import ORDER_8
from tests.conftest import Robotball
from validation import compare
from validation.studies.extreme_maps import MAPS, QUICK, Cut, base, cells_of
from validation.studies.extremes import (
    Outcome,
    _map_picture,
    classify,
    measure_cell,
    measured_limits,
    missed,
    totals,
)
from validation.sweeps import Result

ROLLINGS = ("rubber", "classical")


def cell(name: str, integrator: str, x: float, y: float, rolling: str = "rubber") -> dict[str, Any]:
    return {"map": name, "rolling": rolling, "integrator": integrator, "x": x, "y": y}


def test_the_quick_atlas_has_every_map() -> None:
    """An axis has two or three values, including both ends."""
    for chosen in MAPS.values():
        xs = {cell["x"] for cell in cells_of(chosen, QUICK) if cell["integrator"] == "RK4"}
        assert 2 <= len(xs) <= 3
        assert {chosen.x.values[0], chosen.x.values[-1]} <= xs


@pytest.mark.parametrize(
    ("kinds", "error", "outcome"),
    [
        ((), 1e-5, Outcome.ACCURATE),
        ((), 1e-3, Outcome.DEGRADED),
        ((), 0.2, Outcome.WRONG),
        ((FaultKind.MOMENTUM_OFF,), 0.2, Outcome.WRONG),
        ((FaultKind.RATE_OFF,), 0.05, Outcome.DEGRADED),
        ((FaultKind.MOMENTUM_OFF, FaultKind.RATE_OFF), 0.2, Outcome.OFF_RATE),
        ((FaultKind.SLIPPED,), 1e-5, Outcome.SLIPPED),
        ((FaultKind.CONE_SATURATED, FaultKind.CONTACT_LOST), 0.2, Outcome.SLIPPED),
        ((FaultKind.CONTACT_LOST, FaultKind.CONE_SATURATED), 0.2, Outcome.LOST_CONTACT),
        ((FaultKind.CONTACT_LOST, FaultKind.DIVERGED), None, Outcome.DIVERGED),
        ((FaultKind.ENGINE_WARNED,), 1e-5, Outcome.DIVERGED),
    ],
)
def test_faults_and_error_decide_the_outcome(
    kinds: Sequence[FaultKind], error: float | None, outcome: Outcome
) -> None:
    """An invalid state comes first, then the first fault, then the error."""
    assert classify([rb.Fault(kind, 1.0) for kind in kinds], error) is outcome


@pytest.mark.parametrize(
    ("where", "outcome"),
    [
        (cell("momentum", "RK4", 2e-4, 1.78), Outcome.ACCURATE),
        (cell("momentum", "RK4", 0.2, 1e4), Outcome.DIVERGED),
        (cell("momentum", "Euler", 2e-4, 133.0), Outcome.WRONG),
        (cell("momentum", ORDER_8, 0.0104, 1780.0, "classical"), Outcome.ACCURATE),
        (cell("friction", "RK4", 20.0, 9.81), Outcome.ACCURATE),
        (cell("friction", "RK4", 0.8, 9.81), Outcome.SLIPPED),
        (cell("contact", "RK4", 1e-5, 0.5), Outcome.LOST_CONTACT),
        (cell("servo", "implicit", 2e-3, 10.0), Outcome.OFF_RATE),
        (cell("rotor", "RK4", 2e-3, 10.0), Outcome.REFUSED),
        (cell("duration", "RK4", 0.02, 10.0, "classical"), Outcome.ACCURATE),
    ],
    ids=lambda value: value.name if isinstance(value, Outcome) else value["map"],
)
def test_a_cell_has_its_outcome(where: dict[str, Any], outcome: Outcome) -> None:
    """One cell of each outcome that a run can have."""
    record = measure_cell(where)
    assert record["outcome"] == outcome.name, record
    json.dumps(record, allow_nan=False)
    assert not missed(Result(where, record, None))


def result(outcome: str, error: float | None, **changes: Any) -> Result:
    """Return a result without warning and without fault, except for the changes."""
    errors = {"path_error": error, "momentum_error": None if error is None else 0.0}
    return Result({}, {"outcome": outcome, "foretold": [], "faults": [], **errors, **changes}, None)


def test_the_totals_count_the_wrong_runs_by_who_reported_them() -> None:
    """Seven runs: two accurate, one of these with a warning; four wrong; one refused."""
    foretold, faults = {"foretold": ["rotation"]}, {"faults": ["M off"]}
    runs = [
        result("ACCURATE", 0.0),
        result("ACCURATE", 1e-4, **foretold),
        result("WRONG", 0.2, **foretold, **faults),
        result("DIVERGED", None, **faults),
        result("UNFINISHED", None, **foretold),
        result("SLIPPED", 5.0),
        Result({}, {"outcome": "REFUSED", "refusal": "no such ball"}, None),
    ]
    assert [run for run in runs if missed(run)] == [runs[5]]
    counts = {"runs": 7, "accurate": 2, "alarms": 1}
    wrong = {"wrong": 4, "reported_by_engine": 1, "foretold": 2, "noticed": 2, "missed": 1}
    assert totals(runs) == counts | wrong


def test_a_limit_is_measured_between_the_last_sound_and_the_first_broken_cell() -> None:
    """Values are relative to the limit. Only cells nearest to this limit count as broken by it."""
    cells = [
        result("", error, nearness={"limit": limit, "other": other})
        for limit, other, error in ((0.5, 0, 1e-9), (0.9, 0, 1e-9), (1.2, 0, 0.5), (0.1, 0.2, 0.5))
    ]
    (limit,) = measured_limits(cells)
    assert limit == {"name": "limit", "kept": 0.9, "broken": 1.2, "cells": 1}


@pytest.mark.parametrize(
    ("rolling", "gravity", "constant"),
    [("rubber", 1e-9, 0.01), ("classical", 9.81, 0.04), ("rubber", 1e6, 10.0)],
)
def test_the_margin_carries_the_weight_at_any_depth(
    rolling: str, gravity: float, constant: float
) -> None:
    """At depths from 1e-17 to 1e4 radii the timestep alone makes the error, to four digits."""
    enough = max(20.0, 60.0 / gravity)
    frictions: dict[str, Any] = {"sliding_friction": enough, "torsional_friction": enough}
    settings = replace(rb.preset("balanced"), solref=(constant, 1.0), **frictions)
    scene = replace(base(rolling), gravity=gravity)
    error = compare(scene, rb.sample_times(2.0), settings=settings).path_error
    assert error == pytest.approx(7.4804e-10 if rolling == "rubber" else 4.7482e-9, rel=1e-4)


def test_the_command_draws_a_map(
    tmp_path: Path, robotball: Robotball, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It writes a picture, the table of the cells and the summary."""
    monkeypatch.setattr("validation.studies.extremes.QUICK", Cut(("RK4",), 2))
    arguments = ["study", "extremes", "torsion", "--quick", "--workers", 1, "--out", "."]
    status, printed, _ = robotball(*arguments, "--json", "summary.json")
    assert status == 0
    assert "sliding_friction" in printed
    assert all((tmp_path / f"extremes-torsion-quick.{end}").is_file() for end in ("png", "csv"))
    records = json.loads((tmp_path / "summary.json").read_text())["summary"]
    assert sum(sum(record["outcomes"].values()) for record in records) == 4
    assert all(record["missed"] == record["outcomes"]["FAILED"] == 0 for record in records)


def test_every_random_run_can_be_made() -> None:
    """Each of the first 120 random runs of both kinds has a valid ball."""
    for number in range(120):
        for run in (extreme(0, number), ordinary(0, number)):
            assert run.scene.not_reduced is None
            assert len(run.times) == 101


def test_a_map_has_a_panel_for_each_integrator_and_three_colours() -> None:
    """Right, wrong with a fault, wrong without one, and no colour without a run."""
    cells = {
        (0.01, 1.0): result("DEGRADED", 1e-3),
        (0.1, 1.0): result("SLIPPED", 0.5, faults=["slipped"]),
        (0.01, 10.0): result("DEGRADED", 0.02),
        (0.1, 10.0): result("REFUSED", None),
    }
    results = [
        replace(found, cell=cell("momentum", integrator, *place))
        for integrator in ("Euler", "RK4")
        for place, found in cells.items()
    ]
    figure = _map_picture("momentum", results)
    assert [axes.get_title() for axes in figure.axes] == ["Euler, rubber", "RK4, rubber"]
    (mesh,) = figure.axes[0].collections
    drawn = np.ma.masked_invalid(np.asarray(mesh.get_array()))
    assert drawn.filled(-1).ravel().tolist() == [0.0, 1.0, 2.0, -1.0]
    assert "2 of 4 errors" in figure.get_suptitle()
