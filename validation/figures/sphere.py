"""The Poisson sphere of γ, drawn twice: as a ball seen from afar, and unrolled (the involute)."""

from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes

from robotball.palette import INK
from robotball.rotations import Array
from validation.figures.parts import ENGINE_LINE, FAINT, THEORY_LINE
from validation.figures.view import View
from validation.output import halo

POLES = 0.62 * np.pi  # φ, where a pole's mark stands on the involute
BACK_ALPHA, BACK_WIDTH = 0.3, 0.7  # of what lies on the far side of the ball


TRIAD: dict[str, Any] = {"arrowstyle": "-|>", "color": INK, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
NAME: dict[str, Any] = {
    "color": INK,
    "fontsize": 12,
    "xytext": (7, 7),
    "textcoords": "offset points",
    "path_effects": halo(),
    "zorder": 8,
}


class Chart(Protocol):
    """A picture of the sphere, to draw lines, marks and names on."""

    axes: Axes

    def line(self, gamma: Array, **style: Any) -> None:
        """A line through γ (n, 3)."""

    def marks(self, gamma: Array, mark: str, **style: Any) -> None:
        """A mark at each γ (n, 3)."""

    def name(self, gamma: Array, text: str, **style: Any) -> None:
        """A name beside γ (3,)."""

    def arrow(self, gamma: Array, colour: str) -> None:
        """An arrow head halfway along a line γ (n, 3), where that is in sight."""


class Globe:
    """The sphere as a ball: the far side is pale, and bears no names."""

    def __init__(self, axes: Axes, view: View, title: str) -> None:
        self.axes, self.view = axes, view
        bare(axes, title)
        turn = np.linspace(0, 2 * np.pi, 400)
        axes.fill(np.cos(turn), np.sin(turn), facecolor="#F4F6F8", edgecolor=FAINT, zorder=0)
        equator = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
        self.line(equator, color=FAINT, linewidth=0.8, linestyle=":")
        for i, tip in enumerate(0.2 * view.places(np.eye(3))):
            (x, y), longer = tip, 1 + 0.07 / max(float(np.linalg.norm(tip)), 0.05)
            axes.annotate("", (x - 1.0, y - 1.0), (-1.0, -1.0), arrowprops=TRIAD)
            x, y = longer * x - 1.0, longer * y - 1.0
            axes.text(x, y, f"γ{'₁₂₃'[i]}", color=INK, ha="center", va="center", fontsize=9)
        axes.set(xlim=(-1.2, 1.2), ylim=(-1.2, 1.2))
        axes.set_aspect("equal")

    def line(self, gamma: Array, **style: Any) -> None:
        """A line through γ (n, 3), pale behind."""
        front, places = self.view.depth(gamma) >= 0, self.view.places(gamma)
        # Both parts have the sample at which the line turns round the rim.
        changes = np.flatnonzero(front[1:] != front[:-1])
        for side, alpha, width in ((front, 1.0, 1.0), (~front, BACK_ALPHA, BACK_WIDTH)):
            shown = side.copy()
            shown[changes], shown[changes + 1] = True, True
            own = {
                **style,
                "alpha": style.get("alpha", 1.0) * alpha,
                "linewidth": style.get("linewidth", 1.5) * width,
            }
            if alpha < 1:
                own.pop("label", None)
            self.axes.plot(*np.where(shown[:, None], places, np.nan).T, **own)

    def marks(self, gamma: Array, mark: str, **style: Any) -> None:
        """A mark at each γ (n, 3), pale behind."""
        front, places = self.view.depth(gamma) >= 0, self.view.places(gamma)
        for side, alpha in ((front, 1.0), (~front, BACK_ALPHA)):
            if side.any():
                own = style if alpha == 1 else {**style, "label": None, "zorder": 1.5}
                self.axes.plot(*places[side].T, mark, linestyle="none", alpha=alpha, **own)

    def name(self, gamma: Array, text: str, **style: Any) -> None:
        """A name beside γ (3,), if it is in front."""
        if self.view.depth(gamma) >= 0:
            self.axes.annotate(text, self.view.place(gamma), **{**NAME, **style})

    def arrow(self, gamma: Array, colour: str) -> None:
        """An arrow head halfway along a line γ (n, 3), if that is in front."""
        if self.view.depth(gamma[len(gamma) // 2]) > 0.1:
            arrow_head(self.axes, self.view.places(gamma), colour)


class Involute:
    """The sphere unrolled: φ = π/4 + arctan(γ₁/γ₂) once round, and γ₃ up; it keeps areas."""

    def __init__(self, axes: Axes, title: str) -> None:
        self.axes = axes
        axes.set(xlim=(0, 2 * np.pi), ylim=(-1.04, 1.04), title=title)
        axes.set(xlabel="φ = π/4 + arctan(γ₁/γ₂) [rad], once round", ylabel="γ₃")
        axes.set_xticks(np.pi / 4 * np.arange(9))
        axes.set_xticklabels(["0", "π/4", "π/2", "3π/4", "π", "5π/4", "3π/2", "7π/4", "2π"])
        axes.grid(alpha=0.3)

    def places(self, gamma: Array) -> Array:
        """Where γ (..., 3) is, (..., 2); arctan(γ₁/γ₂) is the angle from γ₂ towards γ₁.

        A pole is a whole edge: it is shown at POLES.
        """
        phi = (np.pi / 4 + np.arctan2(gamma[..., 0], gamma[..., 1])) % (2 * np.pi)
        polar = np.hypot(gamma[..., 0], gamma[..., 1]) < 1e-9
        return np.stack([np.where(polar, POLES, phi), gamma[..., 2]], axis=-1)

    def line(self, gamma: Array, **style: Any) -> None:
        """A line through γ (n, 3), broken where it is cut open."""
        places = self.places(gamma)
        jumps = np.flatnonzero(np.abs(np.diff(places[:, 0])) > np.pi) + 1
        self.axes.plot(*np.insert(places, jumps, np.nan, axis=0).T, **style)

    def marks(self, gamma: Array, mark: str, **style: Any) -> None:
        """A mark at each γ (n, 3)."""
        self.axes.plot(*self.places(gamma).T, mark, linestyle="none", clip_on=False, **style)

    def name(self, gamma: Array, text: str, **style: Any) -> None:
        """A name beside γ (3,)."""
        x, y = self.places(gamma).tolist()
        down = {"xytext": (8, -15)} if y > 0.9 else {}
        self.axes.annotate(text, (x, y), annotation_clip=False, **{**NAME, **down, **style})

    def arrow(self, gamma: Array, colour: str) -> None:
        """An arrow head halfway along a line γ (n, 3)."""
        arrow_head(self.axes, self.places(gamma), colour)


def draw_gamma(chart: Chart, theory: Array, engine: Array) -> None:
    """γ (n, 3) of both motions."""
    chart.line(theory, **THEORY_LINE, zorder=4)
    chart.line(engine, **ENGINE_LINE, zorder=5)
    chart.marks(theory[:1], "o", color=INK, markersize=5, zorder=5)


def bare(axes: Axes, title: str) -> None:
    """No frame, ticks or grid."""
    axes.set_title(title)
    axes.grid(visible=False)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)


def arrow_head(axes: Axes, places: Array, colour: str) -> None:
    """An arrow head halfway along a line (n, 2)."""
    k = len(places) // 2
    step = np.linalg.norm(places[k] - places[k - 1]) if k else 0.0
    if 1e-6 < step < 1:
        axes.annotate(
            "", places[k], places[k - 1], annotation_clip=True,
            arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 0},
        )  # fmt: skip
