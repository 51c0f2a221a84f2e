"""Draw the pictures of a scene's agreements: paths, their distance, and the error of M.

Importing Matplotlib takes longer than comparing a short motion. So other processes import it and
draw, unless this process has imported it. A Sheet has the numbers of a picture and can be pickled.
"""

import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robotball.processes import in_processes, prepare

from .output import in_picture, title, write_picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from robotball.view.tracks import LineStyle

    from .agreement import Agreement

# Importing this type from robotball.rotations would load SciPy into processes that only draw.
_Array = NDArray[np.float64]

_MATPLOTLIB = "matplotlib.backends.backend_agg"  # loads all parts that a PNG needs
MANY = 4  # scenes from which on they are compared, and drawn, in several processes
_MOST = 50_000  # points of a line, a dozen for each column of pixels
# A relative error below the rounding of 1 has no meaning, and 0 has no logarithm.
LEAST = 1e-17
# Inches: the width of a picture, the left and right ends of its panels, the height of an error
# panel, and the space above, for a row of names, and below each panel.
_WIDTH, _LEFT, _RIGHT, _HIGH, _ABOVE, _ROW, _BELOW = 8.0, 1.1, 7.6, 2.7, 0.8, 0.21, 0.75


def prepare_drawing(scenes: int) -> None:
    """Start importing Matplotlib in other processes, for a later `draw`."""
    if scenes < MANY and _MATPLOTLIB not in sys.modules:
        with suppress(OSError):  # then this process draws
            prepare(__name__, _MATPLOTLIB)


def draw(agreements: Sequence["Agreement"], out: Path) -> list[Path]:
    """Write two PNGs of a scene's agreements with an engine, and return their paths."""
    from .results import file_stem

    name, sheet = file_stem(agreements), sheet_of(agreements)
    drawings = [(kind, sheet, out / f"{name}-{kind}.png") for kind in PICTURES]
    if _MATPLOTLIB not in sys.modules:
        with suppress(OSError):  # no process could start, or one was killed
            return list(in_processes(_write, drawings))
    return [_write(drawing) for drawing in drawings]


def _write(drawing: tuple[str, "_Sheet", Path]) -> Path:
    kind, sheet, path = drawing
    return write_picture(path, PICTURES[kind](sheet))


def in_view(own: _Array, every: _Array, reach: float) -> tuple[float, float]:
    """Return the ends of an axis that shows all of `own` (n,), and `every` (m,) within reach.

    The last samples of a broken run may have any value and leave the picture.
    """
    own, every = own[np.isfinite(own)], every[np.isfinite(every)]
    low, high = (float(own.min()), float(own.max())) if len(own) else (0.0, 0.0)
    return max(low - reach, every.min(initial=low)), min(high + reach, every.max(initial=high))


def framed(agreements: Sequence["Agreement"]) -> _Array:
    """Return the ends (2, 2) of the axes X and Y [m] of a picture of the paths, to one scale.

    The picture is 0.2 to 0.7 times as high as wide, and wider than rounding errors.
    """
    own, radius = agreements[0].theory.contact_point, agreements[0].scene.ball.radius
    every = np.concatenate([own, *(run.motion.contact_point for run in agreements)])
    # Show runs that are off by up to the extent of the reference path.
    reach = max(float(np.ptp(own, axis=0).max()), radius)
    ends = np.array([in_view(own[:, i], every[:, i], reach) for i in (0, 1)])
    across, up = 1.1 * np.ptp(ends, axis=1)
    across = max(across, up / 0.7, 0.1 * radius)
    half = np.array([across, max(up, 0.2 * across)]) / 2
    return np.column_stack([ends.mean(axis=1) - half, ends.mean(axis=1) + half])


@dataclass(frozen=True)
class _Line:
    """A motion in a picture.

    Attributes
    ----------
    look : Look
        The style.
    contact_point : (n, 2), m
        The path.
    errors : sequence of pairs of (n,)
        Times [s] and values of the path error [m] and of the relative momentum error, without the
        start, where they are 0.
    finished : bool
        Whether the run reached the end.
    """

    look: "LineStyle"
    contact_point: _Array
    errors: Sequence[tuple[_Array, _Array]] = ()
    finished: bool = True


