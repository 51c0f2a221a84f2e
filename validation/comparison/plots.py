"""Agreements as pictures: paths and the momentum, each with its error below."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from robotball.rotations import Array
from robotball.shown import by_value
from validation.comparison.agreement import Agreement
from validation.comparison.names import file_stem
from validation.output import in_picture, replacing, title

Integers = NDArray[np.int64]

# Settings are told apart by line style, so in grey too; the coarsest is the most broken line.
STYLES = ((0, (1, 3)), ":", "-.", "--", "-")
INCHES = (8.0, 7.0)
MOST = 50_000  # points of a line: a dozen for each column of pixels
ROOM = {"left": 0.12, "right": 0.86, "top": 0.9, "bottom": 0.08, "hspace": 0.25}


def draw(agreements: Sequence[Agreement], out: Path) -> list[Path]:
    """Two pictures of one scene's agreements, by one engine, as PNGs in `out`."""
    name = file_stem(agreements)
    written = []
    for kind, picture in (("path", path_picture), ("momentum", momentum_picture)):
        path = out / f"{name}-{kind}.png"
        with replacing(path) as temporary:
            picture(agreements).savefig(temporary, dpi=120)
        written.append(path)
    return written


def path_picture(agreements: Sequence[Agreement]) -> Figure:
    """The contact points' paths of both motions, and their distance over time below."""
    figure, paths, errors = _two_panels(agreements)
    theory = agreements[0].theory
    paths.plot(
        *some(theory.contact_point).T,
        color=theory.engine.colour,
        linewidth=5,
        alpha=0.6,
        label=theory.engine.name,
    )
    for agreement, style in _styled(agreements):
        paths.plot(
            *some(agreement.motion.contact_point).T,
            linestyle=style,
            color=agreement.motion.engine.colour,
            label=_label(agreement),
        )
        _log_line(errors, agreement, agreement.path_errors, style)
    paths.set(xlabel="X [m]", ylabel="Y [m]", title="contact point on the plane, to one scale")
    paths.set_aspect("equal", "datalim")
    errors.set(xlabel="time [s]", ylabel="distance of the\ncontact points [m]")
    paths.legend(loc="best", ncols=1 + (len(agreements) > 2))
    return figure


def momentum_picture(agreements: Sequence[Agreement]) -> Figure:
    """M's components, by the equations and by the engine, and the error of M below."""
    figure, components, errors = _two_panels(agreements)
    theory = agreements[0].theory
    wide: dict[str, Any] = {"color": theory.engine.colour, "linewidth": 5, "alpha": 0.6}
    components.plot([], [], label=theory.engine.name, **wide)
    if theory.scene.keeps_momentum:
        for value, names in by_value(theory.momentum[0]).items():
            components.axhline(value, **wide)
            _beside(components, names, value)
    else:
        components.plot(theory.times, theory.momentum, **wide)
        for value, names in by_value(theory.momentum[-1]).items():
            _beside(components, names, value)
    for agreement, style in _styled(agreements):
        lines = components.plot(
            some(agreement.motion.times),
            some(agreement.motion.momentum),
            linestyle=style,
            color=agreement.motion.engine.colour,
        )
        lines[0].set_label(_label(agreement))
        _log_line(errors, agreement, agreement.momentum_errors, style)
    scale = theory.scene.momentum_scale
    low, high = components.get_ylim()
    if high - low < 1e-3 * scale:  # M = 0: rounding alone would fill the picture
        components.set_ylim(low - 0.05 * scale, high + 0.05 * scale)
    components.set(ylabel="M, world axes [kg m²/s]", title="momentum M")
    errors.set(xlabel="time [s]", ylabel=f"error of M, over {scale:.3g} kg m²/s")
    components.legend(loc="best")
    return figure


def _two_panels(agreements: Sequence[Agreement]) -> tuple[Figure, Axes, Axes]:
    figure = Figure(figsize=INCHES)
    scene = agreements[0].scene
    title(figure, f"{scene.name}: {scene.title}")
    # Room that is given: to have it found takes as long as all the rest of a picture.
    above, below = figure.subplots(2, 1, gridspec_kw=ROOM)
    below.set_yscale("log")
    below.yaxis.set_minor_locator(NullLocator())
    below.yaxis.set_major_formatter(lambda value, _: f"{value:.0e}")  # as in the table
    for axes in (above, below):
        axes.grid(alpha=0.3)
        axes.margins(x=0.01)
    return figure, above, below


def _styled(agreements: Sequence[Agreement]) -> list[tuple[Agreement, Any]]:
    last = len(agreements)
    return [(each, STYLES[(i - last) % len(STYLES)]) for i, each in enumerate(agreements)]


def _label(agreement: Agreement) -> str:
    return in_picture(f"{agreement.motion.engine.name}, {agreement.settings.name}")


def _log_line(axes: Axes, agreement: Agreement, values: Array, style: Any) -> None:
    """A line on a log axis, without the exact zero that it starts from, named at its end."""
    which = 1 + extremes(values[1:])
    axes.plot(
        agreement.motion.times[which],
        values[which],
        linestyle=style,
        color=agreement.motion.engine.colour,
    )
    if agreement.finished:
        _beside(axes, in_picture(agreement.settings.name), values.max())


def some(samples: Array) -> Array:
    """As many of the samples (n, …) as a picture can show."""
    return samples[:: 1 + len(samples) // MOST]


def extremes(values: Array) -> Integers:
    """The places of the values (n,), or of the largest and the smallest of each bin of many."""
    if len(values) <= MOST:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), MOST // 2 + 1).astype(int)
    ends = zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    found = [sorted((i + values[i:j].argmin(), i + values[i:j].argmax())) for i, j in ends]
    return np.array(found).ravel()


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
