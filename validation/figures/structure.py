"""Figs 3 and 4: the structure of the ball and its axes, drawn from a scene's bodies and motion.

The bodies are shaded triangles in matplotlib, the farthest drawn first, so that no OpenGL is
needed. The unit of length is the ball's radius, as in the parts of mjcf/.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from robotball import Motion, Scene, integrate, sample_times
from robotball.film.looks import BLUR, INK, looks_of, rgba_of
from robotball.film.tracks import track_of
from robotball.rotations import Array, rotation_matrix
from robotball.shapes import Shape
from validation.figures import (
    ENGINE_LINE,
    ENGINE_NAME,
    FAINT,
    THEORY_LINE,
    View,
    engine_motion,
    sheet,
)
from validation.output import halo
from validation.paper.formulas import paper_scene

_LIGHT = np.array([-0.4, -0.35, 0.85])  # where it comes from
_SHADE = 0.55  # of the colour, on a face that is turned away from it


@dataclass(frozen=True)
class _Solid:
    """The triangles (n, 3, 3) of a body in world axes, in radii, and their colours (n, 3)."""

    corners: Array
    colours: Array


def solid_of(shapes: Sequence[Shape], turn: Array, shift: Array) -> _Solid:
    """Return a body's shapes turned (3, 3), then shifted (3,), without its glass and what blurs."""
    solid = [shape for shape in shapes if shape.material not in ("shell", BLUR)]
    corners = [shape.triangles for shape in solid]
    colour = [
        np.tile(rgba_of(shape.material)[:3], (len(own), 1))
        for shape, own in zip(solid, corners, strict=True)
    ]
    return _Solid(np.concatenate(corners) @ turn.T + shift, np.concatenate(colour))


def _draw_solid(axes: Axes, view: View, solids: Sequence[_Solid]) -> None:
    """Draw the triangles of all bodies, the farthest first, each in one shade."""
    corners = np.concatenate([solid.corners for solid in solids])
    plain = np.concatenate([solid.colours for solid in solids])
    edges = np.diff(corners, axis=1)
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    lit = np.abs(normals @ (_LIGHT / np.linalg.norm(_LIGHT)))
    colours = plain * (_SHADE + (1 - _SHADE) * lit)[:, None]
    order = np.argsort(view.depth(corners).mean(axis=1))
    faces, shade = list(view.places(corners)[order]), colours[order]
    axes.add_collection(PolyCollection(faces, fc=shade, ec=shade, lw=0.4, zorder=2))


_SCENE = "fig12"  # one rotor, and mass inside the shell only
# Both axes of Fig. 3 come towards the viewer, so that a turn about each is seen.
_VIEW = View(azimuth=131.0, elevation=16.0)
_ROLLED = 0.8  # s, before Fig. 4
_SHELL, _FRAME, _ROTOR = "shell", "frame", "rotor1"
_FRAME_AXES, _OMEGA, _ROTOR_AXIS = "#117733", "#CC3311", "#8A5A00"
_NAMES_AT = 1.42  # radii from the centre
_FREE = 3.0  # rad: the direction in Fig. 3 that is farthest from all other names


def figure3() -> Figure:
    """Draw the ball of Fig. 12 at its start: shell, frame and one rotor, and their axes."""
    scene = paper_scene(_SCENE)
    ball, rates = scene.ball, [float(drive.rate(0.0)) for drive in scene.drives]
    caption = (
        "one rotor, n = 1: the ball of Fig. 12 at its",
        "  start, drawn from its bodies",
        f"shell {ball.shell.mass:g} kg, frame {ball.frame.mass:.4g} kg,",
        f"  rotor {ball.rotors[0].mass:.4g} kg, a = {ball.radius:g} m",
        f"Ω = {rates[0]:g} rad/s, φ̇₁ = {rates[1]:.4g} rad/s",
    )
    facts = (
        "The shell rolls on the plane.",
        "The frame turns in the shell about the",
        "  shell's axis of symmetry, at Ω(t).",
        "The rotor turns on the frame about its own",
        "  axis n₁, at φ̇₁(t).",
        "All centres of mass are at C, the centre",
        "  of the sphere. How the bodies share the",
        "  inertia is chosen: the paper gives A and K.",
    )
    title = "Fig. 3: structure of the ball, for one rotor"
    figure, panels = sheet(title, caption, facts, [["ball"]], (6.8,))
    axes = panels["ball"]
    bodies = _posed(scene, integrate(scene, sample_times(_ROLLED)), 0.0)
    attitude = rotation_matrix(scene.start.attitude)
    shell_axis, rotor_axis = attitude @ ball.shell.axis, attitude @ ball.rotors[0].axis
    centre = np.array([0.0, 0.0, 1.0])
    _draw_ball(axes, bodies, centre)
    _draw_turning(axes, centre + 0.98 * shell_axis, 0.3 * shell_axis, _OMEGA)
    _draw_turning(axes, centre, 0.9 * rotor_axis, _ROTOR_AXIS)
    names = {
        "Ω(t): the shell's axis,\nabout which the frame turns": centre + 1.28 * shell_axis,
        "n₁: the rotor's axis,\nit turns at φ̇₁(t)": centre + 0.9 * rotor_axis,
        "frame": _outermost(bodies[_FRAME], centre, shell_axis),
        # The end that is away from the frame's name.
        "rotor": 2 * centre - _outermost(bodies[_ROTOR], centre, rotor_axis),
    }
    _draw_names(axes, centre, names)
    return figure


