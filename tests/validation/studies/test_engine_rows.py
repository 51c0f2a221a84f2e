"""The table of the engine study matches the engines."""

import pytest

from robotball import engine_named
from robotball.engines.engine import OURS
from validation.studies.engine_study import row_of


@pytest.mark.parametrize("name", OURS)
def test_a_row_refers_to_presets_of_its_engine(name: str) -> None:
    """Ladders name fields of the presets, and an engine of another package names its source.

    MuJoCo's ports use MuJoCo's presets, without a source.
    """
    engine, row = engine_named(name), row_of(name)
    for preset, (field, values) in row.ladders.items():
        assert hasattr(engine.presets[preset], field)
        assert len(values) > 0
    assert row.ours.keys() <= engine.presets.keys()
    assert bool(row.source) == (name not in ("mujoco", "multibody", "mjx", "mujoco-warp"))
