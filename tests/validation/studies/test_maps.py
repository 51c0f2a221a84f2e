"""Maps over two axes: the order and the position of their cells."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from validation.studies.maps import draw_cells, draw_level, grid_cells


def test_cells_are_listed_row_by_row() -> None:
    """The first axis varies fastest, and all cells have the held values."""
    cells = grid_cells(("K", [1.0, 2.0, 3.0]), ("f", [10.0, 20.0]), scene="fig12")
    assert [cell["K"] for cell in cells] == [1.0, 2.0, 3.0, 1.0, 2.0, 3.0]
    assert [cell["f"] for cell in cells] == [10.0] * 3 + [20.0] * 3
    assert {cell["scene"] for cell in cells} == {"fig12"}


def test_rectangles_touch_around_their_places_in_the_order_of_the_cells() -> None:
    """A rectangle is as wide as the distance to the next; a single one has the width 1."""
    xs, ys = [1.0, 1.5, 2.0], [4.0]
    axes = Figure().subplots()
    draw_cells(axes, xs, ys, [{"color": f"C{i}"} for i in range(3)])
    drawn = [patch for patch in axes.patches if isinstance(patch, Rectangle)]
    assert [box.get_x() for box in drawn] == pytest.approx([0.75, 1.25, 1.75])
    sizes = {(box.get_width(), box.get_y(), box.get_height()) for box in drawn}
    assert sizes == {(0.5, 3.5, 1)}
    with pytest.raises(ValueError, match="argument 2 is shorter"):
        draw_cells(axes, xs, ys, [{}] * 2)


def test_a_level_line_lies_at_its_level() -> None:
    """The function is x² + y² on a grid (y, x), the level 2."""
    xs, ys = np.linspace(-2, 2, 81), np.linspace(-3, 3, 101)
    axes = Figure().subplots()
    draw_level(axes, xs, ys, xs**2 + ys[:, None] ** 2, "C0", level=2.0, rim=3.0)
    (line,) = axes.collections
    points = np.concatenate([np.asarray(path.vertices) for path in line.get_paths()])
    assert len(points) > 100
    assert np.abs(np.hypot(*points.T) - np.sqrt(2)).max() < 1e-3  # measured 3e-4
