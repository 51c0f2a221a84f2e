"""The sheet that all pictures of the paper's figures are drawn on, both motions, and their lines.

Points in space are seen from far away: an orthographic view, with their depth.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from robotball import ContactMotion, Motion, Scene, SceneWarning, load_scene, preset
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.reduced import LABEL as EQUATIONS
from robotball.film.looks import INK
from robotball.rotations import Array
from validation.output import together

# The one place that knows which engine is drawn over the theory, and in which colour.
ENGINE_NAME, ENGINE_COLOUR, THEORY = LABEL.name, LABEL.colour, EQUATIONS.colour
THEORY_LINE: dict[str, Any] = {"color": THEORY, "linewidth": 4.5, "alpha": 0.55}
ENGINE_LINE: dict[str, Any] = {"color": ENGINE_COLOUR, "linewidth": 1.1}
# Over the same line of the equations, which shows between the dashes.
ENGINE_OVER: dict[str, Any] = {"color": ENGINE_COLOUR, "linewidth": 1.7, "linestyle": (0, (3, 3))}
FAINT = "#9AA0A6"  # what is neither engine's: fields, boundaries
_TEXT_WIDE, _LINE_HIGH = 3.7, 0.21  # inches
_LETTERS = 44  # of a line of text, at most
UNBUILDABLE = "Mass outside the shell: not to be built."


def sheet(
    title: str,
    caption: Sequence[str],
    facts: Sequence[str],
    panels: Sequence[Sequence[str]],
    widths: Sequence[float],
    heights: Sequence[float] = (4.8,),
) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure with panels by their names, row by row, and its text on the right.

    caption: what the paper's caption gives, and what was chosen; facts: what is so, corrected, both
    in paragraphs; widths, heights: of the columns and the rows [inches]. A name that stands in
    several places is one panel over all of them.
    """
    # The text has a panel of its own, as a caption of a dozen lines fits below no picture.
    size = (sum(widths) + _TEXT_WIDE, sum(heights) + 0.4)
    figure = Figure(figsize=size, layout=ConstrainedLayoutEngine(h_pad=0.1))
    figure.suptitle(title, color=INK, fontsize=14)
    axes: dict[str, Axes] = figure.subplot_mosaic(
        [[*row, "text"] for row in panels],
        width_ratios=[*widths, _TEXT_WIDE],
        height_ratios=list(heights),
    )
    text = axes.pop("text")
    text.axis("off")
    lines = list[str]()
    for paragraph in ("Parameters", *caption, "", "Facts", *facts):
        lines += wrap(together(paragraph), _LETTERS, subsequent_indent="  ") or [""]
    style: dict[str, Any] = {"transform": text.transAxes, "color": INK, "fontsize": 10, "va": "top"}
    for i, line in enumerate(lines):
        height = 1.0 - (0.1 + _LINE_HIGH * i) / sum(heights)
        weight = "bold" if line in ("Parameters", "Facts") else "normal"
        text.text(0.02, height, line, fontweight=weight, **style)
    for each in axes.values():
        each.grid(alpha=0.3)
    return figure, axes


@cache
def paper_scene(name: str) -> Scene:
    """Load a scene of the catalog without its warnings; the figures' facts repeat them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        return load_scene(name)


def engine_motion(scene: Scene, times: Array, settings: str = "balanced") -> ContactMotion:
    """Return the engine's motion, by a preset."""
    return run(build(scene, preset(settings)), times)


def draw_paths(axes: Axes, theory: Motion, engine: Motion, title: str) -> None:
    """Draw both contact points' paths over the plane, to one scale."""
    axes.plot(*theory.contact_point.T, **THEORY_LINE, label="equations")
    axes.plot(*engine.contact_point.T, **ENGINE_OVER, label=ENGINE_NAME)
    axes.plot(*theory.contact_point[0], "o", color=INK, markersize=5, label="start")
    axes.set(xlabel="X [m]", ylabel="Y [m]", title=title)
    # A path is a shape: its circles must be round. The limits give way, as the panel's size is set
    # by the sheet.
    axes.set_aspect("equal", adjustable="datalim")


@dataclass(frozen=True)
class View:
    """An orthographic view: azimuth of the viewer from the first axis, and elevation [degrees]."""

    azimuth: float
    elevation: float

    @cached_property
    def axes(self) -> Array:
        """(3, 3): the picture's right, its up, and the direction to the viewer."""
        turn, rise = np.radians([self.azimuth, self.elevation])
        toward = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
        right = np.array([-np.sin(turn), np.cos(turn), 0.0])
        return np.stack([right, np.cross(toward, right), toward])

    def places(self, points: Array) -> Array:
        """Return where points (..., 3) are in the picture, (..., 2)."""
        return points @ self.axes[:2].T

    def depth(self, points: Array) -> Array:
        """Return how near points (..., 3) are to the viewer, (...,)."""
        return points @ self.axes[2]
