"""Charts of the largest exponent over two numbers of a ball, and diagrams of the section over one.

Each point is a motion from the scene's own start, by the equations, after a transient. By λ₁ over
the later half of its duration it is chaotic; regular, on a cycle or a torus, where λ₁ is the
motion's own 0; or on a straight line, near which all exponents are negative. The half before says
how sure that is: chaos may last for thousands of seconds and end. Between points that are not of
one kind more are put in. A dozen of them, from the least λ₁ to the largest, can be repeated by the
engine, with bodies designed for each.

A diagram has the crossings of g = 0 with g growing, section 5.2. Its motions begin at the scene's
own start, or each where the one before ended, so that an attractor is followed past others.
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
from robotball.dynamics.families import NUMBERS, numbers_of, varied
from robotball.dynamics.long_run import exponents_of
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

# Of a neighbour over half of a motion, its logarithm: below 5 on a torus, in chaos beyond 100 over
# 2000 s; between 10 and 40 are less than one motion in a hundred.
_GROWTH = 20.0
_CHAOTIC, _TRANSIENT = "chaotic", "transient chaos"
_CHUNK = 128  # motions of a cell, some seconds of a core
_LIMIT = 600.0  # s of a cell
_DOZEN = 12  # points that the engine repeats
_REJOINED = 10.0  # s after which two neighbours by the engine are brought together again
_SKIPPED, _FOLLOWED = 3000, 300  # crossings on the way to those of a diagram; with --follow
_KEPT = 100  # crossings of each motion of a diagram
_SAME_CROSSING = 1e-3  # of L/√f and of a radian: crossings as near as that are one
_QUICK = 10  # times fewer points and shorter motions in the quick form
_SAID = (
    "motions: {points}, {minutes:.2g} minutes of processor time. Of the chart {chaotic:.1%} is "
    "chaotic, {straight:.1%} ends on straight lines."
)
_SPREAD = " Half of the chaotic λ₁ have a standard error below {median_error:.1g} 1/s"
_PAPERS = {"fig12": "Fig. 11a", "fig14": "Fig. 11b"}  # the attractors of these scenes

_Axes = Mapping[str, Array]
"""The values (n,) of what is varied, by its name."""


def axes_of(text: str, count: int) -> dict[str, Array]:
    """Return so many values by each name of a text NAME=FROM:TO,…; InputError for another text."""
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
    """Return in `rows` how the motions of a cell go on: λ₁ and its error [1/s], kind and word.

    Of those over one number also the last crossings (L/√f, l [rad]). seconds: of processor time.
    """
    begin, n = time.process_time(), len(cell["points"])
    balls, attitudes, momenta = _motions(cell)
    # Before the exponents, for with --follow they begin where the crossings ended.
    crossed = _crossings(balls, attitudes, momenta, cell) if "follow" in cell else [[]] * n
    found = exponents_of(balls, attitudes, momenta, cell["duration"], cell["transient"])
    spent = (time.process_time() - begin) / n
    # A growth over half of the motion, as its logarithm decides, whatever the duration.
    growths = (found.halves * cell["duration"] / 2).tolist()
    rows = [
        _later("largest", halves)
        | {"motion": word_of(growth, some), "crossings": some, "seconds": spent}
        for halves, growth, some in zip(found.halves, growths, crossed, strict=True)
    ]
    return {"rows": rows}


def _motions(cell: Cell) -> tuple[list[Parameters], Array, Array]:
    """Return balls, attitudes (n, 4) and momenta (n, 3) at a cell's points."""
    ball, (attitude,), (momentum,) = kernel_start(load_scene(cell["scene"]))
    changes = [dict(zip(cell["over"], point, strict=True)) for point in cell["points"]]
    balls, momenta = zip(*(varied(ball, momentum, each) for each in changes), strict=True)
    return [*balls], np.tile(attitude, (len(balls), 1)), np.array(momenta)


