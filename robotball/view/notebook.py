"""Scenes and motions in a notebook: their cells, and a figure of paths and momenta.

matplotlib is loaded when a picture is drawn.
"""

import io
from base64 import b64encode
from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from robotball.engines.equations import integrate
from robotball.errors import InputError
from robotball.motion import Motion
from robotball.robot.drives import Constant
from robotball.robot.scene import Scene, sample_times
from robotball.rotations import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH = 480  # px, of the picture of a path in a cell
_FLATTEST, _TALLEST = 0.5, 0.75  # of that width is its height, by the path's own form
_SHARP = 2  # pixels of the file for one on the page: screens of high resolution show them
_SHOWN, _STEPS = 10.0, 4000  # s of a scene's path at most, and steps: a cell must not take long
# Else the class's name.
_MOVED = {"Servo": "velocity servo", "PositionServo": "position servo", "DCMotor": "DC motor"}


def scene_cell(scene: Scene) -> str:
    """Return HTML of the scene's line, a table of its bodies, and its path by the equations.

    A path that the equations cannot give in _STEPS steps is replaced by the reason.
    """
    # The shell has no hinge, and so no entry here.
    hinges = {hinge.name: _moved(hinge) for hinge in scene.hinges}
    table = "<tr><th>body</th><th>mass [kg]</th><th>turns</th></tr>"
    for link in scene.ball.tree:
        turns = escape(hinges.get(link.name, ""))
        table += f"<tr><td>{escape(link.name)}</td><td>{link.mass:.4g}</td><td>{turns}</td></tr>"
    above = f"<div>{escape(scene.title)}</div><table>{table}</table>"
    try:
        times = sample_times(min(scene.duration, _SHOWN))
        motion = integrate(scene, times, max_steps=_STEPS)
    except InputError as error:
        return (
            f"<div><code>{escape(repr(scene))}</code>{above}<div>{escape(str(error))}</div></div>"
        )
    return cell(repr(scene), [motion], f"{above}<div>Its path, by the equations:</div>")


def _moved(hinge: Any) -> str:
    """Name the motor of a hinge, or give the rate that drives it."""
    if hinge.motor is not None:
        name = type(hinge.motor).__name__
        return _MOVED.get(name, name.lower())
    rate = f"{hinge.rate:.4g} rad/s"
    return rate if isinstance(hinge.command, Constant) else f"{rate} at first"


def _motion_cell(motion: Motion) -> str:
    """Return HTML of the motion's line and its path; one that broke off at once has no path."""
    line = repr(motion)
    return cell(line, [motion]) if len(motion.times) else f"<code>{escape(line)}</code>"


def cell(line: str, motions: Sequence[Motion], above: str = "") -> str:
    """Return a notebook cell: a line of text, optional HTML, the motions' paths and a 3-D view.

    The paths are a PNG. The view, of motions of two times at least, is folded away.
    """
    from robotball.view.web import view_page

    figure = _figure((_WIDTH / 100, _WIDTH * _TALLEST / 100))
    axes = figure.add_subplot()
    _draw_paths(axes, motions)
    # A ball that stands still has no width.
    form = axes.dataLim.height / (axes.dataLim.width or 1.0)
    # A cell is as high as its path needs, but no strip and no tower.
    figure.set_figheight(_WIDTH * float(np.clip(form, _FLATTEST, _TALLEST)) / 100)
    # In the page itself: a notebook is passed on without the files beside it.
    png = b64encode(_png(figure, _SHARP)).decode("ascii")
    names = escape(", ".join(each.engine.name for each in motions), quote=True)
    view = ""
    if min(len(each.times) for each in motions) > 1:
        # Folded away it is not loaded: a browser has room for few 3-D views at a time.
        view = (
            '<details><summary>3-D view</summary><iframe loading="lazy" width="100%" height="600" '
            f'srcdoc="{escape(view_page(motions), quote=True)}"></iframe></details>'
        )
    return (
        f'<div><code>{escape(line)}</code>{above}<div><img width="{_WIDTH}" alt="path of the '
        f'contact point: {names}" src="data:image/png;base64,{png}"/></div>{view}'
        "</div>"
    )


def plot(*motions: Motion) -> "Figure":
    """Draw the paths and the momenta of motions of one scene side by side.

    Parameters
    ----------
    *motions : Motion
        The motions, such as the one by the equations and an engine's.

    Returns
    -------
    matplotlib.figure.Figure
        The figure, which a notebook displays.

    Examples
    --------
    >>> import robotball as rb
    >>> figure = rb.plot(rb.integrate("fig12", 0.5))
    >>> len(figure.axes)
    2
    """
    figure = _figure((10.0, 4.2))
    path, momentum = figure.subplots(1, 2)
    _draw_paths(path, motions)
    path.set_title("contact point")
    for each, style in _styled(motions):
        momentum.plot(each.times, each.momentum, **style)
    for value, name in by_value(motions[0].momentum[0]).items():
        momentum.annotate(
            name, (1.0, value), xycoords=("axes fraction", "data"), xytext=(4, 0),
            textcoords="offset points", va="center",
        )  # fmt: skip
    momentum.set(xlabel="time [s]", ylabel="M, world axes [kg m²/s]", title="momentum M")
    momentum.grid(alpha=0.3)
    return figure


def register(shell: Any) -> None:
    """Have the IPython shell of a notebook display scenes and motions as their cells."""
    html = shell.display_formatter.formatters["text/html"]
    html.for_type(Scene, scene_cell)
    html.for_type(Motion, _motion_cell)


def _styled(motions: Sequence[Motion]) -> Iterator[tuple[Motion, dict[str, Any]]]:
    """Yield each motion with the label, the colour and the style of its line."""
    from robotball.view.lines import line_looks

    for each, look in zip(motions, line_looks(motions), strict=True):
        dash = (0, look.dash) if look.dash else "-"
        yield each, {"label": look.label, "color": look.colour, "linestyle": dash}


def by_value(momentum: Array) -> dict[float, str]:
    """Name the components of M (3,) by their values; those within a label's height share one."""
    groups: dict[float, str] = {}
    for value, name in zip(momentum.tolist(), ("X", "Y", "Z"), strict=True):
        # A twentieth of the largest is the height of a label beside the axes.
        near = [other for other in groups if abs(other - value) <= 0.05 * np.abs(momentum).max()]
        key = near[0] if near else value
        groups[key] = f"{groups[key]}, {name}" if near else name
    return groups


def _figure(size: tuple[float, float]) -> "Figure":
    """Return an empty figure of a size [inch] that a notebook displays without pyplot."""
    from matplotlib.figure import Figure

    # pyplot would keep every figure, and look for a window to show it in.
    class Picture(Figure):
        """A figure with the method that notebooks look for."""

        def _repr_png_(self) -> bytes:
            return _png(self)

    return Picture(figsize=size, layout="constrained")


def _png(figure: "Figure", scale: int = 1) -> bytes:
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=100 * scale)
    return png.getvalue()


def _draw_paths(axes: "Axes", motions: Sequence[Motion]) -> None:
    """Draw each motion's contact point; a legend names engines and settings of several."""
    for i, (each, style) in enumerate(_styled(motions)):
        # Motions that agree hide each other, so the first one is wide below the others.
        wide = 5.0 if i == 0 and len(motions) > 1 else 1.8
        axes.plot(*each.contact_point.T, linewidth=wide, **style)
    axes.set(xlabel="X [m]", ylabel="Y [m]")
    axes.set_aspect("equal", "datalim")
    axes.grid(alpha=0.3)
    if len(motions) > 1:
        axes.legend(loc="best")
