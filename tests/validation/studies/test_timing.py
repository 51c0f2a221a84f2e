"""What work costs: ratios to the bare loop beside it, whatever the machine's speed does."""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import pytest

import robotball as rb
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from validation.studies import timing
from validation.studies.timing import Cost, measure_costs, simulated_second


def test_a_machine_that_slows_down_changes_no_ratio(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work that takes twice the bare loop costs 2, however the speed drifts between turns."""
    speed: Iterator[float] = itertools.count(1.0, 0.5)
    monkeypatch.setattr(timing, "bare_loop", lambda: next(speed))
    # Before each work the clock has just told `now`, and after it `now` + 0.5.
    seen = iter([2 * (1.25 + 0.5 * n) for n in range(8)])
    one, other = measure_costs([lambda: next(seen), lambda: next(seen)], rounds=3)
    assert one.ratios == pytest.approx((2.0, 2.0, 2.0))
    assert other.ratios == pytest.approx((2.0, 2.0, 2.0))
    # The first turn warms up; the six loops after it tell 2.5, 3, ... 5.
    assert one.baseline == pytest.approx(3.75)
    assert one.seconds == pytest.approx(7.5)


def test_the_median_is_told_with_its_spread() -> None:
    """One slow round widens the spread and leaves the ratio where it was."""
    cost = Cost((2.0, 9.0, 2.2, 1.9, 2.1), baseline=0.5)
    assert cost.ratio == 2.1
    assert cost.spread == (1.9, 9.0)
    assert cost.over(cost).ratios == (1.0,) * 5
    assert cost.over(cost).baseline == cost.seconds == 1.05


def test_cost_is_of_a_simulated_second(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run's time is told per simulated second; of one that broke off, per second it stepped."""
    scene, times = rb.load_scene("fig12"), rb.sample_times(2.0)
    model = build(scene, rb.preset("fast"))
    motion = run(model, times)
    slow = replace(motion, report=replace(motion.report, seconds=3.0))
    monkeypatch.setattr(timing, "run", lambda model, times: slow)
    assert simulated_second(model, times)() == pytest.approx(1.5)
    broken = replace(slow, times=times[:5])
    monkeypatch.setattr(timing, "run", lambda model, times: broken)
    assert simulated_second(model, times)() == pytest.approx(1.5)
