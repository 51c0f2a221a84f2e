"""The search for settings: its budget, its draw, and that it finds what it looks for."""

import json
import math
from collections.abc import Sequence
from pathlib import Path

import pytest

import robotball as rb
from robotball import engine_names
from tests.conftest import Robotball
from tests.messages import unnamed
from validation.studies import engine_study
from validation.studies.engine_rows import Knobs, row_of
from validation.studies.engine_runs import changed, run
from validation.studies.engine_study import Changes, search

KINDS = ("wrong", "right", "worst")
KNOBS: Knobs = ("best", {"step": slice(1e-4, 1e-1), "kind": KINDS, "gain": slice(1.0, 1e6)})


def error(tried: Changes) -> float:
    """Least for the right kind, at a step of 1e-2 and a gain of 1e3."""
    if tried.get("kind", "wrong") == "wrong":
        return 1.0
    off = [math.log10(tried["step"] / 1e-2), math.log10(tried["gain"] / 1e3)]
    return math.inf if tried["kind"] == "worst" else 1e-3 + 1e-2 * math.hypot(*off)


def searched(budget: int) -> list[Changes]:
    """All that a search tries."""
    calls: list[Sequence[Changes]] = []

    def errors(tried: Sequence[Changes]) -> list[float]:
        calls.append(tried)
        return [error(each) for each in tried]

    search(KNOBS, budget, errors)
    first, whole = calls
    assert whole[: len(first)] == first
    return [*whole]


def test_a_search_draws_evenly_and_refines_the_best() -> None:
    """It begins with the preset, tries as many as it may, and the same when it is begun again.

    Two thirds are drawn: of these the best is at 3.1e-3, and of all at 1.5e-3.
    """
    tried = searched(60)
    assert (tried[0], len(tried)) == ({}, 60)
    assert searched(60) == tried
    assert {each["kind"] for each in tried[1:40]} == {*KINDS}
    assert all(1e-4 <= each["step"] <= 1e-1 and 1.0 <= each["gain"] <= 1e6 for each in tried[1:])
    drawn, refined = min(map(error, tried[:40])), min(map(error, tried))
    assert refined < 0.8 * drawn
    assert json.loads(json.dumps(tried)) == tried


@pytest.mark.parametrize("name", [name for name in engine_names() if row_of(name).knobs])
def test_an_engine_s_knobs_turn_its_own_settings(name: str) -> None:
    """Each is a field, and the first and the last of all their values are settings."""
    engine = rb.engine_named(name)
    knobs = row_of(name).knobs
    assert knobs is not None
    preset, spans = knobs
    for end in (0, -1):
        ends = {
            knob: (span.start, span.stop)[end] if isinstance(span, slice) else span[end]
            for knob, span in spans.items()
        }
        assert changed(engine.presets[preset], ends) != engine.presets[preset]
    with pytest.raises((TypeError, AttributeError)):
        changed(engine.presets[preset], {"no.such": 1.0})


@pytest.mark.slow
def test_an_engine_s_search_keeps_its_log_and_says_the_best(
    robotball: Robotball, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No draw of three beats the recipe; the log has every run, and a second call makes none."""
    monkeypatch.setattr(engine_study, "measure", run)  # without a process of its own for each
    command = "engines wobbling_drive --only mujoco --tune --budget 4 --duration 0.2 --workers 1"
    shown = [robotball(*command.split())[:2] for _ in range(2)]
    assert shown[0][0] == 0
    assert shown[0] == shown[1]
    assert "as published" in shown[0][1].splitlines()[4]
    (log,) = tmp_path.glob("out/*tune-mujoco*.jsonl")
    assert len(log.read_text().splitlines()) == 1 + 4
    (data,) = tmp_path.glob("out/*.json")
    best = json.loads(data.read_text())["best"]
    assert best[0]["changes"] == {}
    assert best[0]["path_error"] == min(run["path_error"] for run in best)


@pytest.mark.parametrize(
    ("words", "facts"),
    [
        ("--only multibody", "multibody"),
        ("--only dart", "DART --install~dart"),
        ("--only mujoco --budget 3", "budget"),
        ("--only mujoco --cap 0", "cap"),
    ],
)
def test_what_cannot_be_tuned_is_refused(robotball: Robotball, words: str, facts: str) -> None:
    """In one line."""
    status, _, err = robotball("engines", "wobbling_drive", "--tune", *words.split())
    assert status == 2
    assert unnamed(facts, err) == []
    assert err.count("\n") == 1
