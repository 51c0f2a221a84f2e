"""Draw the pictures of a scene's agreements: paths, their distance, and the error of M."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robotball.rotations import Array

from .output import in_picture, scientific, title, write_picture
from .slip import others

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from robotball.view.tracks import LineStyle

    from .agreement import Agreement

# A relative error below the rounding of 1 has no meaning, and 0 has no logarithm.
LEAST = 1e-17
# In inches: the width of a picture, the left and right ends of its panels, the height of an error
# panel, the space above a panel for a row of names, and the space below it.
_WIDTH, _LEFT, _RIGHT, _HIGH, _ABOVE, _ROW, _BELOW = 8.0, 1.1, 7.6, 2.7, 0.9, 0.21, 0.75


def draw(agreements: Sequence["Agreement"], out: Path) -> list[Path]:
    """Write two PNGs of a scene's agreements with an engine, and return their paths."""
    from .results import file_stem

    name = file_stem(agreements)
    return [
        write_picture(out / f"{name}-{kind}.png", picture(agreements))
        for kind, picture in PICTURES.items()
    ]


def in_view(own: Array, every: Array, reach: float) -> tuple[float, float]:
    """Return the ends of an axis that shows `own` (n,), and the part of `every` (m,) in reach.

    The last samples of a failed run may have any value and may be outside the picture.
    """
    own, every = own[np.isfinite(own)], every[np.isfinite(every)]
    low, high = (float(own.min()), float(own.max())) if len(own) else (0.0, 0.0)
    return max(low - reach, every.min(initial=low)), min(high + reach, every.max(initial=high))


def framed(agreements: Sequence["Agreement"]) -> Array:
    """Return the ends (2, 2) of the axes X and Y [m] for a picture of the paths, in one scale.

    The picture's height is 0.2 to 0.7 times its width, and its width is above rounding errors.
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


def path_picture(agreements: Sequence["Agreement"]) -> "Figure":
    """Draw the paths of the contact points, and their distance over time below."""
    from robotball.view.tracks import draw_slips, line_looks, slip_parts, slips_of

    theory, (x, y) = agreements[0].theory, framed(agreements)
    height = (_RIGHT - _LEFT) * float(np.ptp(y) / np.ptp(x))
    figure, (paths, errors) = _panels(agreements, "path", height, _HIGH)
    own, *looks = line_looks([theory, *(run.motion for run in agreements)])
    _draw(paths, own, 0, theory.contact_point)
    for i, (look, run) in enumerate(zip(looks, agreements, strict=True), 1):
        _draw(paths, look, i, run.motion.contact_point, run.finished)
    paths.set_title("contact point on the plane, to one scale")
    for other in others(agreements):
        colour = line_looks([theory, agreements[0].motion, other])[-1].colour
        label = "equations with this friction" if slips_of(other) else "equations without slip"
        paths.plot(*other.contact_point.T, "-.", color=colour, label=label)
        paths.set_title(agreements[0].slip.split if agreements[0].slip else "", size=10)
    parts = slip_parts(slips_of(theory), theory.times)
    draw_slips(paths, [theory.contact_point[part] for part in parts])
    paths.plot(*theory.contact_point[0], "ko", markersize=8, zorder=4, label="start")
    if not all(run.finished for run in agreements):
        paths.plot([], [], "kX", markersize=9, label="a run breaks off")
    paths.set(xlim=x, ylim=y, xlabel="X [m]", ylabel="Y [m]", aspect="equal")
    errors.set_ylabel("distance of the\ncontact points [m]")
    _draw_errors(figure, agreements, [run.path_errors for run in agreements], theory.path_scale)
    return figure


def momentum_picture(agreements: Sequence["Agreement"]) -> "Figure":
    """Draw the error of M over time."""
    scene, M = agreements[0].scene, agreements[0].theory.momentum[0].round(12) + 0.0
    vector = ", ".join(f"{component:.3g}" for component in M)
    kept = f"M = ({vector}) kg m²/s is constant" if scene.keeps_momentum else "momentum M"
    figure, (errors,) = _panels(agreements, "momentum", _HIGH)
    _draw_errors(figure, agreements, [run.momentum_errors for run in agreements])
    errors.set(ylabel=f"error of M, over\n{scene.momentum_scale:.3g} kg m²/s", title=kept)
    return figure


PICTURES = {"path": path_picture, "momentum": momentum_picture}


def _panels(
    agreements: Sequence["Agreement"], what: str, *heights: float
) -> "tuple[Figure, list[Axes]]":
    """Return a figure of panels with heights in inches; the last shows errors over time.

    The title has each run's error of this name: "path" or "momentum".
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullLocator

    from robotball.view.tracks import slips_of

    scene, slips = agreements[0].scene, slips_of(agreements[0].theory)
    # Fixed margins: an automatic layout takes as long as the rest of the picture. Each row has
    # three names: of the lines, the start, the end of a failed run, and slip.
    rows = (len(agreements) + 6 + bool(slips)) // 3
    above = _ABOVE + _ROW * rows
    high = above + sum(heights) + _BELOW * len(heights)
    across = {"left": _LEFT / _WIDTH, "right": _RIGHT / _WIDTH, "height_ratios": heights}
    along = {"top": 1 - above / high, "bottom": _BELOW / high, "hspace": _BELOW / np.mean(heights)}
    figure = Figure(figsize=(_WIDTH, high))
    errors = [(run.settings.name, getattr(run, f"{what}_error")) for run in agreements]
    found = (
        f"{scientific(it)} ({name})" if it == it else f"{name} breaks off" for name, it in errors
    )
    title(figure, f"{scene.name}: {what} error {', '.join(found)}")
    panels = [*figure.subplots(len(heights), squeeze=False, gridspec_kw=across | along)[:, 0]]
    for panel in panels:
        panel.grid(alpha=0.3)
        panel.margins(x=0.01)
    panels[-1].set_yscale("log")
    panels[-1].yaxis.set_minor_locator(NullLocator())
    panels[-1].yaxis.set_major_formatter(lambda value, _: f"{value:.0e}")
    return figure, panels


