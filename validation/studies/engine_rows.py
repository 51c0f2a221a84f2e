"""The table of the engine study: of each engine what is run, and what of its runs is ours."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from robotball import Engine, engine_named

Ladder = tuple[str, tuple[float, ...]]
"""A field of an engine's settings and the values that it takes in turn."""


@dataclass(frozen=True)
class EngineRow:
    """What the study runs of an engine.

    ladders   by preset, the values of a field at which its error is held against its cost
    ours      by preset, the parts of its runs that are robotball's and not the engine's
    source    the page or example of its own documentation that its preset as it comes follows
    """

    ladders: Mapping[str, Ladder]
    ours: Mapping[str, str] = field(default_factory=dict)
    source: str = ""


def row_of(name: str) -> EngineRow:
    """Return the row of an engine. One without a row runs each of its presets as it is."""
    return _rows().get(name) or EngineRow(_as_they_are(engine_named(name)))


def _as_they_are(engine: Engine) -> dict[str, Ladder]:
    """Return of each preset one value: of its timestep or its rtol, else of what all have."""
    found: dict[str, Ladder] = {}
    for name, preset in engine.presets.items():
        has = [key for key in ("timestep", "rtol") if isinstance(getattr(preset, key, None), float)]
        key = (*has, "error_tolerance")[0]
        found[name] = (key, (getattr(preset, key),))
    return found


@cache
def _rows() -> dict[str, EngineRow]:
    text = Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
    return {name: _row(**given) for name, given in tomllib.loads(text).items()}


def _row(ladders: Any, **others: Any) -> EngineRow:
    """Return a row of its table, whose ladders are {preset: {field: values}}."""
    taken = {preset: (key, tuple(row[key])) for preset, row in ladders.items() for key in row}
    return EngineRow(taken, **others)