def figure4() -> Figure:
    """Draw the ball of Fig. 12 after a while on the plane: the axes of space and of the frame."""
    scene, times = paper_scene(_SCENE), sample_times(_ROLLED)
    theory, engine = integrate(scene, times), engine_motion(scene, times)
    frame, a = rotation_matrix(theory.attitude[-1]), scene.ball.radius
    caption = (
        f"the ball of Fig. 12 after {_ROLLED:g} s, drawn",
        "  from its bodies and its motion",
        "O: where it started, X = Y = 0",
        "P: X = {:.4f} m, Y = {:.4f} m".format(*theory.contact_point[-1]),
    )
    facts = (
        "OXYZ stands still; OZ is vertical.",
        "C x₁x₂x₃ turns with the frame, not with the",
        "  shell: seen from it all mass stands still.",
        "  These are principal axes of the inertia.",
        "P: where the shell touches the plane.",
        "α, β, γ: OX, OY, OZ as seen from the frame;",
        "  here γ = ({:.4f}, {:.4f}, {:.4f}).".format(*frame[2]),
    )
    title = "Fig. 4: the ball on the plane, and its axes"
    figure, panels = sheet(title, caption, facts, [["ball"]], (6.8,))
    axes = panels["ball"]
    foot, origin = np.array([*theory.contact_point[-1] / a, 0.0]), np.zeros(3)
    centre = np.array([foot[0], foot[1], 1.0])
    _draw_floor(axes, np.stack([origin, foot])[:, :2])
    for motion, style, name in (
        (theory, THEORY_LINE, "contact point, equations"),
        (engine, ENGINE_LINE, f"contact point, {ENGINE_NAME}"),
    ):
        path = np.column_stack([motion.contact_point / a, np.zeros(len(times))])
        axes.plot(*_VIEW.places(path).T, **style, label=name)
    _draw_ball(axes, _posed(scene, theory, _ROLLED), centre)
    for name, axis in zip("XYZ", np.eye(3), strict=True):
        _draw_arrow(axes, origin, 1.2 * axis, INK)
        _draw_name(axes, name, 1.2 * axis, origin)
    for name, axis in zip(("x₁", "x₂", "x₃"), frame.T, strict=True):
        _draw_arrow(axes, centre, centre + 1.4 * axis, _FRAME_AXES)
        _draw_name(axes, name, centre + 1.4 * axis, centre, _FRAME_AXES)
    axes.plot(*_VIEW.places(np.stack([foot, centre])).T, ":", color=INK, linewidth=1.4, zorder=6)
    for name, point, away in (("P", foot, centre), ("O", origin, foot), ("C", centre, foot)):
        axes.plot(*_VIEW.places(point), "o", color=INK, markersize=4, zorder=8)
        _draw_name(axes, name, point, away)
    axes.legend(loc="lower left", fontsize=10)
    return figure


def _posed(scene: Scene, motion: Motion, time: float) -> dict[str, _Solid]:
    """Return the bodies of a scene's ball as its motion has them at a time [s], in radii."""
    track, looks = track_of(motion), looks_of(scene.ball)
    stands = track.stands(track.at(np.array([time])))
    return {
        body: solid_of(looks[body], stands[body][0][0], stands[body][1][0])
        for body in (_SHELL, _FRAME, _ROTOR)
    }


