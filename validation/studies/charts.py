"""Charts of the largest exponent over two numbers of a ball, and diagrams of the section over one.

Each point of a chart is a motion of the equations from the scene's start after a transient. λ₁
over the second half of its duration classifies the motion: chaotic; regular, on a cycle or a torus,
with λ₁ = 0; or ending on a straight line, with negative exponents only. The first half shows
transient chaos, which may last thousands of seconds. Between points of different kinds the grid is
refined. An engine can repeat a dozen points, from the least λ₁ to the largest, with bodies designed
for each.

A diagram shows the crossings of g = 0 with growing g (section 5.2). Its motions begin at the
scene's start, or each at the end of the previous motion, to follow an attractor past others.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from rich.markup import escape
from rich.table import Table
from scipy.ndimage import distance_transform_edt

from robotball import InputError, Limits, Scene, load_scene
from robotball import preset as settings_of
from robotball.design.designing import redesign
from robotball.dynamics.long_run import exponents_of
from robotball.dynamics.motion_branches import NUMBERS, numbers_of, varied
from robotball.dynamics.sections import sections_of
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import build
from robotball.errors import check_count, check_positive, unknown
from robotball.robot.formulas import Parameters
from robotball.robot.looks import ACCENT, FAINT, INK
from robotball.rotations import Array
from robotball.theory.ensembles.orbits import DONE, LONG_RUN_TOLERANCE, Integers, kernel_start
from robotball.theory.reduced import LABEL as EQUATIONS

from ..options import Sweep, span_of
from ..output import halo, title
from ..plots import note
from ..study import Column, Row, Study, scene_cell, table_of
from ..sweeps import Cell, Work
from .contact_sections import moving_scene
from .contact_tangent import growth, rolled
from .maps import draw_level

# Logarithm of a neighbour's growth over half of a motion. Measured: below 5 on a torus, above 100
# in chaos over 2000 s, and between 10 and 40 in fewer than 1 % of the motions.
_GROWTH = 20.0
_CHAOTIC, _TRANSIENT = "chaotic", "transient chaos"
_CHUNK = 128  # motions per cell, a few seconds of a core
_LIMIT = 600.0  # s, time limit of a cell
_DOZEN = 12  # points that the engine repeats
_REJOINED = 10.0  # s after which neighbouring motions of the engine are rescaled
_SKIPPED, _FOLLOWED = 3000, 300  # crossings before the diagram's, normally and with --follow
_KEPT = 100  # crossings of each motion in a diagram
_SAME_CROSSING = 1e-3  # in L/√f and in rad; closer crossings are the same
_QUICK = 10  # divides the number of points and the duration in the quick form
_SAID = (
    "motions: {points}, {minutes:.2g} minutes of processor time. {chaotic:.1%} of the chart is "
    "chaotic, {straight:.1%} ends on straight lines."
)
_SPREAD = " Half of the chaotic λ₁ have a standard error below {median_error:.1g} 1/s"
_PAPERS = {"fig12": "Fig. 11a", "fig14": "Fig. 11b"}  # figures of the paper

_Axes = Mapping[str, Array]
"""The values (n,) of each varied number, by name."""


def _axes_of(text: str, count: int) -> dict[str, Array]:
    """Parse NAME=FROM:TO,… into `count` values per name. Raises InputError if malformed."""
    axes = {}
    for part in text.split(","):
        # Either order of the two numbers: --follow goes along them.
        name, low, high = span_of(part)
        if name not in NUMBERS:
            raise unknown("number", name, NUMBERS)
        axes[name] = np.linspace(low, high, count)
    if text.count(",") >= len(axes) or len(axes) > 2:
        raise InputError(f"--over takes one or two different names, not {text!r}")
    return axes


def measure(cell: Cell) -> dict[str, Any]:
    """Measure the motions of a cell: λ₁ and its error [1/s], and the kind of motion.

    For diagrams also the last crossings (L/√f, l [rad]). `seconds` is processor time.
    """
    begin, n = time.process_time(), len(cell["points"])
    balls, attitudes, momenta = _motions(cell)
    # With --follow the exponents begin at the end of the crossings.
    crossed = _crossings(balls, attitudes, momenta, cell) if "follow" in cell else [[]] * n
    halves = exponents_of(balls, attitudes, momenta, cell["duration"], cell["transient"]).halves
    spent = (time.process_time() - begin) / n
    growths = (halves * cell["duration"] / 2).tolist()
    rows = [
        _later("largest", pair)
        | {"motion": word_of(growth, points), "crossings": points, "seconds": spent}
        for pair, growth, points in zip(halves, growths, crossed, strict=True)
    ]
    return {"rows": rows}


def _motions(cell: Cell) -> tuple[list[Parameters], Array, Array]:
    """Return balls, attitudes (n, 4) and momenta (n, 3) at the points of a cell."""
    ball, (attitude,), (momentum,) = kernel_start(load_scene(cell["scene"]))
    changes = [dict(zip(cell["over"], point, strict=True)) for point in cell["points"]]
    balls, momenta = zip(*(varied(ball, momentum, numbers) for numbers in changes), strict=True)
    return [*balls], np.tile(attitude, (len(balls), 1)), np.array(momenta)


def _crossings(
    balls: Sequence[Parameters], attitudes: Array, momenta: Array, cell: Cell
) -> list[list[list[float]]]:
    """Return the last crossings of each motion, and set `attitudes` to the ends of the motions."""
    crossed, n, skipped = [], len(balls), cell["skipped"]
    options: Any = {"direction": 1, "tolerance": LONG_RUN_TOLERANCE}
    for part in [slice(i, i + 1) for i in range(n)] if cell["follow"] else [slice(n)]:
        run = sections_of(balls[part], attitudes[part], momenta[part], skipped + _KEPT, **options)
        ratios = run.L / np.linalg.norm(momenta[part], axis=1, keepdims=True)
        for m, *points in zip(run.found, ratios, run.l, strict=True):
            crossed.append(np.stack(points, axis=1)[skipped:m].tolist())
        # A motion that stops crossing continues from its start.
        done = run.status == DONE
        attitudes[part][done] = run.attitudes[done, -1]
        attitudes[part.stop :] = attitudes[part.stop - 1]
    return crossed


def measure_contact(cell: Cell) -> dict[str, Any]:
    """Measure λ₁ of a cell's single motion with the engine, and with the equations alongside."""
    scene, ((ball,), _, (momentum,)) = load_scene(cell["scene"]), _motions(cell)
    # A point of the chart has A, Ω and K; MuJoCo needs bodies with these numbers.
    designed = redesign(scene, None, Limits(), ball)[1]
    designed = replace(designed, start=replace(scene.start, momentum=momentum))
    # The equations start in the principal axes of the designed ball.
    ball, attitudes, momenta = kernel_start(designed)
    skipped, kept = (round(cell[name] / _REJOINED) for name in ("transient", "duration"))
    model = build(designed, settings_of(cell["preset"]))
    turns = partial(rolled, model, _REJOINED)
    found = growth(turns, _REJOINED, skipped, kept, 1, (attitudes, momenta))
    alongside = np.array_split(found.by_equations(ball)[0][0, :, 0], 2)[1].mean() / _REJOINED
    return {"rows": [_later("contact", found.ends().halves[0]) | {"alongside": float(alongside)}]}


