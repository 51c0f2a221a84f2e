"""The maps as pictures: a panel an integrator and rolling model, one legend for all.

A cell's outcome is told by its grey and its letter, so that no colour is needed.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.precheck import LAWS
from robotball.palette import ACCENT, INK
from robotball.rotations import Array
from validation.output import halo
from validation.studies.extremes.maps import ERROR_TOLERANCE, Map
from validation.studies.extremes.measure import Outcome
from validation.studies.extremes.report import (
    Measured,
    foretold,
    measured_limits,
    missed,
    noticed,
    outcome_of,
)
from validation.sweeps import Result

GREYS = {
    Outcome.ACCURATE: 1.0,
    Outcome.DEGRADED: 0.92,
    Outcome.WRONG: 0.1,
    Outcome.SLIPPED: 0.78,
    Outcome.LOST_CONTACT: 0.68,
    Outcome.OFF_RATE: 0.84,
    Outcome.DIVERGED: 0.5,
    Outcome.REFUSED: 1.0,
    Outcome.UNFINISHED: 1.0,
    Outcome.FAILED: 0.1,
}
PANEL, MARGIN, LINE = 2.45, 0.15, 0.19  # inches; LINE is one of the legend's
GAP = 0.7  # inches between panels, for a title and an axis
TICKS = 4  # at most, on an axis
ACROSS = 3  # panels side by side: their letters are read at a page's width
LINES = [
    (colour, dashes)
    for dashes in ("-", (0, (5, 2)), (0, (1.2, 1.2)), (0, (5, 1.5, 1, 1.5)))
    for colour in (ACCENT, LABEL.colour, INK)
]
SENTENCES = {predict.__name__: law for predict, law in LAWS.items()}


def picture(chosen: Map, results: Sequence[Result]) -> Figure:
    """The panels of a map, rolling models below each other, integrators three in a row."""
    rollings = list(dict.fromkeys(each.cell["rolling"] for each in results))
    integrators = list(dict.fromkeys(each.cell["integrator"] for each in results))
    exceeded = _exceeded(results)
    styles = dict(zip(exceeded, LINES * (1 + len(exceeded) // len(LINES)), strict=False))
    across = min(ACROSS, len(integrators))
    rows = -(-len(integrators) // across)
    figure, panels = _panels(len(rollings) * rows, across, lines=len(exceeded))
    width, height = figure.get_size_inches()
    figure.text(MARGIN / width, 1 - 0.3 / height, chosen.title, size=14, weight="bold")
    figure.text(MARGIN / width, 1 - 0.52 / height, f"held: {chosen.held}", size=9)
    for block, rolling in enumerate(rollings):
        for place in range(rows * across):
            axes = panels[block * rows + place // across, place % across]
            if place >= len(integrators):
                axes.set_axis_off()
                continue
            integrator = integrators[place]
            cells = [
                each
                for each in results
                if (each.cell["rolling"], each.cell["integrator"]) == (rolling, integrator)
            ]
            _panel(axes, cells, styles)
            _label(axes, chosen, cells, integrator)
            axes.set_title(f"{integrator}, {rolling}", size=10)
            if place % across == 0:
                axes.set_ylabel(chosen.y.label, size=9)
            else:
                axes.set_yticklabels([])
    _legend(figure, styles, {each.name: each for each in measured_limits(results)})
    return figure


def _panels(rows: int, columns: int, lines: int) -> tuple[Figure, Any]:
    """A figure of panels (rows, columns) with room below for a legend with so many lines."""
    below = 2.05 + LINE * (lines + bool(lines))
    width, height = max(9.0, PANEL * columns + 1.2), (PANEL + GAP) * rows + 0.75 + below
    figure = Figure(figsize=(width, height))
    panels = figure.subplots(rows, columns, squeeze=False)
    figure.subplots_adjust(
        left=1.05 / width,
        right=1 - MARGIN / width,
        top=1 - 0.85 / height,
        bottom=below / height,
        wspace=0.12,
        hspace=GAP / PANEL,
    )
    return figure, panels


def _values(results: Sequence[Result], key: str) -> list[float]:
    return sorted({each.cell[key] for each in results})


def _exceeded(results: Sequence[Result]) -> list[str]:
    """The limits with cells on both sides in some panel, so that there is a line to draw."""
    sides: dict[tuple[str, ...], set[bool]] = {}
    for each in results:
        panel = (each.cell["rolling"], each.cell["integrator"])
        for name, value in (each.record or {}).get("nearness", {}).items():
            sides.setdefault((name, *panel), set()).add(value is None or value > 1)
    exceeded = {name for (name, *_), both in sides.items() if len(both) == 2}
    return [name for name in SENTENCES if name in exceeded]


def _panel(axes: Axes, results: Sequence[Result], styles: Mapping[str, Any]) -> None:
    xs, ys = _values(results, "x"), _values(results, "y")
    grids = {name: np.full((len(ys), len(xs)), np.nan) for name in styles}
    for each in results:
        i, j = xs.index(each.cell["x"]), ys.index(each.cell["y"])
        _draw_cell(axes, i, j, each)
        for name, value in (each.record or {}).get("nearness", {}).items():
            if name in grids:
                grids[name][j, i] = 1e6 if value is None else np.clip(value, 1e-6, 1e6)
    for name, grid in grids.items():
        _draw_limit(axes, np.log10(grid), *styles[name])
    axes.set_xlim(-0.5, len(xs) - 0.5)
    axes.set_ylim(-0.5, len(ys) - 0.5)


def _draw_cell(axes: Axes, i: int, j: int, result: Result) -> None:
    outcome = outcome_of(result)
    grey = GREYS[outcome]
    ink = "white" if grey < 0.4 else INK
    axes.add_patch(
        Rectangle((i - 0.5, j - 0.5), 1, 1, facecolor=str(grey), edgecolor="0.75", linewidth=0.4)
    )
    axes.text(i, j - 0.08, outcome.sign, color=ink, size=8, ha="center", va="center")
    for told, side in ((foretold(result), -0.32), (noticed(result), 0.32)):
        if told:
            axes.plot(i + side, j + 0.33, ".", color=ink, markersize=2)
    if missed(result):
        axes.plot(i, j, "o", markerfacecolor="none", markeredgecolor=ink, markersize=11)


def _draw_limit(axes: Axes, nearness: Array, colour: str, dashes: Any) -> None:
    if nearness.shape[1] == 1:  # one column, of which a second one is beyond the border
        nearness = np.repeat(nearness, 2, axis=1)
    inside = nearness[np.isfinite(nearness)]
    if min(nearness.shape) < 2 or not len(inside) or not inside.min() < 0 < inside.max():
        return
    rows, columns = (np.array([-0.5, *range(n), n - 0.5]) for n in nearness.shape)
    lines = axes.contour(
        columns,
        rows,
        np.ma.masked_invalid(_to_the_borders(nearness)),
        levels=[0.0],
        colors=[colour],
        linewidths=1.8,
    )
    lines.set_linestyle(dashes)
    lines.set_path_effects(halo(3.2))


def _to_the_borders(grid: Array) -> Array:
    """The grid with one value more on every side, half a cell on by its slope.

    A line that no two cells show is not made by that.
    """
    for _ in range(2):
        ends, slopes = grid[[0, -1]], np.diff(grid, axis=0)[[0, -1]] / 2
        beyond = ends + slopes * [[-1.0], [1.0]]
        beyond = np.where(np.sign(beyond) == np.sign(ends), beyond, ends)
        grid = np.concatenate([beyond[:1], grid, beyond[1:]]).T
    return grid


def _label(axes: Axes, chosen: Map, results: Sequence[Result], integrator: str) -> None:
    for axis, key in ((axes.xaxis, "x"), (axes.yaxis, "y")):
        places, labels = round_ticks(_values(results, key))
        axis.set_ticks(places, labels, size=8.5)
    axes.set_xlabel(chosen.x_of(integrator).label, size=9)


def round_ticks(values: Sequence[float]) -> tuple[list[float], list[str]]:
    """Places among the cells of these values, and labels, at powers of ten: TICKS at most.

    A power need be no cell's own value. Where fewer than two lie in the range, some cells' values.
    """
    least = values[0]
    if least > 0:
        logs = np.log10(values)
        decades = np.arange(np.ceil(logs[0] - 1e-9), np.floor(logs[-1] + 1e-9) + 1)
        decades = decades[:: max(1, -(-len(decades) // TICKS))]
        if len(decades) > 1:
            places = np.interp(decades, logs, np.arange(len(values))).tolist()
            return places, [f"$10^{{{decade:.0f}}}$" for decade in decades]
    cells = range(0, len(values), max(1, -(-(len(values) - 1) // (TICKS - 1))))
    return [float(cell) for cell in cells], [f"{values[cell]:.2g}" for cell in cells]


def _sentence(limit: Measured) -> str:
    """The prediction, and what it has come to."""
    words = f"{SENTENCES[limit.name]}; kept to {limit.kept:.2g}"
    return words if limit.broken is None else f"{words}, broken from {limit.broken:.2g} of it"


def _legend(
    figure: Figure,
    styles: Mapping[str, Any],
    measured: Mapping[str, Measured],
) -> None:
    """What the cells mean, then what the dots and the lines do."""
    outcomes = [
        Patch(
            facecolor=str(GREYS[each]),
            edgecolor="0.5",
            label=f"{each.sign or ' '}   {each.sentence}",
        )
        for each in Outcome
    ]
    marks = [
        Line2D([], [], color=INK, marker=".", linestyle="", label=label)
        for label in ("left dot: warned of before the run", "right dot: noticed during the run")
    ]
    marks.append(
        Line2D([], [], markeredgecolor=INK, markerfacecolor="none", marker="o", linestyle="",
               label="circle: wrong, and neither")
    )  # fmt: skip
    limits = [
        Line2D([], [], color=colour, linestyle=dashes, linewidth=1.8, label=label)
        for (colour, dashes), label in zip(
            styles.values(), (_sentence(measured[name]) for name in styles), strict=True
        )
    ]
    width, height = figure.get_size_inches()
    x = MARGIN / width
    common: dict[str, Any] = {
        "loc": "lower left",
        "frameon": False,
        "fontsize": 8,
        "borderaxespad": 0.0,
    }
    above = 0.1
    if limits:
        title = (
            f"lines: limits predicted for an error of {ERROR_TOLERANCE:g}, and what was measured"
        )
        figure.legend(
            handles=limits,
            bbox_to_anchor=(x, 0.06 / height),
            title=title,
            title_fontsize=8,
            alignment="left",
            **common,
        )
        above = 0.35 + LINE * len(limits)
    figure.legend(
        handles=[*outcomes, *marks],
        ncols=2,
        bbox_to_anchor=(x, above / height),
        columnspacing=1.5,
        **common,
    )