def _draw_ball(axes: Axes, bodies: Mapping[str, _Solid], centre: Array) -> None:
    """Draw the bodies, the shell see-through."""
    place = _VIEW.place(centre)
    axes.add_patch(Circle(place, 1.0, facecolor="#DCE6EF", edgecolor="none", zorder=1))
    _draw_solid(axes, _VIEW, list(bodies.values()))
    axes.add_patch(Circle(place, 1.0, facecolor="#8FA9C4", edgecolor="none", alpha=0.16, zorder=4))
    axes.add_patch(Circle(place, 1.0, facecolor="none", edgecolor=INK, linewidth=1.4, zorder=4))
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_arrow(axes: Axes, begin: Array, end: Array, colour: str) -> None:
    """Draw an arrow in space, from (3,) to (3,)."""
    axes.annotate(
        "",
        _VIEW.place(end),
        _VIEW.place(begin),
        zorder=6,
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2.0, "mutation_scale": 15,
                    "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip


def _draw_turning(axes: Axes, begin: Array, along: Array, colour: str) -> None:
    """Draw an arrow from a point (3,) along an axis (3,), and one about it for its sense."""
    _draw_arrow(axes, begin, begin + along, colour)
    axis = along / np.linalg.norm(along)
    side = np.cross(axis, _VIEW.axes[2])
    side /= np.linalg.norm(side)
    turn = np.linspace(0.15, 0.85, 60)[:, None] * 2 * np.pi
    ring = 0.14 * (np.cos(turn) * np.cross(axis, side) - np.sin(turn) * side)
    points = begin + 0.7 * along + ring
    axes.plot(*_VIEW.places(points[:-3]).T, color=colour, linewidth=1.8, zorder=6)
    _draw_arrow(axes, points[-4], points[-1], colour)


def _draw_name(axes: Axes, name: str, point: Array, away: Array, colour: str = INK) -> None:
    """Draw a name beside a point (3,), on the side that turns away from another (3,)."""
    out = _VIEW.places(point - away)
    x, y = _VIEW.places(point) + 0.13 * out / np.linalg.norm(out)
    axes.text(
        x, y, name, color=colour, fontsize=14, ha="center", va="center", path_effects=halo(),
        zorder=9,
    )  # fmt: skip


def _draw_floor(axes: Axes, points: Array) -> None:
    """Draw the plane's square grid under points (n, 2)."""
    low, high = np.floor(points.min(axis=0)) - 1.0, np.ceil(points.max(axis=0)) + 1.0
    for axis in (0, 1):
        for at in np.arange(low[axis], high[axis] + 0.5):
            line = np.zeros((2, 3))
            line[:, axis], line[:, 1 - axis] = at, (low[1 - axis], high[1 - axis])
            axes.plot(*_VIEW.places(line).T, color=FAINT, linewidth=0.6, alpha=0.7, zorder=0)


def _outermost(body: _Solid, centre: Array, axis: Array) -> Array:
    """Return the point (3,) of a body's surface that is farthest out, across an axis (3,).

    There is one on either side in the picture; the one nearer to the viewer is taken.
    """
    points = body.corners.reshape(-1, 3)
    out = (points - centre) @ np.cross(axis, _VIEW.axes[2])
    ends = points[[np.argmax(out), np.argmin(out)]]
    return ends[np.argmax(_VIEW.depth(ends))]


def _draw_names(axes: Axes, centre: Array, anchors: Mapping[str, Array]) -> None:
    """Write names on a ring around the ball, each in the direction of its point (3,).

    The shell is everywhere, so its name is where most room is left. C stands at the centre.
    """
    middle = _VIEW.places(centre)
    places = {name: _VIEW.places(point) for name, point in anchors.items()}
    free = np.array([np.cos(_FREE), np.sin(_FREE)])
    for name, place in {**places, "shell": middle + free}.items():
        out = (place - middle) / np.linalg.norm(place - middle)
        line = np.stack([place, middle + (_NAMES_AT - 0.04) * out])
        axes.plot(*line.T, color=INK, linewidth=0.8, zorder=7)
        across = "left" if out[0] > 0.2 else "right" if out[0] < -0.2 else "center"
        along = "center" if across != "center" else "bottom" if out[1] > 0 else "top"
        x, y = middle + _NAMES_AT * out
        axes.text(x, y, name, ha=across, va=along, fontsize=12, color=INK)
    axes.plot(*middle, "o", color=INK, markersize=4, zorder=8)
    _draw_name(axes, "C", centre, centre - _VIEW.axes[0] - _VIEW.axes[1])
    axes.set(xlim=(middle[0] - 2.1, middle[0] + 2.1), ylim=(middle[1] - 1.55, middle[1] + 1.55))
