"""The table of the engine study: the runs of each engine, and robotball's part in them."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from robotball import Engine, engine_named

Ladder = tuple[str, tuple[float, ...]]
"""A field of an engine's settings and the values to run."""


@dataclass(frozen=True)
class EngineRow:
    """The runs of an engine in the study.

    Attributes
    ----------
    ladders : mapping of str to Ladder
        For each preset, the field that is varied and its values.
    ours : mapping of str to str
        For each preset, the parts of a run that robotball provides instead of the engine.
    source : str
        The page or example of the engine's documentation that its default preset follows.
    """

    ladders: Mapping[str, Ladder]
    ours: Mapping[str, str] = field(default_factory=dict)
    source: str = ""


def row_of(name: str) -> EngineRow:
    """Return the row of an engine, by default one run per preset."""
    return _rows().get(name) or EngineRow(_as_they_are(engine_named(name)))


def _as_they_are(engine: Engine) -> dict[str, Ladder]:
    """Return a ladder of one value per preset: its timestep, its rtol, or its error tolerance."""
    ladders: dict[str, Ladder] = {}
    for name, preset in engine.presets.items():
        has = [key for key in ("timestep", "rtol") if isinstance(getattr(preset, key, None), float)]
        key = (*has, "error_tolerance")[0]
        ladders[name] = (key, (getattr(preset, key),))
    return ladders


@cache
def _rows() -> dict[str, EngineRow]:
    text = Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
    return {name: _row(**row) for name, row in tomllib.loads(text).items()}


def _row(ladders: Any, **others: Any) -> EngineRow:
    """Return a row of the TOML file, where ladders are {preset: {field: values}}."""
    pairs = {preset: (key, tuple(row[key])) for preset, row in ladders.items() for key in row}
    return EngineRow(pairs, **others)
