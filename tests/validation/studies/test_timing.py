"""Costs relative to the bare loop, measured with a clock that the test controls."""

import pytest

from validation.studies import measuring
from validation.studies.measuring import Cost, measure_costs


def test_a_cost_is_a_ratio_to_the_bare_loops_around_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that slows down by a third in every round does not change the ratios.

    The loops take 1 s, 4/3 s, (4/3)² s, ...; a run takes the mean of the loops around it.
    """
    speed = iter([(4 / 3) ** k for k in range(20)])
    latest = [0.0]

    def loop() -> float:
        latest[0] = next(speed)
        return latest[0]

    monkeypatch.setattr(measuring, "bare_loop", loop)
    # The loop after a work takes 4/3 of the loop before it; their mean is 7/6.
    shown: list[int] = []
    works = [lambda factor=factor: factor * latest[0] * 7 / 6 for factor in (2.0, 0.5)]
    costs = measure_costs(works, rounds=3, show=shown.append)
    for cost, factor in zip(costs, (2.0, 0.5), strict=True):
        assert cost.ratios == pytest.approx([factor] * 3)
        assert cost.ratio == pytest.approx(factor)
        assert cost.seconds == pytest.approx(factor * cost.baseline)
    # The median is taken over the six loops after the warm-up round.
    later = [(4 / 3) ** k for k in range(3, 9)]
    assert costs[0].baseline == pytest.approx((later[2] + later[3]) / 2)
    assert shown == list(range(1, 9))


def test_a_cost_over_another_is_of_the_same_rounds() -> None:
    """The other cost becomes the unit, and its seconds the baseline."""
    ours, theirs = Cost((2.0, 6.0, 3.0), 0.5), Cost((1.0, 2.0, 4.0), 0.5)
    over = ours.over(theirs)
    assert over.ratios == (2.0, 3.0, 0.75)
    assert (over.ratio, over.spread, over.baseline) == (2.0, (0.75, 3.0), 1.0)
