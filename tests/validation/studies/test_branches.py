"""Pictures of branches, and what is written while they are followed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.qualitative.continuation import UNFINISHED
from validation.studies import branches
from validation.studies.branches import Continue, _branch_picture


def test_a_branch_of_one_point_is_drawn() -> None:
    """As a dot at its place: Newton's method may converge no further on either side of a start."""
    row = {"branch": 1, "name": "1", "value": 3.0, "kind": "", "stable": False, "period": 30.0}
    row |= {f"gamma{i}": 0.0 for i in (1, 2, 3)}
    (axes,) = _branch_picture(rb.load_scene("fig12"), ("c", "kg m²/s"), [row], []).axes
    drawn = [np.column_stack(line.get_data()).tolist() for line in axes.lines]
    assert [points for points in drawn if points] == [[[3.0, 30.0]]]


def test_a_result_is_written_as_a_branch_grows(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """With an end of its own, so that a run that is stopped leaves all that it had found.

    Its percentage never falls, and is what the places and the branches of one are.
    """
    seen: list[tuple[int, bool]] = []
    done: list[float] = []

    def kept(study: Any, *paths: Any) -> list[Path]:
        seen.append((len(study.rows), any(UNFINISHED in each for each in study.record["ends"])))
        if len(seen) == 40:
            raise KeyboardInterrupt
        return [tmp_path]

    class Bar:
        def __enter__(self) -> Any:
            return lambda part, what: done.append(part)

        def __exit__(self, *of: object) -> None:
            pass

    monkeypatch.setattr(branches, "progress_bar", lambda total: Bar())
    monkeypatch.setattr(branches, "_branch_picture", lambda *of: None)
    monkeypatch.setattr(branches, "write", kept)
    monkeypatch.setattr(branches, "_WRITE_EVERY", 0.0)
    run = Continue("fig07", "equilibrium", "K3", 2.0, 2.5, out=tmp_path)
    with pytest.raises(KeyboardInterrupt):
        run.run()
    counts, unfinished = zip(*seen, strict=True)
    assert all(unfinished[:10])
    assert np.all(np.diff(counts[:39]) >= 0)
    assert counts[38] > counts[0]
    assert np.all(np.diff(done) >= 0)
    assert len(set(done)) > 20
    assert 0 < max(done) <= 1