def _later(name: str, halves: Array) -> dict[str, Any]:
    """Return the second of two halves (2,) under a name, and its standard error."""
    apart = abs(halves[1] - halves[0])
    return {name: float(halves[1]), f"{name}_error": float(apart / math.sqrt(2))}


def refined(
    shape: tuple[int, ...], levels: int, least: float, measured: Callable[[Integers], Array]
) -> Array:
    """Return λ₁ on a grid of one or two dimensions, filled from the nearest measured places.

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


def word_of(growths: Sequence[float], crossings: Sequence[Sequence[float]]) -> str:
    """Return the kind of a motion from the logarithmic growth of a neighbour in its two halves.

    `crossings` (n, 2) has L/√f and l [rad], or is empty.
    """
    early, late = growths
    if abs(late) > _GROWTH:
        return _CHAOTIC if late > 0 else "straight line"
    if early > _GROWTH:
        return _TRANSIENT
    if not crossings:
        return "regular"
    L, l = np.array(crossings).T
    # l = 0 and 2π are the same point.
    points = np.stack([L, np.cos(l), np.sin(l)])
    gaps = (np.abs(points[:, n:] - points[:, :-n]).max() for n in range(1, len(l) // 2 + 1))
    periods = [n for n, gap in enumerate(gaps, start=1) if gap < _SAME_CROSSING]
    return f"cycle of {periods[0]}" if periods else "torus"


def _dozen(rows: Sequence[Row]) -> list[Row]:
    """Return a dozen rows, equally spaced in λ₁."""
    left = sorted(rows, key=lambda row: row["largest"])
    # Equal spacing in rank would select regular points mostly.
    steps = np.linspace(left[0]["largest"], left[-1]["largest"], min(_DOZEN, len(left)))
    return [left.pop(np.argmin([abs(row["largest"] - at) for row in left])) for at in steps]


def _columns(axes: _Axes) -> list[Column]:
    """Return the columns of the table of repeated points."""
    columns = [Column(NUMBERS[name][0], name, NUMBERS[name][1], form=".4g") for name in axes]
    for source, key in ((EQUATIONS.name, "largest"), (LABEL.name, "contact")):
        columns += [Column(f"λ₁, {source}", key, "1/s", form=".4f"), Column("±", f"{key}_error")]
    return [*columns, Column("equations alongside", "alongside", "1/s", form=".4f")]


def _blank(scene: Scene, axes: _Axes, part: float) -> tuple[Figure, list[str], dict[str, float]]:
    """Return a figure with a title, the labels of its axes, and the numbers of the scene."""
    figure = Figure(figsize=(9.0, 7.4), layout="constrained")
    over = " and ".join(NUMBERS[name][0] for name in axes)
    title(figure, f"{scene.name}: {part:.0%} is chaotic over {over}")
    labels = ["{} [{}]".format(*NUMBERS[name]) for name in axes]
    return figure, labels, numbers_of(scene.parameters, scene.start.momentum)


def _draw_chart(
    scene: Scene, axes: _Axes, largest: Array, least: float, repeated: Sequence[Row]
) -> Figure:
    """Draw λ₁ (across, up) in colours, with the borders of chaos and the repeated points."""
    known = np.isfinite(largest)
    figure, (across, up), own = _blank(scene, axes, (largest[known] > least).mean())
    panel, (x, y) = figure.subplots(), axes
    # Only chaos has colour; regular motion is pale.
    colours = colormaps["viridis_r"].with_extremes(under="#E9ECEF")
    # Without chaos the colour scale still needs a positive range.
    most = max(2 * least, float(np.nanmax(largest)))
    image = panel.pcolormesh(*axes.values(), largest.T, cmap=colours, vmin=least, vmax=most)
    figure.colorbar(image, extend="min", label="λ₁ [1/s]; pale: no chaos")
    draw_level(panel, axes[x], axes[y], largest.T, INK, level=least, width=0.5)
    resting = np.where(largest < -least, 1.0, 0.0).T
    panel.contourf(*axes.values(), resting, levels=[0.5, 1.5], colors="none", hatches=["///"])
    marks: dict[str, Row] = {_PAPERS.get(scene.name, scene.name): own}
    marks |= {f"{i}": row for i, row in enumerate(repeated, start=1)}
    for i, (label, row) in enumerate(marks.items()):
        place = row[x], row[y]
        panel.plot(*place, "s" if i else "*", color=ACCENT, mec="white", ms=5 if i else 15)
        offset = (5, -12 if place[1] > axes[y].mean() else 4)  # keep the label inside the picture
        note(panel, label, place, offset, fontsize=9, path_effects=halo(), annotation_clip=True)
    panel.set(xlabel=across, ylabel=up)
    legend = {
        "lines: borders of chaos": True,
        "hatched: ends on straight lines": resting.any(),
        "white: no start": not known.all(),
        f"numbers: repeated with {LABEL.name}": len(repeated) > 0,
    }
    panel.set_title("; ".join(text for text, shown in legend.items() if shown), fontsize=9)
    return figure


def _draw_diagram(scene: Scene, axes: _Axes, rows: Sequence[Row], part: float) -> Figure:
    """Draw L/√f and l of the crossings over the varied number, and λ₁ below."""
    figure, (across,), own = _blank(scene, axes, part)
    (name,) = axes
    dots = np.array([(row[name], *at) for row in rows for at in row["crossings"]]).reshape(-1, 3)
    above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=(3, 3, 2))
    style: Any = {"color": INK, "markersize": 1.2, "markeredgewidth": 0}
    above.plot(dots[:, 0], dots[:, 1], "o", **style)
    middle.plot(dots[:, 0], dots[:, 2] % (2 * np.pi), "o", **style)
    below.plot([row[name] for row in rows], [row["largest"] for row in rows], color=INK)
    for panel, label in ((above, "L/√f"), (middle, "l [rad]"), (below, "λ₁ [1/s]")):
        panel.set_ylabel(label)
        panel.axvline(own[name], color=ACCENT, linestyle="--", linewidth=1)
    below.axhline(0.0, color=FAINT)
    below.set(xlabel=across, xlim=(axes[name].min(), axes[name].max()))
    above.set_title(f"dashed: {_PAPERS.get(scene.name, scene.name)}", fontsize=9)
    figure.align_ylabels()
    return figure


def chart_study(
    name: str,
    over: str,
    sweep: Sweep,
    points: int,
    refine: int,
    follow: bool,
    duration: float,
    transient: float,
    preset: str | None,
) -> Study:
    """Measure and draw a chart or a diagram."""
    scene, less = moving_scene(name, "a chart"), _QUICK if sweep.quick else 1
    # A point put in between would have no motion before it from which to go on.
    levels = 0 if follow else check_count("refine", refine, 0)
    count = max(3, check_count("points", points, 3) // less)
    axes = _axes_of(over, (count - 1) * 2**levels + 1)
    if follow and len(axes) > 1:
        raise InputError("--follow goes along one number: give one to --over")
    check_positive("duration", duration, "s")
    check_positive("transient", transient, "s")
    settings = None if preset is None else settings_of(preset).name
    ball, _, (momentum,) = kernel_start(scene)
    # Refused before the work; with an f that allows any c.
    varied(ball, momentum, {axis: max(axes[axis], key=abs) for axis in axes} | {"f": 1e99})
    own = numbers_of(ball, momentum)
    shared = scene_cell(name, duration / less)
    shared |= {"transient": transient / less, "over": [*axes]}
    if len(axes) == 1:
        skipped = _FOLLOWED if follow else _SKIPPED
        shared |= {"follow": follow, "skipped": skipped // less}
    rows: dict[tuple[float, ...], dict[str, Any]] = {}
    failures: list[str] = []
    rows_at = partial(_rows_at, sweep, Path(name).stem, failures)

    def measured(places: Integers) -> Array:
        points = np.stack([axes[n][i] for n, i in zip(axes, places.T, strict=True)], axis=1)
        level = own | dict(zip(axes, points.T, strict=True))
        # No vector of length √f has a part c along γ that is longer than itself.
        some = np.broadcast_to(level["f"] > np.square(level["c"]), len(points))
        if not some.any():  # of this one too the reason is said
            varied(ball, momentum, dict(zip(axes, points[-1], strict=True)))
        # Followed motions need each other's ends, in order, so they are one cell.
        size = len(points) if follow else _CHUNK
        rows.update(rows_at(measure, shared, points[some].tolist(), size))
        there = [rows.get((*point,)) for point in points]
        return np.array([row["largest"] if row else math.nan for row in there])

    least = 2 * _GROWTH / shared["duration"]
    largest = refined(tuple(map(len, axes.values())), levels, least, measured)
    if not rows:
        raise InputError(f"over {over} no motion could be followed: {failures[0]}")
    found = [rows[point] for point in sorted(rows)]
    some = largest[np.isfinite(largest)]
    # A regular motion's λ₁ is its own 0, of which the two halves show no spread.
    errors = [row["largest_error"] for row in found if row["motion"] == _CHAOTIC]
    record = {
        "scene": scene.name, **shared, "size": largest.shape, "points": len(rows),
        "chaotic": float((some > least).mean()), "straight": float((some < -least).mean()),
        "transient_chaos": sum(row["motion"] == _TRANSIENT for row in found) / len(found),
        "median_error": float(np.median(errors or [0.0])),
        "minutes": sum(row.pop("seconds") for row in found) / 60,
    }  # fmt: skip
    shown: list[Table | str] = [(_SAID + _SPREAD * bool(errors)).format(**record)]
    repeated: list[Row] = []
    if settings is not None:
        dozen = {tuple(row[axis] for axis in axes): row for row in _dozen(found)}
        shared["preset"] = settings
        engine = rows_at(measure_contact, shared, [*dozen], 1)
        repeated = [{**dozen[point], **row} for point, row in engine.items()]
        shown.append(table_of(_columns(axes), repeated))
    if failures:
        shown.append(escape(f"cells without a result: {len(failures)}; {failures[0]}"))
    if len(axes) == 1:
        picture = _draw_diagram(scene, axes, found, record["chaotic"])
    else:
        picture = _draw_chart(scene, axes, largest, least, repeated)
    # A line of the file for each crossing, and one for a motion without.
    lines = [{**row, "L/√f": L, "l": l} for row in found
             for L, l in row.pop("crossings") or [(None, None)]]  # fmt: skip
    record["repeated"] = repeated
    return Study(scene.name, None, ["chart"], lines, record, shown, picture)


def _rows_at(
    sweep: Sweep,
    scene: str,
    failures: list[str],
    work: Work,
    shared: Cell,
    points: Sequence[Sequence[float]],
    size: int,
) -> dict[tuple[float, ...], dict[str, Any]]:
    """Return the rows that work makes of points (n, k), so many in a cell, by their points.

    Of a cell without a result the reason is added to `failures`.
    """
    cells = [{**shared, "points": points[i : i + size]} for i in range(0, len(points), size)]
    journal = f"{scene}-{work.__name__.replace('measure', 'chart')}"
    results = sweep.results(work, cells, journal, _LIMIT)
    failures += [each.failure for each in results if each.failure]
    return {
        tuple(point): dict(zip(shared["over"], point, strict=True)) | row
        for each in results
        if each.record
        for point, row in zip(each.cell["points"], each.record["rows"], strict=True)
    }
