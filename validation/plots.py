"""Draw the pictures of a scene's agreements: paths and the momentum, each with its error below.

To import matplotlib takes longer than to compare a short motion. So other processes draw, which
import it while this one works; a process that has it already draws by itself. A Sheet holds what
the pictures show in plain numbers, which can be sent to another process.
"""

import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robotball.processes import in_processes, prepare
from validation.output import in_picture, title, write_picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from robotball.motion import Motion
    from validation.agreement import Agreement

# The type of robotball.rotations, whose import would bring scipy to a process that only draws.
_Array = NDArray[np.float64]
_Integers = NDArray[np.int64]

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
    from validation.results import file_stem

    name, sheet = file_stem(agreements), sheet_of(agreements)
    drawings = [(kind, sheet, out / f"{name}-{kind}.png") for kind in _PICTURES]
    if _MATPLOTLIB not in sys.modules:
        with suppress(OSError):  # no process is to be had, or one was killed
            return list(in_processes(_write, drawings))
    return [_write(each) for each in drawings]


def _write(drawing: tuple[str, "Sheet", Path]) -> Path:
    kind, sheet, path = drawing
    return write_picture(path, _PICTURES[kind](sheet))


_MOST = 50_000  # points of a line: a dozen for each column of pixels


@dataclass(frozen=True)
class _Line:
    """A motion in a picture: times (n,) s, contact_point (n, 2) m and momentum (n, 3) kg m²/s."""

    label: str
    colour: str
    times: _Array
    contact_point: _Array
    momentum: _Array


# The times (n,) s of errors and their values (n,), without the zero that they start from.
_Errors = tuple[_Array, _Array]


@dataclass(frozen=True)
class _Run:
    """A motion by an engine, with its path's errors [m] and its momentum's, relative.

    settings: their name; finished: whether the motion is as long as it should be.
    """

    line: _Line
    settings: str
    finished: bool
    path_errors: _Errors
    momentum_errors: _Errors


@dataclass(frozen=True)
class Sheet:
    """The lines, names and scales of a scene's pictures.

    momentum_labels: the names of M's components by their heights; scale: kg m²/s, of M.
    """

    title: str
    theory: _Line
    runs: Sequence[_Run]
    keeps_momentum: bool
    momentum_labels: dict[float, str]
    scale: float


def sheet_of(agreements: Sequence["Agreement"]) -> Sheet:
    """Return the sheet of one scene's agreements by one engine."""
    from robotball.notebook import by_value

    theory = agreements[0].theory
    scene = theory.scene
    return Sheet(
        title=f"{scene.name}: {scene.title}",
        theory=_line(theory, theory.engine.name),
        runs=[
            _Run(
                _line(each.motion, f"{each.motion.engine.name}, {each.settings.name}"),
                each.settings.name,
                each.finished,
                _errors(each.motion, each.path_errors),
                _errors(each.motion, each.momentum_errors),
            )
            for each in agreements
        ],
        keeps_momentum=scene.keeps_momentum,
        momentum_labels=by_value(theory.momentum[0 if scene.keeps_momentum else -1]),
        scale=scene.momentum_scale,
    )


def _line(motion: "Motion", label: str) -> _Line:
    shown = slice(None, None, 1 + len(motion.times) // _MOST)
    paths = motion.contact_point[shown], motion.momentum[shown]
    return _Line(label, motion.engine.colour, motion.times[shown], *paths)


def _errors(motion: "Motion", values: _Array) -> _Errors:
    which = 1 + extremes(values[1:])
    return motion.times[which], values[which]


def extremes(values: _Array) -> _Integers:
    """Return the indices of values (n,): of all, or of the extremes of each bin of many."""
    if len(values) <= _MOST:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), _MOST // 2 + 1).astype(int)
    ends = zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    found = [sorted((i + values[i:j].argmin(), i + values[i:j].argmax())) for i, j in ends]
    return np.array(found).ravel()


# Settings differ by line style, so in grey too; the coarsest has the most broken line.
_STYLES = ((0, (1, 3)), ":", "-.", "--", "-")
_INCHES = (8.0, 7.0)
ROOM = {"left": 0.13, "right": 0.86, "top": 0.9, "bottom": 0.08, "hspace": 0.25}


