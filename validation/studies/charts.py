"""Charts of the largest exponent over two numbers of a ball.

Each point is a motion of the equations from the scene's start, after a transient. λ₁ in the second
half of the duration classifies the motion: it is chaotic (λ₁ > 0), regular on a cycle or a torus
(λ₁ = 0), or ends on a straight line (negative exponents). The first half shows transient chaos,
which may last for thousands of seconds. The grid is refined between points of different kinds.
"""

import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from rich.markup import escape
from scipy.ndimage import distance_transform_edt

from robotball import InputError, Scene, load_scene
from robotball.dynamics.long_run import exponents_of
from robotball.dynamics.motion_branches import NUMBERS, numbers_of, varied
from robotball.errors import check_count, check_positive, unknown
from robotball.robot.formulas import Parameters
from robotball.robot.looks import ACCENT, INK
from robotball.rotations import Array
from robotball.theory.ensembles.orbits import Integers, kernel_start

from ..options import Sweep, span_of
from ..output import title
from ..study import Study, scene_cell
from ..sweeps import Cell
from .contact_sections import moving_scene

# Logarithm of a neighbour's growth over half of a motion. Measured: below 5 on a torus, above 100
# in chaos over 2000 s, and between 10 and 40 in fewer than 1 % of the motions.
_GROWTH = 20.0
_CHAOTIC, _TRANSIENT = "chaotic", "transient chaos"
_CHUNK = 128  # motions per cell, a few seconds of a core
_LIMIT = 600.0  # s, time limit of a cell
_QUICK = 10  # divides the number of points and the duration in the quick form
_SAID = (
    "motions: {points}, {minutes:.2g} minutes of processor time. {chaotic:.1%} of the chart is "
    "chaotic, {straight:.1%} ends on straight lines."
)
_CHART_LEGEND = "star: the scene; lines: borders of chaos; hatched: ends on straight lines"
_SPREAD = " Half of the chaotic λ₁ have a standard error below {median_error:.1g} 1/s"

_Axes = Mapping[str, Array]
"""The values (n,) of each varied number, by name."""


def _axes_of(text: str, count: int) -> dict[str, Array]:
    """Parse NAME=FROM:TO,… into `count` values per name. Raises InputError if malformed."""
    axes = {}
    for part in text.split(","):
        name, low, high = span_of(part)
        if name not in NUMBERS:
            raise unknown("number", name, NUMBERS)
        axes[name] = np.linspace(low, high, count)
    if text.count(",") != 1 or len(axes) != 2:
        raise InputError(f"--over takes two ranges with different names, not {text!r}")
    return axes


def measure(cell: Cell) -> dict[str, Any]:
    """Measure λ₁ and its error [1/s], the kind, and the processor time [s] of a cell's motions."""
    begin, n = time.process_time(), len(cell["points"])
    balls, attitudes, momenta = _motions(cell)
    halves = exponents_of(balls, attitudes, momenta, cell["duration"], cell["transient"]).halves
    spent = (time.process_time() - begin) / n
    growths = (halves * cell["duration"] / 2).tolist()
    errors = np.abs(halves[:, 1] - halves[:, 0]) / math.sqrt(2)
    rows = [
        {"largest": float(late), "largest_error": float(error)}
        | {"motion": _kind_of(*growth), "seconds": spent}
        for (_, late), error, growth in zip(halves, errors, growths, strict=True)
    ]
    return {"rows": rows}


def _motions(cell: Cell) -> tuple[list[Parameters], Array, Array]:
    """Return balls, attitudes (n, 4) and momenta (n, 3) at the points of a cell."""
    ball, (attitude,), (momentum,) = kernel_start(load_scene(cell["scene"]))
    changes = [dict(zip(cell["over"], point, strict=True)) for point in cell["points"]]
    balls, momenta = zip(*(varied(ball, momentum, numbers) for numbers in changes), strict=True)
    return [*balls], np.tile(attitude, (len(balls), 1)), np.array(momenta)


def refined(
    shape: tuple[int, ...], levels: int, least: float, measured: Callable[[Integers], Array]
) -> Array:
    """Return λ₁ on a grid, filled from the nearest measured places.

    Parameters
    ----------
    shape : tuple of int
        The size of the finest grid.
    levels : int
        How often a box is divided if its corners differ in kind.
    least : float, 1/s
        The kind changes at ±`least`.
    measured : callable
        Returns λ₁ (n,) at places (n, k), NaN if there is no motion.
    """
    step, last = 2**levels, tuple(range(-len(shape), 0))
    largest, asked, due = np.full(shape, np.nan), np.zeros(shape, bool), np.zeros(shape, bool)
    due[tuple(slice(None, None, step) for _ in shape)] = True
    while due.any():
        largest[due] = measured(np.argwhere(due))
        asked, due, half = asked | due, np.zeros(shape, bool), step // 2
        grid = largest[tuple(slice(None, None, step) for _ in shape)]
        kinds = np.sign(grid) * (np.abs(grid) > least)
        corners = np.lib.stride_tricks.sliding_window_view(kinds, (2,) * len(shape))
        # A comparison with NaN is false, so a missing corner adds no border.
        for box in step * np.argwhere(np.ptp(corners, axis=last) > 0) if half else ():
            due[tuple(slice(i, i + step + 1, half) for i in box)] = True
        due, step = due & ~asked, half
    nearest = distance_transform_edt(~asked, return_distances=False, return_indices=True)
    return largest[tuple(nearest)]


