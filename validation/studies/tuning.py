"""The same search for every engine: its knobs drawn evenly, then the best few refined."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import qmc

from robotball.engine import Knobs
from robotball.rotations import Array

Changes = Mapping[str, Any]
"""Values of an engine's settings, by the names of their fields."""
_DRAWN = 2 / 3  # of the budget; the rest refines
_BEST = 4  # are refined
_NEAR = (0.2, 0.02)  # of every knob's span: the deviations around the best, the first and the last


def search(
    knobs: Knobs, budget: int, errors: Callable[[Sequence[Changes]], Sequence[float]]
) -> None:
    """Try `budget` configurations of the knobs, the preset's own first.

    errors: runs configurations and returns the error of each, infinite where there is none. The
    draw is seeded, so that a search that was broken off tries the same again.
    """
    names, spans = list(knobs[1]), list(knobs[1].values())

    def at(points: Array) -> list[Changes]:
        rows = [[_value(*each) for each in zip(spans, row, strict=True)] for row in points]
        return [dict(zip(names, row, strict=True)) for row in rows]

    drawn = qmc.Halton(len(names), rng=0).random(round(_DRAWN * budget) - 1)
    tried: list[Changes] = [{}, *at(drawn)]
    best = np.argsort(errors(tried)[1:], kind="stable")[:_BEST]
    normal = np.random.default_rng(0).normal(size=(budget - len(tried), len(names)))
    normal *= np.geomspace(*_NEAR, len(normal))[:, None]
    around = np.clip(drawn[np.resize(best, len(normal))] + normal, 0.0, 1.0)
    distinct = {json.dumps(each): each for each in [*tried, *at(around)]}
    errors([*distinct.values()])


def _value(span: tuple[Any, ...] | slice, part: float) -> Any:
    """Return the value at a part, from 0 to 1, of a knob's span, to three digits."""
    if isinstance(span, slice):
        return float(f"{span.start * (span.stop / span.start) ** part:.3g}")
    return span[min(int(part * len(span)), len(span) - 1)]
