"""Draw the pictures of a scene's agreements: paths and their distance, and the error of M.

To import matplotlib takes longer than to compare a short motion. So other processes draw, which
import it while this one works; a process that has it already draws by itself. A Sheet holds what
the pictures show in plain numbers, which can be sent to another process.
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

    from robotball.view.lines import LineStyle

    from .agreement import Agreement

# The type of robotball.rotations, whose import would bring scipy to a process that only draws.
_Array = NDArray[np.float64]


_MATPLOTLIB = "matplotlib.backends.backend_agg"  # with all of it that a PNG needs
MANY = 4  # scenes, worth more than one process to compare them, each of which draws its own


def prepare_drawing(scenes: int) -> None:
    """Have matplotlib imported elsewhere, for a `draw` of so many scenes that is some time away."""
    if scenes < MANY and _MATPLOTLIB not in sys.modules:
        with suppress(OSError):  # then `draw` does without
            prepare(__name__, _MATPLOTLIB)


def draw(agreements: Sequence["Agreement"], out: Path) -> list[Path]:
    """Write two pictures of one scene's agreements by one engine, and return their paths.

    They are PNGs in the folder `out`.
    """
    from .results import file_stem

    name, sheet = file_stem(agreements), sheet_of(agreements)
    drawings = [(kind, sheet, out / f"{name}-{kind}.png") for kind in PICTURES]
    if _MATPLOTLIB not in sys.modules:
        with suppress(OSError):  # no process is to be had, or one was killed
            return list(in_processes(_write, drawings))
    return [_write(each) for each in drawings]


def _write(drawing: tuple[str, "Sheet", Path]) -> Path:
    kind, sheet, path = drawing
    return write_picture(path, PICTURES[kind](sheet))


_MOST = 50_000  # points of a line: a dozen for each column of pixels
# Below the rounding of 1 an error says nothing, and a zero has no place on a logarithmic axis.
LEAST = 1e-17


def in_view(own: _Array, every: _Array, reach: float) -> tuple[float, float]:
    """Return the ends of an axis: all of `own` (n,), and of `every` (m,) what is within reach.

    A run that breaks leaves the picture: its last samples may be any number.
    """
    own, every = own[np.isfinite(own)], every[np.isfinite(every)]
    low, high = (float(own.min()), float(own.max())) if len(own) else (0.0, 0.0)
    return max(low - reach, every.min(initial=low)), min(high + reach, every.max(initial=high))


def framed(agreements: Sequence["Agreement"]) -> _Array:
    """Return the ends (2, 2) of the axes X and Y [m] of a picture of the paths, to one scale.

    It is 0.2 to 0.7 times as high as wide: no tower, no strip, and never rounding alone.
    """
    own, radius = agreements[0].theory.contact_point, agreements[0].scene.ball.radius
    every = np.concatenate([own, *(each.motion.contact_point for each in agreements)])
    # As far as the equations' path is long, so that a run off by that much is still seen.
    reach = max(float(np.ptp(own, axis=0).max()), radius)
    ends = np.array([in_view(own[:, i], every[:, i], reach) for i in (0, 1)])
    across, up = 1.1 * np.ptp(ends, axis=1)
    across = max(across, up / 0.7, 0.1 * radius)
    half = np.array([across, max(up, 0.2 * across)]) / 2
    return np.column_stack([ends.mean(axis=1) - half, ends.mean(axis=1) + half])


@dataclass(frozen=True)
class _Line:
    """A motion in a picture, by its contact_point (n, 2) m, and by its errors.

    errors: of the path [m] and of the momentum, relative, each as times (n,) s and values (n,)
    without the zero that they start from; finished: whether it is as long as it should be.
    """

    look: "LineStyle"
    contact_point: _Array
    errors: Sequence[tuple[_Array, _Array]] = ()
    finished: bool = True


@dataclass(frozen=True)
class Sheet:
    """The lines, names and scales of a scene's pictures.

    lines: the equations' first; momentum: M in words where it is constant; the scales: units of
    errors; frame (2, 2): ends of X and Y [m].
    """

    title: str
    lines: Sequence[_Line]
    momentum: str
    momentum_scale: float
    path_scale: float
    frame: _Array


def sheet_of(agreements: Sequence["Agreement"]) -> Sheet:
    """Return the sheet of one scene's agreements by one engine."""
    from robotball.view.lines import line_looks

    theory = agreements[0].theory
    scene = theory.scene
    own, *looks = line_looks([theory, *(each.motion for each in agreements)])
    vector = ", ".join(f"{each:.3g}" for each in theory.momentum[0].round(12) + 0.0)
    return Sheet(
        title=f"{scene.name}: {scene.title}",
        lines=[_Line(own, _thinned(theory.contact_point)), *map(_line, looks, agreements)],
        momentum=f"M = ({vector}) kg m²/s is constant" if scene.keeps_momentum else "",
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
    """Return the indices of values (n,): of all, or of the extremes of each bin of many."""
    if len(values) <= _MOST:
        return np.arange(len(values))
    bins = np.array_split(np.arange(len(values)), _MOST // 2)
    # Both extremes of each bin, as a thinned line would lose a short peak.
    ends = [sorted((b[values[b].argmin()], b[values[b].argmax()])) for b in bins]
    return np.array(ends).ravel()


# Inches: the width of a picture, the left and right end of its panels, the height of those of
# errors, and what is left free above, for a row of names, and below each panel.
_WIDTH, _LEFT, _RIGHT, _HIGH, _ABOVE, _ROW, _BELOW = 8.0, 1.1, 7.6, 2.7, 0.8, 0.21, 0.75


def path_picture(sheet: Sheet) -> "Figure":
    """Draw the contact points' paths of both motions, and their distance over time below."""
    across, up = np.ptp(sheet.frame, axis=1)
    figure, (paths, errors) = _panels(sheet, (_RIGHT - _LEFT) * up / across, _HIGH)
    for i, line in enumerate(sheet.lines):
        _draw(paths, line, i, *line.contact_point.T)
    paths.plot(*sheet.lines[0].contact_point[0], "ko", markersize=8, zorder=4, label="start")
    if not all(line.finished for line in sheet.lines):
        paths.plot([], [], "kX", markersize=9, label="a run breaks off")
    x, y = sheet.frame
    paths.set(xlim=x, ylim=y, xlabel="X [m]", ylabel="Y [m]", aspect="equal")
    paths.set_title("contact point on the plane, to one scale")
    errors.set_ylabel("distance of the\ncontact points [m]")
    _draw_errors(figure, sheet, 0, sheet.path_scale)
    return figure


def momentum_picture(sheet: Sheet) -> "Figure":
    """Draw the error of M. M itself is constant and named, or `motion.plot` draws it."""
    figure, (errors,) = _panels(sheet, _HIGH)
    _draw_errors(figure, sheet, 1)
    scale = f"error of M, over\n{sheet.momentum_scale:.3g} kg m²/s"
    errors.set(ylabel=scale, title=sheet.momentum or "momentum M")
    return figure


PICTURES = {"path": path_picture, "momentum": momentum_picture}


def _panels(sheet: Sheet, *heights: float) -> "tuple[Figure, list[Axes]]":
    """Return a figure of panels so many inches high, the last of them of errors over time."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullLocator

    # Margins are given: a layout that matplotlib finds takes as long as the rest of a picture.
    rows = (len(sheet.lines) + 4) // 3  # of three names each: of the lines, and two more
    above = _ABOVE + _ROW * rows
    high = above + sum(heights) + _BELOW * len(heights)
    across = {"left": _LEFT / _WIDTH, "right": _RIGHT / _WIDTH, "height_ratios": heights}
    along = {"top": 1 - above / high, "bottom": _BELOW / high, "hspace": _BELOW / np.mean(heights)}
    figure = Figure(figsize=(_WIDTH, high))
    title(figure, sheet.title)
    panels = [*figure.subplots(len(heights), squeeze=False, gridspec_kw=across | along)[:, 0]]
    for each in panels:
        each.grid(alpha=0.3)
        each.margins(x=0.01)
    panels[-1].set_yscale("log")
    panels[-1].yaxis.set_minor_locator(NullLocator())
    panels[-1].yaxis.set_major_formatter(lambda value, _: f"{value:.0e}")  # as in the table
    return figure, panels


def _draw(axes: "Axes", line: _Line, place: int, x: _Array, y: _Array) -> None:
    """Draw a line, with a cross where its run breaks off; that of the equations is wide.

    place: among the lines of the picture, by which no line's markers hide another's on one path.
    """
    look, every = line.look, 1 + len(x) // 8
    first = place % 6 * every // 6
    style: dict[str, Any] = {"linewidth": 1.5, "linestyle": (0, look.dash) if look.dash else "-"}
    if not line.errors:
        style = {"linewidth": 5, "alpha": 0.6}
    style |= {"marker": look.marker, "markevery": (first, every), "label": in_picture(look.label)}
    axes.plot(x, y, color=look.colour, **style)
    if not line.finished:
        axes.plot(x[-1:], y[-1:], "X", color=look.colour, mec="black", markersize=10, zorder=5)


def _draw_errors(figure: "Figure", sheet: Sheet, kind: int, scale: float = 1.0) -> None:
    """Draw errors of a kind in the last panel, down to rounding; name the lines above them all."""
    least, axes = LEAST * scale, figure.axes[-1]
    found = [line.errors[kind] for line in sheet.lines[1:]]
    low = any((values < least).any() for _, values in found)
    axes.set_xlabel("time [s]" + f"; an error below {least:.0e} is drawn there" * low)
    for i, (line, (times, values)) in enumerate(zip(sheet.lines[1:], found, strict=True)):
        _draw(axes, line, i + 1, times, np.maximum(values, least))
    named = figure.axes[0].get_legend_handles_labels()
    place = (0.5, 1 - 0.5 / figure.get_figheight())
    figure.legend(*named, loc="upper center", bbox_to_anchor=place, ncols=3, frameon=False)


def note(
    axes: "Axes", text: str, at: tuple[float, float], by: tuple[float, float], **style: Any
) -> None:
    """Write a text beside a point of the axes, so many points right of it and above."""
    axes.annotate(text, at, xytext=by, textcoords="offset points", **style)


def beside(axes: "Axes", text: str, height: float, place: float = 4, **style: Any) -> None:
    """Write a label `place` points right of the axes, at the height of what it names."""
    right: Any = ("axes fraction", "data")
    note(axes, text, (1.0, height), (place, 0), xycoords=right, va="center", **style)