def _kind_of(early: float, late: float) -> str:
    """Return the kind of a motion from the logarithmic growth of a neighbour in its two halves."""
    if abs(late) > _GROWTH:
        return _CHAOTIC if late > 0 else "straight line"
    return _TRANSIENT if early > _GROWTH else "regular"


def _draw_chart(scene: Scene, axes: _Axes, largest: Array, least: float) -> Figure:
    """Draw λ₁ (across, up) in colours, with the borders of chaos and the scene's point."""
    part = (largest[np.isfinite(largest)] > least).mean()
    figure = Figure(figsize=(9.0, 7.4), layout="constrained")
    over = " and ".join(NUMBERS[name][0] for name in axes)
    title(figure, f"{scene.name}: {part:.0%} is chaotic over {over}")
    panel, places = figure.subplots(), [*axes.values()]
    # Only chaos has colour; regular motion is pale.
    colours = colormaps["viridis_r"].with_extremes(under="#E9ECEF")
    # Without chaos the colour scale still needs a positive range.
    most = max(2 * least, float(np.nanmax(largest)))
    image = panel.pcolormesh(*places, largest.T, cmap=colours, vmin=least, vmax=most)
    figure.colorbar(image, extend="min", label="λ₁ [1/s]; pale: no chaos")
    panel.contour(*places, largest.T, levels=[least], colors=[INK], linewidths=0.5)
    resting = np.where(largest < -least, 1.0, 0.0).T
    panel.contourf(*places, resting, levels=[0.5, 1.5], colors="none", hatches=["///"])
    own = numbers_of(scene.parameters, scene.start.momentum)
    panel.plot(*(own[name] for name in axes), "*", color=ACCENT, mec="white", ms=15)
    across, up = ("{} [{}]".format(*NUMBERS[name]) for name in axes)
    panel.set(xlabel=across, ylabel=up, title=_CHART_LEGEND)
    return figure


def chart_study(
    name: str, over: str, sweep: Sweep, points: int, refine: int, duration: float, transient: float
) -> Study:
    """Measure and draw a chart."""
    scene, less = moving_scene(name, "a chart"), _QUICK if sweep.quick else 1
    levels = check_count("refine", refine, 0)
    count = max(3, check_count("points", points, 3) // less)
    axes = _axes_of(over, (count - 1) * 2**levels + 1)
    check_positive("duration", duration, "s")
    check_positive("transient", transient, "s")
    ball, _, (momentum,) = kernel_start(scene)
    # Refuse impossible numbers before the work; this f allows any c.
    varied(ball, momentum, {axis: max(axes[axis], key=abs) for axis in axes} | {"f": 1e99})
    own = numbers_of(ball, momentum)
    shared = scene_cell(name, duration / less)
    shared |= {"transient": transient / less, "over": [*axes]}
    rows: dict[tuple[float, ...], dict[str, Any]] = {}
    failures: list[str] = []

    def measured(places: Integers) -> Array:
        points = np.stack([axes[n][i] for n, i in zip(axes, places.T, strict=True)], axis=1)
        level = own | dict(zip(axes, points.T, strict=True))
        # The part c along γ of a vector of length √f cannot be longer than √f.
        some = np.broadcast_to(level["f"] > np.square(level["c"]), len(points))
        if not some.any():  # raises the reason
            varied(ball, momentum, dict(zip(axes, points[-1], strict=True)))
        todo = points[some].tolist()
        cells = [{**shared, "points": todo[i : i + _CHUNK]} for i in range(0, len(todo), _CHUNK)]
        for result in sweep.results(measure, cells, f"{Path(name).stem}-chart", _LIMIT):
            if result.record is None:
                failures.append(str(result.failure))
                continue
            for point, row in zip(result.cell["points"], result.record["rows"], strict=True):
                rows[(*point,)] = dict(zip(axes, point, strict=True)) | row
        there = [rows.get((*point,)) for point in points]
        return np.array([row["largest"] if row else math.nan for row in there])

    least = 2 * _GROWTH / shared["duration"]
    largest = refined(tuple(map(len, axes.values())), levels, least, measured)
    if not rows:
        raise InputError(f"over {over} no motion could be integrated: {failures[0]}")
    found = [rows[point] for point in sorted(rows)]
    some = largest[np.isfinite(largest)]
    # The two halves of a regular motion do not differ.
    errors = [row["largest_error"] for row in found if row["motion"] == _CHAOTIC]
    record = {
        "scene": scene.name,
        **shared,
        "size": largest.shape,
        "points": len(rows),
        "chaotic": float((some > least).mean()),
        "straight": float((some < -least).mean()),
        "transient_chaos": sum(row["motion"] == _TRANSIENT for row in found) / len(found),
        "median_error": float(np.median(errors or [0.0])),
        "minutes": sum(row.pop("seconds") for row in found) / 60,
    }
    shown = [(_SAID + _SPREAD * bool(errors)).format(**record)]
    if failures:
        shown.append(escape(f"cells without a result: {len(failures)}; {failures[0]}"))
    picture = _draw_chart(scene, axes, largest, least)
    return Study(scene.name, None, ["chart"], found, record, shown, picture)