def path_picture(sheet: Sheet) -> "Figure":
    """Draw the contact points' paths of both motions, and their distance over time below."""
    figure, paths, errors = _two_panels(sheet)
    paths.plot(*sheet.theory.contact_point.T, label=sheet.theory.label, **_wide(sheet))
    for run, style in _styled(sheet):
        colour, label = run.line.colour, in_picture(run.line.label)
        paths.plot(*run.line.contact_point.T, linestyle=style, color=colour, label=label)
        _log_line(errors, run, run.path_errors, style)
    paths.set(xlabel="X [m]", ylabel="Y [m]", title="contact point on the plane, to one scale")
    paths.set_aspect("equal", "datalim")
    errors.set(xlabel="time [s]", ylabel="distance of the\ncontact points [m]")
    paths.legend(loc="best", ncols=1 + (len(sheet.runs) > 2))
    return figure


def momentum_picture(sheet: Sheet) -> "Figure":
    """Draw M's components by the equations and by the engine, and the error of M below."""
    figure, components, errors = _two_panels(sheet)
    theory, wide = sheet.theory, _wide(sheet)
    components.plot([], [], label=theory.label, **wide)
    for value, names in sheet.momentum_labels.items():
        if sheet.keeps_momentum:
            components.axhline(value, **wide)
        beside(components, names, value)
    if not sheet.keeps_momentum:
        components.plot(theory.times, theory.momentum, **wide)
    for run, style in _styled(sheet):
        line = run.line
        lines = components.plot(line.times, line.momentum, linestyle=style, color=line.colour)
        lines[0].set_label(in_picture(line.label))
        _log_line(errors, run, run.momentum_errors, style)
    low, high = components.get_ylim()
    if high - low < 1e-3 * sheet.scale:  # M = 0: rounding alone would fill the picture
        components.set_ylim(low - 0.05 * sheet.scale, high + 0.05 * sheet.scale)
    components.set(ylabel="M, world axes [kg m²/s]", title="momentum M")
    errors.set(xlabel="time [s]", ylabel=f"error of M, over {sheet.scale:.3g} kg m²/s")
    components.legend(loc="best")
    return figure


_PICTURES: dict[str, Callable[[Sheet], "Figure"]] = {
    "path": path_picture,
    "momentum": momentum_picture,
}


def _two_panels(sheet: Sheet) -> "tuple[Figure, Axes, Axes]":
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullLocator

    figure = Figure(figsize=_INCHES)
    title(figure, sheet.title)
    # Margins are given: a layout that matplotlib finds takes as long as the rest of a picture.
    above, below = figure.subplots(2, 1, gridspec_kw=ROOM)
    below.set_yscale("log")
    below.yaxis.set_minor_locator(NullLocator())
    below.yaxis.set_major_formatter(lambda value, _: f"{value:.0e}")  # as in the table
    for axes in (above, below):
        axes.grid(alpha=0.3)
        axes.margins(x=0.01)
    return figure, above, below


def _wide(sheet: Sheet) -> dict[str, Any]:
    """Return the style of the equations' motion, which is wide below all others."""
    return {"color": sheet.theory.colour, "linewidth": 5, "alpha": 0.6}


def _styled(sheet: Sheet) -> list[tuple[_Run, Any]]:
    last = len(sheet.runs)
    return [(each, _STYLES[(i - last) % len(_STYLES)]) for i, each in enumerate(sheet.runs)]


def _log_line(axes: "Axes", run: _Run, errors: _Errors, style: Any) -> None:
    """Draw a line on a log axis, and name it at its end."""
    axes.plot(*errors, linestyle=style, color=run.line.colour)
    if run.finished:
        beside(axes, in_picture(run.settings), errors[1].max(initial=0.0))


def note(
    axes: "Axes", text: str, at: tuple[float, float], by: tuple[float, float], **style: Any
) -> None:
    """Write a text beside a point of the axes, so many points right of it and above."""
    axes.annotate(text, at, xytext=by, textcoords="offset points", **style)


def beside(axes: "Axes", text: str, height: float, place: float = 4, **style: Any) -> None:
    """Write a label `place` points right of the axes, at the height of what it names."""
    right: Any = ("axes fraction", "data")
    note(axes, text, (1.0, height), (place, 0), xycoords=right, va="center", **style)
