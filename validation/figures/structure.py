"""Figs 3 and 4: the structure of the ball and its axes, as the film's renderer draws them.

MuJoCo draws the bodies, the floor and the arrows; lines and names are drawn over its picture, where
the camera sees their points. The unit of length is the ball's radius.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball import InputError, Motion, integrate, sample_times
from robotball.film import gl
from robotball.film.looks import INK, looks_of
from robotball.film.stage import Arrow, Camera, Stage
from robotball.film.tracks import track_of
from robotball.rotations import Array, Z, rotation_matrix, z_along
from validation.figures import (
    ENGINE_LINE,
    ENGINE_NAME,
    THEORY_LINE,
    engine_motion,
    paper_scene,
    sheet,
)
from validation.output import halo

_SCENE = "fig12"  # one rotor, and mass inside the shell only
_ROLLED = 0.8  # s, before Fig. 4
_SIZE = 960, 1360  # pixels of a picture
_PANEL = 6.8  # inches of the sheet that it takes
_STEEL = "#5A7A9A"  # the shell, in no engine's colour
_FRAME_AXES, _OMEGA, _ROTOR_AXIS = "#117733", "#CC3311", "#8A5A00"


def figure3() -> Figure:
    """Draw the ball of Fig. 12 at its start: shell, frame and one rotor, and their axes."""
    scene = paper_scene(_SCENE)
    ball, rates = scene.ball, [float(drive.rate(0.0)) for drive in scene.drives]
    caption = (
        "one rotor, n = 1: the ball of Fig. 12 at its start, drawn from its bodies",
        f"shell {ball.shell.mass:g} kg, frame {ball.frame.mass:.4g} kg, rotor "
        f"{ball.rotors[0].mass:.4g} kg, a = {ball.radius:g} m",
        f"Ω = {rates[0]:g} rad/s, φ̇₁ = {rates[1]:.4g} rad/s",
    )
    facts = (
        "The shell rolls on the plane.",
        "The frame turns in the shell about the shell's axis of symmetry, at Ω(t).",
        "The rotor turns on the frame about its own axis n₁, at φ̇₁(t).",
        "All centres of mass are at C, the centre of the sphere. How the bodies share the inertia "
        "is chosen: the paper gives A and K.",
    )
    title = "Fig. 3: structure of the ball, for one rotor"
    figure, panels = sheet(title, caption, facts, [["ball"]], (_PANEL,))
    axes = panels["ball"]
    # Both axes come towards the viewer, so that a turn about each is seen.
    camera = Camera(np.array([-0.2, -0.25, 0.92]), 4.6, azimuth=2.34, elevation=0.18)
    attitude = scene.start.to_world
    shell_axis, rotor_axis = attitude @ ball.shell.axis, attitude @ ball.rotors[0].axis
    arrows = [
        (Z + 1.02 * shell_axis, Z + 1.5 * shell_axis, _OMEGA),
        (Z, Z + 0.9 * rotor_axis, _ROTOR_AXIS),
    ]
    _draw_ball(axes, integrate(scene, sample_times(_ROLLED)), 0.0, camera, arrows)
    _draw_sense(axes, camera, Z + 1.2 * shell_axis, shell_axis, _OMEGA)
    _draw_sense(axes, camera, Z + 0.7 * rotor_axis, rotor_axis, _ROTOR_AXIS)
    weight = attitude @ rotation_matrix(z_along(ball.shell.axis))[:, 0]  # on the frame's hoop
    down = np.cross(np.cross(Z, rotor_axis), rotor_axis)
    side = np.cross(camera.eye, Z) / np.hypot(*camera.eye[:2])
    for name, point, place in (
        ("Ω(t): the shell's axis,\nabout which the frame turns", Z + 1.3 * shell_axis, (0.8, 0.3)),
        ("n₁: the rotor's axis,\nit turns at φ̇₁(t)", Z + 0.88 * rotor_axis, (0.83, 0.52)),
        ("frame", Z + 0.82 * weight, (0.55, 0.93)),
        ("rotor", Z + 0.5 * down, (0.24, 0.06)),
        ("shell", Z + side, (0.06, 0.62)),
    ):
        _draw_name(axes, camera, name, point, place)
    _draw_name(axes, camera, "C", Z)
    return figure


def figure4() -> Figure:
    """Draw the ball of Fig. 12 after a while on the plane: the axes of space and of the frame."""
    scene, times = paper_scene(_SCENE), sample_times(_ROLLED)
    theory, engine = integrate(scene, times), engine_motion(scene, times)
    frame, a = rotation_matrix(theory.attitude[-1]), scene.ball.radius
    caption = (
        f"the ball of Fig. 12 after {_ROLLED:g} s, drawn from its bodies and its motion",
        "O: where it started, X = Y = 0",
        "P: X = {:.4f} m, Y = {:.4f} m".format(*theory.contact_point[-1]),
    )
    facts = (
        "OXYZ stands still; OZ is vertical.",
        "C x₁x₂x₃ turns with the frame, not with the shell: seen from it all mass stands still. "
        "These are principal axes of the inertia.",
        "P: where the shell touches the plane.",
        "α, β, γ: OX, OY, OZ as seen from the frame; here γ = ({:.4f}, {:.4f}, {:.4f}).".format(
            *frame[2]
        ),
    )
    title = "Fig. 4: the ball on the plane, and its axes"
    figure, panels = sheet(title, caption, facts, [["ball"]], (_PANEL,))
    axes, origin = panels["ball"], np.zeros(3)
    foot = np.append(theory.contact_point[-1] / a, 0.0)
    centre = foot + Z
    camera = Camera(0.5 * foot + 0.8 * Z, 6.5, azimuth=2.29, elevation=0.28)
    tips = {name: (origin, 1.3 * axis, INK) for name, axis in zip("XYZ", np.eye(3), strict=True)}
    for name, axis in zip(("x₁", "x₂", "x₃"), frame.T, strict=True):
        tips[name] = (centre, centre + 1.5 * axis, _FRAME_AXES)
    _draw_ball(axes, theory, _ROLLED, camera, [*tips.values()])
    for motion, style, name in (
        (theory, THEORY_LINE, "contact point, equations"),
        (engine, ENGINE_LINE, f"contact point, {ENGINE_NAME}"),
    ):
        path = np.column_stack([motion.contact_point / a, np.zeros(len(times))])
        axes.plot(*_seen(camera, path).T, **style, label=name)
    axes.plot(*_seen(camera, np.stack([foot, centre])).T, "o:", color=INK, markersize=4)
    for name, (begin, end, colour) in tips.items():
        _draw_name(axes, camera, name, end + 0.12 * (end - begin), color=colour)
    for name, point in (("P", foot), ("O", origin), ("C", centre)):
        _draw_name(axes, camera, name, point - 0.13 * Z)
    axes.legend(loc="lower left", fontsize=10)
    return figure


def _draw_ball(
    axes: Axes, motion: Motion, time: float, camera: Camera, arrows: Sequence[Arrow]
) -> None:
    """Draw the bodies of a motion's ball as they are at a time [s], and arrows in space.

    Raises InputError if there is no off-screen GL.
    """
    # Asked first, as MuJoCo's own error where there is no GL says nothing of what to install.
    backend, track = gl.find_backend(), track_of(motion)
    if backend is None:
        raise InputError(gl.advice())
    looks, stands = looks_of(motion.scene.ball), track.stands(track.at(np.array([time])))
    stage = Stage(_SIZE, looks, [_STEEL], [track.points], camera.distance, backend)
    try:
        stage.place([stands], [dict.fromkeys(track.names, 0.0)])
        axes.imshow(stage.draw(camera, [1.0], [0.0], 0, arrows))
    finally:
        stage.close()
    axes.set_axis_off()
    # Lines over the picture are in its pixels, and must not rescale it.
    axes.autoscale(enable=False)


def _seen(camera: Camera, points: Array) -> Array:
    """Return where points (n, 3) are in the picture, (n, 2) pixels."""
    return np.array([camera.seen(point, _SIZE)[:2] for point in points])


def _draw_sense(axes: Axes, camera: Camera, middle: Array, axis: Array, colour: str) -> None:
    """Draw a curved arrow about an axis (3,), in the sense of a turn about it."""
    side = np.cross(axis, camera.eye)
    side /= np.linalg.norm(side)
    # An open ring, whose gap shows where the arrow ends.
    turn = np.linspace(0.15, 0.85, 60)[:, None] * 2 * np.pi
    ring = 0.2 * (np.cos(turn) * np.cross(axis, side) - np.sin(turn) * side)
    points = _seen(camera, middle + ring)
    axes.plot(*points[:-3].T, color=colour, linewidth=2)
    head = {"arrowstyle": "-|>", "color": colour, "mutation_scale": 15, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", points[-1].tolist(), points[-4].tolist(), arrowprops=head)


def _draw_name(
    axes: Axes,
    camera: Camera,
    name: str,
    point: Array,
    place: tuple[float, float] | None = None,
    **style: Any,
) -> None:
    """Write a name at a point (3,), or at a place of the panel with a line to the point."""
    style = {"color": INK, "ha": "center", "va": "center", "path_effects": halo(), **style}
    (at,) = _seen(camera, point[None]).tolist()
    if place is None:
        axes.text(at[0], at[1], name, fontsize=14, **style)
    else:
        line = {"arrowstyle": "-", "color": INK, "linewidth": 0.8, "shrinkB": 0}
        axes.annotate(
            name, at, place, textcoords="axes fraction", arrowprops=line, fontsize=12, **style
        )
