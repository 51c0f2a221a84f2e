"""A map of two axes: its cells, and the drawing of cells and level lines.

The cells of a map are plain data and stand row by row: the first axis runs fastest.
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
    """Return the cells at all pairs of two axes, each a name and its values; held is in all."""
    return [{**held, x[0]: across, y[0]: up} for up in y[1] for across in x[1]]


def draw_cells(
    axes: Axes, xs: Sequence[float], ys: Sequence[float], looks: Sequence[Mapping[str, Any]]
) -> None:
    """Draw each cell, row by row, as a rectangle of its look around its place on even axes."""
    # A cell is a rectangle of its own, as an image could have no hatch.
    width, height = (values[1] - values[0] if len(values) > 1 else 1 for values in (xs, ys))
    places = ((x, y) for y in ys for x in xs)
    for (x, y), look in zip(places, looks, strict=True):
        axes.add_patch(Rectangle((x - width / 2, y - height / 2), width, height, **look))


def draw_level(
    axes: Axes, xs: Any, ys: Any, grid: Array, colour: str, *, level: float = 0.0,
    dashes: Any = "-", width: float = 1.8, rim: float = 0.0
) -> None:  # fmt: skip
    """Draw the line along which a function (y, x) has a level, with a white rim [points]."""
    lines = axes.contour(xs, ys, grid, levels=[level], colors=[colour], linewidths=width)
    lines.set_linestyle(dashes)
    if rim:
        lines.set_path_effects(halo(rim))
