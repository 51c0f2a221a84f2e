"""What the pictures of the paper's figures share: the sheet, the two engines' lines, the sphere."""

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball import Motion, Scene, load_scene
from robotball.engines.reduced.compiled.kernels import orbit
from robotball.errors import SceneWarning
from robotball.palette import ENGINE, INK, THEORY
from robotball.rotations import Array, multiply

ENGINE_NAME = "MuJoCo"
THEORY_LINE: dict[str, Any] = {"color": THEORY, "linewidth": 4.5, "alpha": 0.55}
ENGINE_LINE: dict[str, Any] = {"color": ENGINE, "linewidth": 1.1}
FAINT = "#9AA0A6"  # what is neither engine's: fields, boundaries
HALO = [patheffects.withStroke(linewidth=3, foreground="white")]
INCHES_HIGH, TEXT_WIDE = 5.6, 3.6
UNBUILDABLE = "Mass outside the shell: not to be built."
JUMP = 0.5  # of the disc: a longer step has gone round its rim


def sheet(
    title: str, caption: Sequence[str], facts: Sequence[str], widths: Sequence[float]
) -> tuple[Figure, list[Axes]]:
    """A figure with panels of these widths [inches] side by side, and its text on the right.

    caption: what the paper's caption gives, and what was chosen; facts: what is so, corrected.
    """
    figure = Figure(figsize=(sum(widths) + TEXT_WIDE, INCHES_HIGH), layout="constrained")
    figure.suptitle(title, color=INK, fontsize=14)
    *panels, text = figure.subplots(1, len(widths) + 1, width_ratios=[*widths, TEXT_WIDE])
    text.axis("off")
    lines = ["Parameters", *caption, "", "Facts", *facts]
    for i, line in enumerate(lines):
        text.text(
            0.02,
            0.97 - 0.052 * i,
            line,
            transform=text.transAxes,
            color=INK,
            fontsize=10,
            fontweight="bold" if line in ("Parameters", "Facts") else "normal",
            va="top",
        )
    for axes in panels:
        axes.grid(alpha=0.3)
    return figure, list(panels)


def paper_scene(name: str) -> Scene:
    """A scene of the catalog, without a warning of what its picture says: it cannot be built."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        return load_scene(name)


def theory_motion(scene: Scene, times: Array) -> tuple[Array, Array]:
    """Attitudes (n, 4) in principal axes and contact points (n, 2), by the compiled stepper."""
    attitude = multiply(scene.start.attitude, scene.principal_quaternion)
    return orbit(scene.parameters, attitude, scene.start.momentum, times)


def draw_paths(axes: Axes, theory: Array, engine: Motion, title: str = "contact point") -> None:
    """Both contact points' paths over the plane, to one scale; theory (n, 2)."""
    axes.plot(*theory.T, **THEORY_LINE, label="equations")
    axes.plot(*engine.contact_point.T, **ENGINE_LINE, label="MuJoCo")
    axes.plot(*theory[0], "o", color=INK, markersize=5, label="start")
    axes.set(xlabel="X [m]", ylabel="Y [m]", title=title)
    axes.set_aspect("equal", adjustable="datalim")


def disc(axes: Axes, title: str) -> None:
    """The sphere of γ as a disc: its upper half, equal areas kept, seen along e₃.

    Motion from rest is the same at γ and -γ, so half of the sphere is all of it.
    """
    turn = np.linspace(0, 2 * np.pi, 400)
    axes.plot(np.cos(turn), np.sin(turn), color=FAINT, linewidth=1)
    axes.set(xlim=(-1.06, 1.16), ylim=(-1.06, 1.06))
    axes.set_title(title, pad=18)
    axes.set_aspect("equal")
    axes.grid(visible=False)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)
    for name, place in (("γ₁", (1.03, -0.03)), ("γ₂", (-0.03, 1.03))):
        axes.annotate(name, place, color=INK, annotation_clip=False)


def on_disc(gamma: Array) -> Array:
    """Places (n, 2) on the disc of γ (n, 3) or -γ, whichever is up."""
    up = np.where(gamma[..., 2:] < 0, -gamma, gamma)
    return up[..., :2] / np.sqrt(1 + up[..., 2:])


def disc_line(axes: Axes, gamma: Array, **style: Any) -> None:
    """A line through γ (n, 3) on the disc, broken where it leaves at the rim and comes back."""
    places = on_disc(gamma)
    jumps = np.linalg.norm(np.diff(places, axis=0), axis=1) > JUMP
    places = np.insert(places, np.flatnonzero(jumps) + 1, np.nan, axis=0)
    axes.plot(*places.T, **style)


def arrow(axes: Axes, places: Array, colour: str) -> None:
    """An arrow head halfway along a line (n, 2)."""
    k = len(places) // 2
    if k and np.linalg.norm(places[k] - places[k - 1]) > 1e-6:
        axes.annotate(
            "", places[k], places[k - 1], arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 0}
        )