def _crossings(
    balls: Sequence[Parameters], attitudes: Array, momenta: Array, cell: Cell
) -> list[list[list[float]]]:
    """Return the last crossings of each motion, and leave where it ended in `attitudes`."""
    crossed, n, skipped = [], len(balls), cell["skipped"]
    # One after the other where each begins at the end of the one before.
    for part in [slice(i, i + 1) for i in range(n)] if cell["follow"] else [slice(n)]:
        found = sections_of(
            balls[part], attitudes[part], momenta[part], skipped + _KEPT, direction=1,
            tolerance=LONG_RUN_TOLERANCE,
        )  # fmt: skip
        ratios = found.L / np.linalg.norm(momenta[part], axis=1, keepdims=True)
        for m, *points in zip(found.found, ratios, found.l, strict=True):
            crossed.append(np.stack(points, axis=1)[skipped:m].tolist())
        # What crosses no more goes on from where it began.
        on = found.status == DONE
        attitudes[part][on] = found.attitudes[on, -1]
        attitudes[part.stop :] = attitudes[part.stop - 1]
    return crossed


def measure_contact(cell: Cell) -> dict[str, Any]:
    """Return in `rows` λ₁ of a cell's only motion by the engine, and by the equations alongside."""
    scene, ((ball,), _, (momentum,)) = load_scene(cell["scene"]), _motions(cell)
    # MuJoCo needs bodies, and a point of the chart is only A, Ω and K.
    designed = redesign(scene, None, Limits(), ball)[1]
    designed = replace(designed, start=replace(scene.start, momentum=momentum))
    # A designed ball has its own principal axes, in which the equations have to start.
    ball, attitudes, momenta = kernel_start(designed)
    skipped, kept = (round(cell[name] / _REJOINED) for name in ("transient", "duration"))
    model = build(designed, settings_of(cell["preset"]))
    turns = partial(rolled, model, _REJOINED)
    found = growth(turns, _REJOINED, skipped, kept, 1, (attitudes, momenta))
    alongside = np.array_split(found.by_equations(ball)[0][0, :, 0], 2)[1].mean() / _REJOINED
    return {"rows": [_later("contact", found.ends().halves[0]) | {"alongside": float(alongside)}]}


def _later(name: str, halves: Array) -> dict[str, Any]:
    """Return the later of two halves (2,) by a name, and its standard error if both are alike."""
    apart = abs(halves[1] - halves[0])
    return {name: float(halves[1]), f"{name}_error": float(apart / math.sqrt(2))}


