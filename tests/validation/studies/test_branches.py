"""Pictures of branches."""

import numpy as np

import robotball as rb
from validation.studies.branches import _branch_picture


def test_a_branch_of_one_point_is_drawn() -> None:
    """As a dot at its place: Newton's method may converge no further on either side of a start."""
    row = {"branch": 1, "name": "1", "value": 3.0, "kind": "", "stable": False, "period": 30.0}
    row |= {f"gamma{i}": 0.0 for i in (1, 2, 3)}
    (axes,) = _branch_picture(rb.load_scene("fig12"), ("c", "kg m²/s"), [row], []).axes
    drawn = [np.column_stack(line.get_data()).tolist() for line in axes.lines]
    assert [points for points in drawn if points] == [[[3.0, 30.0]]]