def _draw(
    axes: "Axes", look: "LineStyle", place: int, points: Array, finished: bool = True
) -> None:
    """Draw a line through points (n, 2), with a cross at the end of a failed run.

    The `place` of the line in the picture shifts its markers, so that equal paths stay visible. The
    reference is at place 0.
    """
    every = 1 + len(points) // 8
    first = place % 6 * every // 6
    style: dict[str, Any] = {"linewidth": 5, "alpha": 0.6}
    if place:
        style = {"linewidth": 1.5, "linestyle": (0, look.dash) if look.dash else "-"}
    style |= {"marker": look.marker, "markevery": (first, every), "label": in_picture(look.label)}
    axes.plot(*points.T, color=look.colour, **style)
    if not finished:
        axes.plot(*points[-1:].T, "X", color=look.colour, mec="black", markersize=10, zorder=5)


def _draw_errors(
    figure: "Figure",
    agreements: Sequence["Agreement"],
    errors: Sequence[Array],
    scale: float = 1.0,
) -> None:
    """Draw the errors of each run in the last panel, and the legend at the top.

    Errors are drawn down to rounding, without the start, at which they are 0.
    """
    from robotball.view.tracks import draw_slips, line_looks, slips_of

    least, axes = LEAST * scale, figure.axes[-1]
    _, *looks = line_looks([agreements[0].theory, *(run.motion for run in agreements)])
    low = any((values[1:] < least).any() for values in errors)
    axes.set_xlabel("time [s]" + f"; errors below {least:.0e} are drawn there" * low)
    for i, (look, run, values) in enumerate(zip(looks, agreements, errors, strict=True), 1):
        heights = np.maximum(values[1:], least)
        _draw(axes, look, i, np.column_stack([run.motion.times[1:], heights]), run.finished)
    draw_slips(axes, slips=slips_of(agreements[0].theory))
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


def separate(figure: "Figure", notes: Sequence[Any]) -> None:
    """Move each note that covers an earlier one to another height near its point."""
    figure.draw_without_rendering()  # extents are known only after the layout
    placed: list[Any] = []
    for text in notes:
        for height in (7, 19, 31, -15):
            text.xyann = (0, height)
            box = text.get_window_extent()
            if not any(map(box.overlaps, placed)):
                break
        placed.append(box)
