"""Figs 12 to 14: motion on the attractors of Fig. 11, and how the engines part."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball import Motion, load_scene, sample_times
from robotball.film.looks import INK
from robotball.scene import Scene
from validation.figures import (
    ENGINE_COLOUR,
    ENGINE_NAME,
    View,
    draw_paths,
    engine_motion,
    sheet,
)
from validation.figures.attractor_sections import caption_of
from validation.figures.sphere import Globe, draw_gamma
from validation.study import compiled_motion

_VIEW = View(azimuth=40.0, elevation=25.0)
_DRIFT_FACTS = (
    "  none along Y: the attractors are the same",
    "  under (γ,M) → -(γ,M), which flips dY/dt.",
    "The axis OX points opposite to M.",
)


def figure12() -> Figure:
    """Draw γ and the path on the limit cycle."""
    facts = (
        "Near the periodic orbit of Fig. 11a:",
        "dX/dt = 3.65907 m/s in the mean,",
        *_DRIFT_FACTS,
    )
    return _sphere_and_path(12, "(L, l) = (3.6, 0.6)", "on the limit cycle", facts)


def figure13() -> Figure:
    """Draw γ and the path on the limit torus."""
    facts = ("Near the limit torus of Fig. 11a:", "dX/dt = 3.665 m/s in the mean,", *_DRIFT_FACTS)
    return _sphere_and_path(13, "(L, l) = (0, 1.96)", "on the limit torus", facts)


def _sphere_and_path(number: int, start: str, where: str, facts: tuple[str, ...]) -> Figure:
    """Draw the two panels of Figs 12 and 13, and below how far apart the engines are."""
    scene, duration = load_scene(f"fig{number}"), 40.0
    caption = (*caption_of(scene), f"start: {start}", f"Duration chosen: {duration:g} s.")
    figure, axes = sheet(
        f"Fig. {number}: motion {where}",
        caption, facts, [["sphere", "apart"], ["plane", "plane"]], (5.2, 5.2), (4.8, 3.6),
    )  # fmt: skip
    theory = _draw_long_paths(axes, scene, duration)
    globe = Globe(axes["sphere"], _VIEW, f"vertical γ on the Poisson sphere, {duration:g} s")
    draw_gamma(globe, theory, engine_motion(scene, theory.times))
    return figure


def figure14() -> Figure:
    """Draw the path on the strange attractor, and how the engines part on it."""
    scene, duration, exponent = load_scene("fig14"), 160.0, 0.116
    caption = (*caption_of(scene), "start: (L, l) = (0, 0.6)", f"Duration chosen: {duration:g} s.")
    facts = (
        "On the strange attractor of Fig. 11b, not",
        "  on a limit cycle (E22).",
        "dX/dt = 3.276 m/s in the mean,",
        *_DRIFT_FACTS,
        f"Chaos: errors grow as exp({exponent:g} t) (dotted),",
        "  so beyond some time both motions are",
        "  right, and different.",
    )
    figure, axes = sheet(
        "Fig. 14: the contact point on the strange attractor",
        caption, facts, [["plane"], ["apart"]], (10.4,), (4.6, 3.4),
    )  # fmt: skip
    times = _draw_long_paths(axes, scene, duration).times
    axes["apart"].semilogy(times, 3e-8 * np.exp(exponent * times), ":", color=INK, linewidth=1.5)
    return figure


def _draw_long_paths(panels: Mapping[str, Axes], scene: Scene, duration: float) -> Motion:
    """Draw both contact points, and by three presets the engine's distance from the equations'."""
    axes, theory = panels["plane"], compiled_motion(scene, sample_times(duration))
    engine = engine_motion(scene, theory.times)
    draw_paths(axes, theory, engine, f"contact point, {duration:g} s (X and Y to unlike scales)")
    # Stretched in width, as a long path is not seen otherwise.
    axes.set_aspect("auto")
    axes.margins(y=0.25)
    axes.legend(loc="upper center", ncols=3)
    axes, times = panels["apart"], theory.times
    for style, name in (("-.", "fast"), ("--", "balanced"), ("-", "accurate")):
        points = engine_motion(scene, times, name).contact_point
        distance = np.linalg.norm(points - theory.contact_point, axis=1)
        axes.semilogy(times[1:], distance[1:], style, color=ENGINE_COLOUR, linewidth=1, label=name)
    title = f"contact points: {ENGINE_NAME} from the equations"
    axes.set(xlabel="time [s]", ylabel="distance [m]", title=title)
    axes.legend(loc="lower right", ncols=3, fontsize=9)
    return theory