@dataclass(frozen=True)
class _Sheet:
    """The contents of a scene's pictures.

    Attributes
    ----------
    title : str
        The title.
    lines : sequence of _Line
        The motions, the reference first.
    slip_paths : sequence of (k, 2), m
        The parts of the reference's path on which the ball slips.
    slips : sequence of (float, float), s
        The intervals in which the ball slips.
    momentum : str
        A text with M if it is constant.
    momentum_scale, path_scale : float
        The units of the errors [kg m²/s, m].
    frame : (2, 2), m
        The ends of the axes X and Y.
    """

    title: str
    lines: Sequence[_Line]
    slip_paths: Sequence[_Array]
    slips: Sequence[tuple[float, float]]
    momentum: str
    momentum_scale: float
    path_scale: float
    frame: _Array


def sheet_of(agreements: Sequence["Agreement"]) -> _Sheet:
    """Return the sheet of a scene's agreements with an engine."""
    from robotball.view.tracks import line_looks, slip_parts, slips_of

    theory = agreements[0].theory
    scene = theory.scene
    own, *looks = line_looks([theory, *(run.motion for run in agreements)])
    vector = ", ".join(f"{component:.3g}" for component in theory.momentum[0].round(12) + 0.0)
    path, slips = _thinned(theory.contact_point), slips_of(theory)
    return _Sheet(
        title=f"{scene.name}: {scene.title}",
        lines=[_Line(own, path), *map(_line, looks, agreements)],
        slip_paths=[path[part] for part in slip_parts(slips, _thinned(theory.times))],
        slips=slips,
        momentum=f"M = ({vector}) kg m²/s is constant" if scene.keeps_momentum else "momentum M",
        momentum_scale=scene.momentum_scale,
        path_scale=theory.path_scale,
        frame=framed(agreements),
    )


def _line(look: "LineStyle", agreement: "Agreement") -> _Line:
    times, errors = agreement.motion.times, []
    for values in (agreement.path_errors, agreement.momentum_errors):
        which = 1 + extremes(values[1:])
        errors.append((times[which], values[which]))
    return _Line(look, _thinned(agreement.motion.contact_point), errors, agreement.finished)


