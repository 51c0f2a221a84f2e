"""A scene's pictures, from its sheet: paths and the momentum, each with its error below."""

from collections.abc import Callable
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from validation.comparison.sheets import Errors, Run, Sheet
from validation.output import in_picture, title

# Settings are told apart by line style, so in grey too; the coarsest is the most broken line.
STYLES = ((0, (1, 3)), ":", "-.", "--", "-")
INCHES = (8.0, 7.0)
ROOM = {"left": 0.13, "right": 0.86, "top": 0.9, "bottom": 0.08, "hspace": 0.25}


def path_picture(sheet: Sheet) -> Figure:
    """The contact points' paths of both motions, and their distance over time below."""
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


def momentum_picture(sheet: Sheet) -> Figure:
    """M's components, by the equations and by the engine, and the error of M below."""
    figure, components, errors = _two_panels(sheet)
    theory, wide = sheet.theory, _wide(sheet)
    components.plot([], [], label=theory.label, **wide)
    for value, names in sheet.momentum_labels.items():
        if sheet.keeps_momentum:
            components.axhline(value, **wide)
        _beside(components, names, value)
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


PICTURES: dict[str, Callable[[Sheet], Figure]] = {
    "path": path_picture,
    "momentum": momentum_picture,
}


def _two_panels(sheet: Sheet) -> tuple[Figure, Axes, Axes]:
    figure = Figure(figsize=INCHES)
    title(figure, sheet.title)
    # Room that is given: to have it found takes as long as all the rest of a picture.
    above, below = figure.subplots(2, 1, gridspec_kw=ROOM)
    below.set_yscale("log")
    below.yaxis.set_minor_locator(NullLocator())
    below.yaxis.set_major_formatter(lambda value, _: f"{value:.0e}")  # as in the table
    for axes in (above, below):
        axes.grid(alpha=0.3)
        axes.margins(x=0.01)
    return figure, above, below


def _wide(sheet: Sheet) -> dict[str, Any]:
    """How the equations' motion is drawn, below all others."""
    return {"color": sheet.theory.colour, "linewidth": 5, "alpha": 0.6}


def _styled(sheet: Sheet) -> list[tuple[Run, Any]]:
    last = len(sheet.runs)
    return [(each, STYLES[(i - last) % len(STYLES)]) for i, each in enumerate(sheet.runs)]


def _log_line(axes: Axes, run: Run, errors: Errors, style: Any) -> None:
    """A line on a log axis, named at its end."""
    axes.plot(errors.times, errors.values, linestyle=style, color=run.line.colour)
    if run.finished:
        _beside(axes, in_picture(run.settings), errors.largest)


def _beside(axes: Axes, text: str, height: float) -> None:
    """A label at the right of the axes, at the height of what it names."""
    axes.annotate(
        text,
        (1.0, height),
        xycoords=("axes fraction", "data"),
        xytext=(4, 0),
        textcoords="offset points",
        va="center",
    )