def refined(
    shape: tuple[int, ...], levels: int, least: float, measured: Callable[[Integers], Array]
) -> Array:
    """Return λ₁ on a grid of one or two dimensions; where not measured, that of the nearest place.

    levels: how often a box of the first grid is divided if its corners differ by more than rounding
    in kind, which changes at ±`least`; measured: gives λ₁ (n,) at places (n, k), NaN where none is.
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
        # A corner without a number makes no border.
        for box in step * np.argwhere(np.ptp(corners, axis=last) > 0) if half else ():
            due[tuple(slice(i, i + step + 1, half) for i in box)] = True
        due, step = due & ~asked, half
    nearest = distance_transform_edt(~asked, return_distances=False, return_indices=True)
    return largest[tuple(nearest)]


def word_of(growths: Sequence[float], crossings: Sequence[Sequence[float]]) -> str:
    """Return how a motion goes on, by the logarithms (2,) of a neighbour's growth in two halves.

    crossings: (n, 2), L/√f and l [rad], where they are known.
    """
    early, late = growths
    if abs(late) > _GROWTH:
        return _CHAOTIC if late > 0 else "straight line"
    if early > _GROWTH:
        return _TRANSIENT
    if not crossings:
        return "regular"
    L, l = np.array(crossings).T
    # l = 0 and 2π are one point of the section.
    points = np.stack([L, np.cos(l), np.sin(l)])
    gaps = (np.abs(points[:, n:] - points[:, :-n]).max() for n in range(1, len(l) // 2 + 1))
    periods = [n for n, gap in enumerate(gaps, start=1) if gap < _SAME_CROSSING]
    return f"cycle of {periods[0]}" if periods else "torus"


def _dozen(rows: Sequence[Row]) -> list[Row]:
    """Return some of the rows, from the least λ₁ to the largest in even steps."""
    left = sorted(rows, key=lambda row: row["largest"])
    # Even in λ₁, not in rank: most points of a chart are regular, and a dozen of them says little.
    steps = np.linspace(left[0]["largest"], left[-1]["largest"], min(_DOZEN, len(left)))
    return [left.pop(np.argmin([abs(row["largest"] - at) for row in left])) for at in steps]


def _columns(axes: _Axes) -> list[Column]:
    """Return the columns of what the engine repeated."""
    columns = [Column(NUMBERS[name][0], name, NUMBERS[name][1], form=".4g") for name in axes]
    for by, key in ((EQUATIONS.name, "largest"), (LABEL.name, "contact")):
        columns += [Column(f"λ₁, {by}", key, "1/s", form=".4f"), Column("±", f"{key}_error")]
    return [*columns, Column("equations alongside", "alongside", "1/s", form=".4f")]


def _blank(scene: Scene, axes: _Axes, part: float) -> tuple[Figure, list[str], dict[str, float]]:
    """Return a figure with its title only, the labels of its axes, and the scene's own numbers."""
    figure = Figure(figsize=(9.0, 7.4), layout="constrained")
    over = " and ".join(NUMBERS[name][0] for name in axes)
    title(figure, f"{scene.name}: {part:.0%} is chaotic over {over}")
    labels = ["{} [{}]".format(*NUMBERS[name]) for name in axes]
    return figure, labels, numbers_of(scene.parameters, scene.start.momentum)


def _draw_chart(
    scene: Scene, axes: _Axes, largest: Array, least: float, repeated: Sequence[Row]
) -> Figure:
    """Draw λ₁ (across, up) in colours, with the borders of chaos and what the engine repeated."""
    known = np.isfinite(largest)
    figure, (across, up), own = _blank(scene, axes, (largest[known] > least).mean())
    panel, (x, y) = figure.subplots(), axes
    # Colour is for chaos alone: what is regular is pale, so that it does not fill the picture.
    colours = colormaps["viridis_r"].with_extremes(under="#E9ECEF")
    # A chart without any chaos has a scale of colours all the same.
    most = max(2 * least, float(np.nanmax(largest)))
    image = panel.pcolormesh(*axes.values(), largest.T, cmap=colours, vmin=least, vmax=most)
    figure.colorbar(image, extend="min", label="λ₁ [1/s]; pale: no chaos")
    draw_level(panel, axes[x], axes[y], largest.T, INK, level=least, width=0.5)
    resting = np.where(largest < -least, 1.0, 0.0).T
    panel.contourf(*axes.values(), resting, levels=[0.5, 1.5], colors="none", hatches=["///"])
    marks: dict[str, Row] = {_PAPERS.get(scene.name, scene.name): own}
    marks |= {f"{i}": row for i, row in enumerate(repeated, start=1)}
    for i, (words, row) in enumerate(marks.items()):
        place = row[x], row[y]
        panel.plot(*place, "s" if i else "*", color=ACCENT, mec="white", ms=5 if i else 15)
        by = (5, -12 if place[1] > axes[y].mean() else 4)  # within the picture
        note(panel, words, place, by, fontsize=9, path_effects=halo(), annotation_clip=True)
    panel.set(xlabel=across, ylabel=up)
    words = "lines: borders of chaos" + "; hatched: ends on straight lines" * bool(resting.any())
    words += "; white: no start" * (not known.all()) + f"; numbers: also by {LABEL.name}" * (i > 0)
    panel.set_title(words, fontsize=9)
    return figure


def _draw_diagram(scene: Scene, axes: _Axes, rows: Sequence[Row], part: float) -> Figure:
    """Draw the crossings' L/√f and l over what is varied, and λ₁ below."""
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
    axes = axes_of(over, (count - 1) * 2**levels + 1)
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
