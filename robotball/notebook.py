"""How scenes and motions show themselves: in a line, in a notebook's cell, as a picture."""

import io
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from robotball.chart import Line, chart, legend
from robotball.drives import Constant
from robotball.errors import InputError
from robotball.rotations import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DASHES = ("", "7 4", "2 3", "10 3 2 3")  # tell lines apart without colour
SIDE = 480  # px, of a path in a notebook
SHOWN, STEPS = 10.0, 4000  # s of a scene's path at most, and steps: a cell must not take long
MOVED = {"Servo": "velocity servo", "PositionServo": "position servo"}  # else the class's name


def counted(count: int, what: str) -> str:
    """`1 rotor`, `2 rotors`."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def scene_line(scene: Any) -> str:
    """A scene in a line: name, rolling model, what is inside, duration."""
    ball = scene.ball
    inside = [counted(len(ball.rotors), "rotor")] if ball.rotors else []
    inside += [counted(len(ball.pendulums), "pendulum")] if ball.pendulums else []
    parts = [scene.rolling, *inside, f"{ball.mass:.4g} kg", f"radius {ball.radius:.4g} m"]
    return f"<Scene {scene.name}: {', '.join(parts)}; {scene.duration:g} s>"


def scene_cell(scene: Any) -> str:
    """A scene in a notebook: its line, its bodies as a table, and its path by the equations."""
    # The equations know scenes, so a scene finds them only when it is looked at.
    from robotball import integrate, sample_times

    hinges = {hinge.name: _moved(hinge) for hinge in scene.hinges}
    table = "<tr><th>body</th><th>mass [kg]</th><th>turns</th></tr>"
    for name, body in scene.ball.named_bodies:
        turns = escape(hinges.get(name, ""))
        table += f"<tr><td>{name}</td><td>{body.mass:.4g}</td><td>{turns}</td></tr>"
    above = f"<div>{escape(scene.title)}</div><table>{table}</table>"
    try:
        times = sample_times(min(scene.duration, SHOWN))
        motion = integrate(scene, times, max_steps=STEPS)
    except InputError as error:
        return (
            f"<div><code>{escape(repr(scene))}</code>{above}<div>{escape(str(error))}</div></div>"
        )
    return cell(repr(scene), path_lines([motion]), f"{above}<div>Its path, by the equations:</div>")


def _moved(hinge: Any) -> str:
    """What turns a hinge, in a few words."""
    if hinge.motor is not None:
        name = type(hinge.motor).__name__
        return MOVED.get(name, name.lower())
    rate = f"{hinge.rate:.4g} rad/s"
    return rate if isinstance(hinge.command, Constant) else f"{rate} at first"


def motion_line(motion: Any) -> str:
    """A motion in a line: of what, by whom, how far, and how many faults."""
    report = getattr(motion, "report", None)
    by = f"{motion.engine.name} {motion.engine.version}"
    if report is not None:
        by += f", {report.settings.name}"
    line = f"{len(motion.times)} times to {motion.times[-1]:g} s, path {motion.path_length:.4g} m"
    if report is not None:
        line += f", {counted(len(report.faults), 'fault') if report.faults else 'no fault'}"
    return f"<{type(motion).__name__} of {motion.scene.name} by {by}: {line}>"


def motion_cell(motion: Any) -> str:
    """Return HTML of the motion's line and its path."""
    return cell(motion_line(motion), path_lines([motion]))


def path_lines(motions: Iterable[Any], names: Iterable[str] | None = None) -> list[Line]:
    """The contact points' paths of motions, a line each, named after their engines if not given."""
    motions = list(motions)
    named = [each.engine.name for each in motions] if names is None else list(names)
    return [
        Line(
            name,
            each.engine.colour,
            each.contact_point[:, 0],
            each.contact_point[:, 1],
            dash=DASHES[i % len(DASHES)],
            width=4 if i == 0 and len(motions) > 1 else 1.8,
            times=each.times,
        )
        for i, (name, each) in enumerate(zip(named, motions, strict=True))
    ]


def cell(line: str, lines: Sequence[Line], above: str = "") -> str:
    """A notebook's cell: a line of words, HTML above the picture if there is any, the paths."""
    drawn = chart(lines, "X [m]", "Y [m]", equal=True, size=(SIDE, SIDE * 3 // 4))
    names = f"<div>{legend(lines)}</div>" if len(lines) > 1 else ""
    return f"<div><code>{escape(line)}</code>{above}{names}{drawn}</div>"


def by_value(momentum: Array) -> dict[float, str]:
    """The names of M's components (3,) by their value; those within a label's height are one."""
    groups: dict[float, str] = {}
    for value, name in zip(momentum.tolist(), ("X", "Y", "Z"), strict=True):
        near = [other for other in groups if abs(other - value) <= 0.05 * np.abs(momentum).max()]
        key = near[0] if near else value
        groups[key] = f"{groups[key]}, {name}" if near else name
    return groups


def picture(motions: Sequence[Any]) -> "Figure":
    """Paths and momenta of motions of one scene, side by side, as a figure of matplotlib."""
    from matplotlib.figure import Figure

    class Picture(Figure):
        """A figure that a notebook shows without pyplot."""

        def _repr_png_(self) -> bytes:
            png = io.BytesIO()
            self.savefig(png, format="png", dpi=100)
            return png.getvalue()

    figure = Picture(figsize=(10.0, 4.2), layout="constrained")
    path, momentum = figure.subplots(1, 2)
    styles = ("-", "--", ":", "-.")
    for i, each in enumerate(motions):
        style = {"color": each.engine.colour, "linestyle": styles[i % len(styles)]}
        path.plot(*each.contact_point.T, label=each.engine.name, **style)
        for component in each.momentum.T:
            momentum.plot(each.times, component, **style)
    for value, name in by_value(motions[0].momentum[0]).items():
        momentum.annotate(
            name, (1.0, value), xycoords=("axes fraction", "data"), xytext=(4, 0),
            textcoords="offset points", va="center",
        )  # fmt: skip
    path.set(xlabel="X [m]", ylabel="Y [m]", title="contact point")
    path.set_aspect("equal", "datalim")
    momentum.set(xlabel="time [s]", ylabel="M, world axes [kg m²/s]", title="momentum M")
    for axes in (path, momentum):
        axes.grid(alpha=0.3)
    if len(motions) > 1:
        path.legend(loc="best")
    return figure
