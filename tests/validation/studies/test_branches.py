"""Pictures of branches, and partial results during the search."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.dynamics import motion_branches
from robotball.dynamics.continuation import DRIFT, FOLD, UNFINISHED, Branch, Point, Watch
from tests.messages import unnamed
from validation.studies import branches
from validation.studies.branches import _branch_picture, follow_branches
from validation.study import Study


def test_a_branch_of_one_point_is_drawn() -> None:
    """It is a dot. Newton's method may fail to converge on both sides of a start."""
    row = {"branch": 1, "name": "1", "value": 3.0, "kind": "", "stable": False, "period": 30.0}
    row |= {f"gamma{i}": 0.0 for i in (1, 2, 3)}
    (axes,) = _branch_picture(rb.load_scene("fig12"), ("c", "kg m²/s"), [row], []).axes
    drawn = [np.column_stack(line.get_data()).tolist() for line in axes.lines]
    assert [points for points in drawn if points] == [[[3.0, 30.0]]]


def test_a_branch_changes_its_dashes_at_special_points_alone() -> None:
    """Rounding in the exponents next to them has no effect. The title has the positions."""
    kinds, stable = ["", "", DRIFT, "", "", ""], [False, False, False, False, True, True]
    rows: list[Any] = [
        {"branch": 1, "name": "1", "value": float(i), "kind": kind, "stable": is_so, "period": None}
        | {f"gamma{k}": 0.1 * i for k in (1, 2, 3)}
        for i, (kind, is_so) in enumerate(zip(kinds, stable, strict=True))
    ]
    figure = _branch_picture(rb.load_scene("fig12"), ("c", "kg m²/s"), rows, [rows[2]])
    drawn = [
        (line.get_linestyle(), np.array(line.get_data()[0]).tolist())
        for line in figure.axes[0].lines
    ]
    assert [line for line in drawn if len(line[1]) > 1] == [("--", [0, 1, 2]), ("-", [2, 3, 4, 5])]
    assert figure.get_suptitle() == "fig12, over c: drift point at 2"


def test_a_result_is_written_as_a_branch_grows(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A stopped run leaves all its points, and the unfinished branch is marked.

    The fraction done never falls.
    """
    seen: list[tuple[int, bool]] = []
    done: list[float] = []

    def kept(study: Study) -> Path:
        assert study.record is not None
        seen.append((len(study.rows), any(UNFINISHED in each for each in study.record["ends"])))
        if len(seen) == 40:
            raise KeyboardInterrupt
        return tmp_path

    class Bar:
        def __enter__(self) -> Any:
            return lambda part, message: done.append(part)

        def __exit__(self, *of: object) -> None:
            pass

    monkeypatch.setattr(branches, "progress_bar", lambda total: Bar())
    monkeypatch.setattr(branches, "_branch_picture", lambda *of: None)
    monkeypatch.setattr(branches, "_WRITE_EVERY", 0.0)
    with pytest.raises(KeyboardInterrupt):
        follow_branches("fig07", "equilibrium", "K3=2:2.5", None, kept)
    counts, unfinished = zip(*seen, strict=True)
    assert all(unfinished[:10])
    assert np.all(np.diff(counts[:39]) >= 0)
    assert counts[38] > counts[0]
    assert np.all(np.diff(done) >= 0)
    assert len(set(done)) > 20
    assert 0 < max(done) <= 1


def test_lost_motions_of_a_driven_branch_are_counted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line has their number and the first of them."""

    def planted(family: Any, watch: Watch) -> Iterator[Branch]:
        assert family.longest == 2.5
        state = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -np.log(0.78), 0.0]
        point = Point(np.array(state), np.eye(11)[-1], np.zeros(5, complex), FOLD)
        for s in (0.0, 0.5):
            watch.lost(s, f"it lifts off at t = {s:g} s; wait")
        yield Branch((point,), ("begins", "ends"))

    monkeypatch.setattr(branches, "swinging", planted)
    follow_branches("shaken_ball", "cycle", "frequency=0.78:0.84", 2.5, lambda study: tmp_path)
    printed = " ".join(capsys.readouterr().out.split())
    assert unnamed("2~× frequency~=~0.78 0~s", printed) == []


def test_a_branch_that_ends_at_zero_is_printed_with_zero(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Rounding is printed as 0, and a small number as it is."""

    def planted(family: Any, watch: Watch) -> Iterator[Branch]:
        for off in (1e-14, 1e-5):
            point = Point(np.array([0.0, 0.0, 1.0, 0.5 + off]), np.eye(4)[-1], np.zeros(2, complex))
            yield Branch((point,), ("closes", "closes"))

    monkeypatch.setattr(motion_branches, "resting", planted)
    follow_branches("fig07", "equilibrium", "K3=-1:1", None, lambda _: tmp_path)
    rows = [line.split() for line in capsys.readouterr().out.splitlines() if "closes" in line]
    assert [row[2] for row in rows] == ["0", "0", "2e-05", "2e-05"]