def _thinned(values: _Array) -> _Array:
    return values[:: 1 + len(values) // _MOST]


def extremes(values: _Array) -> NDArray[np.int64]:
    """Return the indices of values (n,) to draw: all, or the extremes of bins if there are many."""
    if len(values) <= _MOST:
        return np.arange(len(values))
    bins = np.array_split(np.arange(len(values)), _MOST // 2)
    # Thinning would lose short peaks.
    ends = [sorted((b[values[b].argmin()], b[values[b].argmax()])) for b in bins]
    return np.array(ends).ravel()


def path_picture(sheet: _Sheet) -> "Figure":
    """Draw the paths of the contact points, and their distance over time below."""
    from robotball.view.tracks import draw_slips

    across, up = np.ptp(sheet.frame, axis=1)
    figure, (paths, errors) = _panels(sheet, (_RIGHT - _LEFT) * up / across, _HIGH)
    for i, line in enumerate(sheet.lines):
        _draw(paths, line, i, *line.contact_point.T)
    draw_slips(paths, sheet.slip_paths)
    paths.plot(*sheet.lines[0].contact_point[0], "ko", markersize=8, zorder=4, label="start")
    if not all(line.finished for line in sheet.lines):
        paths.plot([], [], "kX", markersize=9, label="a run breaks off")
    x, y = sheet.frame
    paths.set(xlim=x, ylim=y, xlabel="X [m]", ylabel="Y [m]", aspect="equal")
    paths.set_title("contact point on the plane, to one scale")
    errors.set_ylabel("distance of the\ncontact points [m]")
    _draw_errors(figure, sheet, 0, sheet.path_scale)
    return figure


def momentum_picture(sheet: _Sheet) -> "Figure":
    """Draw the error of M over time."""
    figure, (errors,) = _panels(sheet, _HIGH)
    _draw_errors(figure, sheet, 1)
    scale = f"error of M, over\n{sheet.momentum_scale:.3g} kg m²/s"
    errors.set(ylabel=scale, title=sheet.momentum)
    return figure


PICTURES = {"path": path_picture, "momentum": momentum_picture}


def _panels(sheet: _Sheet, *heights: float) -> "tuple[Figure, list[Axes]]":
    """Return a figure of panels with heights in inches; the last shows errors over time."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullLocator

    # Fixed margins: an automatic layout takes as long as the rest of the picture.
    # Three names each: the lines, the start, the end of a broken run, and slip.
    rows = (len(sheet.lines) + 4 + bool(sheet.slips)) // 3
    above = _ABOVE + _ROW * rows
    high = above + sum(heights) + _BELOW * len(heights)
    across = {"left": _LEFT / _WIDTH, "right": _RIGHT / _WIDTH, "height_ratios": heights}
    along = {"top": 1 - above / high, "bottom": _BELOW / high, "hspace": _BELOW / np.mean(heights)}
    figure = Figure(figsize=(_WIDTH, high))
    title(figure, sheet.title)
    panels = [*figure.subplots(len(heights), squeeze=False, gridspec_kw=across | along)[:, 0]]
    for panel in panels:
        panel.grid(alpha=0.3)
        panel.margins(x=0.01)
    panels[-1].set_yscale("log")
    panels[-1].yaxis.set_minor_locator(NullLocator())
    panels[-1].yaxis.set_major_formatter(lambda value, _: f"{value:.0e}")
    return figure, panels


def _draw(axes: "Axes", line: _Line, place: int, x: _Array, y: _Array) -> None:
    """Draw a line, with a cross at the end of a broken run.

    The `place` of the line in the picture shifts its markers, so that equal paths stay visible.
    """
    look, every = line.look, 1 + len(x) // 8
    first = place % 6 * every // 6
    style: dict[str, Any] = {"linewidth": 1.5, "linestyle": (0, look.dash) if look.dash else "-"}
    if not line.errors:  # the reference
        style = {"linewidth": 5, "alpha": 0.6}
    style |= {"marker": look.marker, "markevery": (first, every), "label": in_picture(look.label)}
    axes.plot(x, y, color=look.colour, **style)
    if not line.finished:
        axes.plot(x[-1:], y[-1:], "X", color=look.colour, mec="black", markersize=10, zorder=5)


def _draw_errors(figure: "Figure", sheet: _Sheet, kind: int, scale: float = 1.0) -> None:
    """Draw one kind of errors in the last panel, down to rounding, and the legend at the top."""
    from robotball.view.tracks import draw_slips

    least, axes = LEAST * scale, figure.axes[-1]
    errors = [line.errors[kind] for line in sheet.lines[1:]]
    low = any((values < least).any() for _, values in errors)
    axes.set_xlabel("time [s]" + f"; errors below {least:.0e} are drawn there" * low)
    for i, (line, (times, values)) in enumerate(zip(sheet.lines[1:], errors, strict=True)):
        _draw(axes, line, i + 1, times, np.maximum(values, least))
    draw_slips(axes, slips=sheet.slips)
    named = figure.axes[0].get_legend_handles_labels()
    place = (0.5, 1 - 0.5 / figure.get_figheight())
    figure.legend(*named, loc="upper center", bbox_to_anchor=place, ncols=3, frameon=False)


def note(
    axes: "Axes", text: str, at: tuple[float, float], by: tuple[float, float], **style: Any
) -> None:
    """Write a text near a point of the axes, at an offset to the right and up [points]."""
    axes.annotate(text, at, xytext=by, textcoords="offset points", **style)


def beside(axes: "Axes", text: str, height: float, place: float = 4, **style: Any) -> None:
    """Write a label at a height, `place` points to the right of the axes."""
    right: Any = ("axes fraction", "data")
    note(axes, text, (1.0, height), (place, 0), xycoords=right, va="center", **style)
