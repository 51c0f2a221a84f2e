"""Notebook cells for scenes and motions, and a figure of paths and momenta.

matplotlib is imported when a picture is drawn.
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
from robotball.view.tracks import draw_slips, line_looks, slip_parts, slips_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH = 480  # px, of the picture of a path in a cell
_FLATTEST, _TALLEST = 0.5, 0.75  # limits of the picture's height divided by its width
_SHARP = 2  # file pixels per page pixel, for high-resolution screens
_SHOWN, _STEPS = 10.0, 4000  # longest path [s] and most steps: a cell must appear quickly
# Motors of other classes are shown with the name of their class.
_MOTORS = {"Servo": "velocity servo", "PositionServo": "position servo", "DCMotor": "DC motor"}


def scene_cell(scene: Scene) -> str:
    """Return HTML with the scene's repr, a table of its bodies, and its path from the equations.

    If the path takes more than _STEPS steps, it is replaced by the reason.
    """
    # The shell has no hinge and thus no entry.
    hinges = {hinge.name: _drive_of(hinge) for hinge in scene.hinges}
    table = "<tr><th>body</th><th>mass [kg]</th><th>turns</th></tr>"
    for link in scene.ball.tree:
        turns = escape(hinges.get(link.name, ""))
        table += f"<tr><td>{escape(link.name)}</td><td>{link.mass:.4g}</td><td>{turns}</td></tr>"
    above = f"<div>{escape(scene.title)}</div><table>{table}</table>"
    try:
        times = sample_times(min(scene.duration, _SHOWN))
        motion = integrate(scene, times, max_steps=_STEPS)
    except InputError as error:
        below = f"<div>{escape(str(error))}</div>"
        return f"<div><code>{escape(repr(scene))}</code>{above}{below}</div>"
    return cell(repr(scene), [motion], f"{above}<div>Path computed with the equations:</div>")


def _drive_of(hinge: Any) -> str:
    if hinge.motor is not None:
        name = type(hinge.motor).__name__
        return _MOTORS.get(name, name.lower())
    rate = f"{hinge.rate:.4g} rad/s"
    return rate if isinstance(hinge.command, Constant) else f"{rate} initially"


def _motion_cell(motion: Motion) -> str:
    """Return HTML with the motion's repr and its path, if it has any samples."""
    line = repr(motion)
    return cell(line, [motion]) if len(motion.times) else f"<code>{escape(line)}</code>"


def cell(line: str, motions: Sequence[Motion], above: str = "") -> str:
    """Return a notebook cell: a line of text, optional HTML, a PNG of the paths and a 3-D view.

    The 3-D view is folded, and omitted for motions with fewer than two samples.
    """
    from robotball.view.web import view_page

    figure = _figure((_WIDTH / 100, _WIDTH * _TALLEST / 100))
    axes = figure.add_subplot()
    _draw_paths(axes, motions)
    # The path of a ball at rest has no width.
    form = axes.dataLim.height / (axes.dataLim.width or 1.0)
    # The cell's height follows the path, within limits.
    figure.set_figheight(_WIDTH * float(np.clip(form, _FLATTEST, _TALLEST)) / 100)
    # Embedded, because notebooks are shared without other files.
    png = b64encode(_png(figure, _SHARP)).decode("ascii")
    names = escape(", ".join(motion.engine.name for motion in motions), quote=True)
    view = ""
    if min(len(motion.times) for motion in motions) > 1:
        # Not loaded while folded: browsers limit the number of 3-D views.
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
    """Draw the paths and momenta of motions of one scene side by side.

    Parameters
    ----------
    *motions : Motion
        The motions, such as one computed with the equations and one simulated with an engine.

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
    for motion, style in _styled(motions):
        draw_slips(momentum, slips=slips_of(motion))
        momentum.plot(motion.times, motion.momentum, **style)
    for value, name in by_value(motions[0].momentum[-1]).items():
        place = ("axes fraction", "data")
        momentum.annotate(name, (1.0, value), (4, 0), place, "offset points", va="center")
    momentum.set(xlabel="time [s]", ylabel="M, world axes [kg m²/s]", title="momentum M")
    momentum.grid(alpha=0.3)
    return figure


def register(shell: Any) -> None:
    """Make a notebook's IPython shell display scenes and motions as cells."""
    html = shell.display_formatter.formatters["text/html"]
    html.for_type(Scene, scene_cell)
    html.for_type(Motion, _motion_cell)


def _styled(motions: Sequence[Motion]) -> Iterator[tuple[Motion, dict[str, Any]]]:
    for motion, look in zip(motions, line_looks(motions), strict=True):
        dash = (0, look.dash) if look.dash else "-"
        yield motion, {"label": look.label, "color": look.colour, "linestyle": dash}


def by_value(momentum: Array) -> dict[float, str]:
    """Name the components of M (3,) by value; values too close for two labels share one."""
    groups: dict[float, str] = {}
    for value, name in zip(momentum.tolist(), ("X", "Y", "Z"), strict=True):
        # The height of a label beside the axes is about a twentieth of the largest value.
        near = [other for other in groups if abs(other - value) <= 0.05 * np.abs(momentum).max()]
        key = near[0] if near else value
        groups[key] = f"{groups[key]}, {name}" if near else name
    return groups


def _figure(size: tuple[float, float]) -> "Figure":
    """Return an empty figure [inch] that a notebook displays without pyplot."""
    from matplotlib.figure import Figure

    # pyplot would keep every figure, and open windows.
    class Picture(Figure):
        """A figure with the method that notebooks call."""

        def _repr_png_(self) -> bytes:
            return _png(self)

    return Picture(figsize=size, layout="constrained")


def _png(figure: "Figure", scale: int = 1) -> bytes:
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=100 * scale)
    return png.getvalue()


def _draw_paths(axes: "Axes", motions: Sequence[Motion]) -> None:
    for i, (motion, style) in enumerate(_styled(motions)):
        # The first line is wider, because motions that agree cover each other.
        wide = 5.0 if i == 0 and len(motions) > 1 else 1.8
        axes.plot(*motion.contact_point.T, linewidth=wide, **style)
        parts = slip_parts(slips_of(motion), motion.times)
        draw_slips(axes, [motion.contact_point[part] for part in parts])
    axes.set(xlabel="X [m]", ylabel="Y [m]")
    axes.set_aspect("equal", "datalim")
    axes.grid(alpha=0.3)
    if len(axes.get_legend_handles_labels()[1]) > 1:
        axes.legend(loc="best")
