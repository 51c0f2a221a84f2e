"""Maps over two axes: sweep their cells, and draw cells and level lines.

The cells of a map are plain data in rows: the first axis varies fastest.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from robotball.rotations import Array

from ..output import halo
from ..sweeps import Cell


def grid_cells(
    x: tuple[str, Sequence[float]], y: tuple[str, Sequence[float]], **held: Any
) -> list[Cell]:
    """Return a cell for each pair of values of two named axes, each with the held values."""
    return [{**held, x[0]: across, y[0]: up} for up in y[1] for across in x[1]]


def draw_cells(
    axes: Axes, xs: Sequence[float], ys: Sequence[float], styles: Sequence[Mapping[str, Any]]
) -> None:
    """Draw cells as rectangles in the given styles, centred at equally spaced positions."""
    # Rectangles can have hatches, which an image cannot.
    width, height = (values[1] - values[0] if len(values) > 1 else 1 for values in (xs, ys))
    places = ((x, y) for y in ys for x in xs)
    for (x, y), style in zip(places, styles, strict=True):
        axes.add_patch(Rectangle((x - width / 2, y - height / 2), width, height, **style))


def draw_level(
    axes: Axes,
    xs: Any,
    ys: Any,
    grid: Array,
    colour: str,
    *,
    level: float = 0.0,
    dashes: Any = "-",
    width: float = 1.8,
    rim: float = 0.0,
) -> None:
    """Draw a level line of a function (y, x), with a white rim [points]."""
    lines = axes.contour(xs, ys, grid, levels=[level], colors=[colour], linewidths=width)
    lines.set_linestyle(dashes)
    if rim:
        lines.set_path_effects(halo(rim))
