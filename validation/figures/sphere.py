"""The Poisson sphere of γ, drawn twice: as a ball seen from afar, and unrolled (the involute).

On either chart stands the phase portrait of motion from rest, (4.1).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball import Motion
from robotball.engines.ensembles.orbits import orbits
from robotball.equations import Parameters
from robotball.film.looks import INK
from robotball.qualitative.cycles import Cycle
from robotball.qualitative.equilibria import (
    FixedCircle,
    FixedPoint,
    attitude_at,
    name_of,
    rate_scale,
)
from robotball.qualitative.portraits import (
    Separatrix,
    curve_of,
    lies_on,
    separatrices,
    spread_points,
)
from robotball.rotations import Array, rotation_matrix
from validation.figures import ENGINE_LINE, FAINT, THEORY_LINE, View
from validation.output import halo

_POLES = 0.62 * np.pi  # φ, where a pole's mark stands on the involute
_BACK_ALPHA, _BACK_WIDTH = 0.3, 0.7  # of what lies on the far side of the ball

_TRIAD: dict[str, Any] = {"arrowstyle": "-|>", "color": INK, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
_NAME: dict[str, Any] = {
    "color": INK, "fontsize": 12, "ha": "center", "va": "center",
    "textcoords": "offset points", "path_effects": halo(), "zorder": 8,
}  # fmt: skip


class Globe:
    """The sphere as a ball: the far side is pale, and its names are grey."""

    def __init__(self, axes: Axes, view: View, title: str) -> None:
        self.axes, self.view = axes, view
        axes.set(title=title, xticks=[], yticks=[], frame_on=False)
        axes.set(xlim=(-1.2, 1.2), ylim=(-1.2, 1.2), aspect="equal")
        axes.grid(visible=False)
        turn = np.linspace(0, 2 * np.pi, 400)
        axes.fill(np.cos(turn), np.sin(turn), facecolor="#F4F6F8", edgecolor=FAINT, zorder=0)
        equator = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
        self.line(equator, color=FAINT, linewidth=0.8, linestyle=":")
        for i, tip in enumerate(0.2 * view.places(np.eye(3))):
            (x, y), longer = tip, 1 + 0.07 / max(float(np.linalg.norm(tip)), 0.05)
            axes.annotate("", (x - 1.0, y - 1.0), (-1.0, -1.0), arrowprops=_TRIAD)
            x, y = longer * x - 1.0, longer * y - 1.0
            axes.text(x, y, f"γ{'₁₂₃'[i]}", color=INK, ha="center", va="center", fontsize=9)

    def line(self, gamma: Array, **style: Any) -> None:
        """Draw a line through γ (n, 3), pale behind."""
        front, places = self.view.depth(gamma) >= 0, self.view.places(gamma)
        # Both parts have the sample at which the line turns round the rim.
        changes = np.flatnonzero(front[1:] != front[:-1])
        for side, alpha, width in ((front, 1.0, 1.0), (~front, _BACK_ALPHA, _BACK_WIDTH)):
            shown = side.copy()
            shown[changes], shown[changes + 1] = True, True
            own = {"alpha": 1.0, "linewidth": 1.5, **style}
            own["alpha"], own["linewidth"] = own["alpha"] * alpha, own["linewidth"] * width
            own["label"] = style.get("label") if alpha == 1 else None
            self.axes.plot(*np.where(shown[:, None], places, np.nan).T, **own)

    def marks(self, gamma: Array, mark: str, **style: Any) -> None:
        """Draw a mark at each γ (n, 3), pale behind."""
        front, places = self.view.depth(gamma) >= 0, self.view.places(gamma)
        for side, alpha in ((front, 1.0), (~front, _BACK_ALPHA)):
            if side.any():
                own = style if alpha == 1 else {**style, "label": None, "zorder": 1.5}
                self.axes.plot(*places[side].T, mark, linestyle="none", alpha=alpha, **own)

    def name(self, gamma: Array, text: str, **style: Any) -> None:
        """Draw a name farther out than γ (3,), near the rim beyond it; grey if behind."""
        off = self.view.places(gamma)
        far = max(float(np.linalg.norm(off)), 0.1)
        out = off * (max(far + 0.15, 1.12) if far > 0.8 else far + 0.15) / far
        pale = {"color": "#777C82", "fontsize": 9} if self.view.depth(gamma) < 0 else {}
        beside: dict[str, Any] = {**_NAME, "xytext": out, "textcoords": "data", **style, **pale}
        self.axes.annotate(text, self.view.place(gamma), **beside)

    def arrow(self, gamma: Array, colour: str) -> None:
        """Draw an arrow head halfway along a line γ (n, 3), if that is in front."""
        if self.view.depth(gamma[len(gamma) // 2]) > 0.1:
            _arrow_head(self.axes, self.view.places(gamma), colour)


class Involute:
    """The sphere unrolled: φ = π/4 + arctan(γ₁/γ₂) once round, and γ₃ up; it keeps areas."""

    def __init__(self, axes: Axes, title: str) -> None:
        self.axes = axes
        axes.set(xlim=(0, 2 * np.pi), ylim=(-1.3, 1.3), title=title)
        axes.set(xlabel="φ = π/4 + arctan(γ₁/γ₂) [rad], once round", ylabel="γ₃")
        labels = ["0", "π/4", "π/2", "3π/4", "π", "5π/4", "3π/2", "7π/4", "2π"]
        axes.set_xticks(np.pi / 4 * np.arange(9), labels)
        axes.grid(alpha=0.3)

    def places(self, gamma: Array) -> Array:
        """Return the places (..., 2) of γ (..., 3); arctan(γ₁/γ₂) is the angle from γ₂ towards γ₁.

        A pole is a whole edge: it is shown at _POLES.
        """
        phi = (np.pi / 4 + np.arctan2(gamma[..., 0], gamma[..., 1])) % (2 * np.pi)
        # At a pole φ has no value, and rounding would choose one.
        polar = np.hypot(gamma[..., 0], gamma[..., 1]) < 1e-9
        return np.stack([np.where(polar, _POLES, phi), gamma[..., 2]], axis=-1)

    def line(self, gamma: Array, **style: Any) -> None:
        """Draw a line through γ (n, 3), broken where it is cut open."""
        places = self.places(gamma)
        # Else a line would run across the whole picture where φ starts anew.
        jumps = np.flatnonzero(np.abs(np.diff(places[:, 0])) > np.pi) + 1
        self.axes.plot(*np.insert(places, jumps, np.nan, axis=0).T, **style)

    def marks(self, gamma: Array, mark: str, **style: Any) -> None:
        """Draw a mark at each γ (n, 3)."""
        self.axes.plot(*self.places(gamma).T, mark, linestyle="none", clip_on=False, **style)

    def name(self, gamma: Array, text: str, **style: Any) -> None:
        """Draw a name beside γ (3,)."""
        x, y = self.places(gamma).tolist()
        # Near a pole the name would stand on the edge of the picture.
        away = (0, 12 * y) if abs(y) > 0.9 else (12, 9)
        self.axes.annotate(text, (x, y), **{**_NAME, "xytext": away, **style})

    def arrow(self, gamma: Array, colour: str) -> None:
        """Draw an arrow head halfway along a line γ (n, 3)."""
        _arrow_head(self.axes, self.places(gamma), colour)


_Chart = Globe | Involute


def both_charts(left: Axes, right: Axes) -> tuple[_Chart, _Chart]:
    """Return the sphere on both its charts."""
    return Globe(left, _VIEW, "vertical γ on the Poisson sphere"), Involute(right, "its involute")


def draw_gamma(chart: _Chart, theory: Motion, engine: Motion) -> None:
    """Draw γ of both motions, in principal axes."""
    gamma, ours = (each.gamma @ each.scene.principal_axes for each in (theory, engine))
    chart.line(gamma, **THEORY_LINE, zorder=4)
    chart.line(ours, **ENGINE_LINE, zorder=5)
    chart.marks(gamma[:1], "o", color=INK, markersize=5, zorder=5)


def _arrow_head(axes: Axes, places: Array, colour: str) -> None:
    """Draw an arrow head halfway along a line (n, 2)."""
    k = len(places) // 2
    step = np.linalg.norm(places[k] - places[k - 1]) if k else 0.0
    if 1e-6 < step < 1:
        axes.annotate(
            "", places[k], places[k - 1], annotation_clip=True,
            arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 0},
        )  # fmt: skip


# Filled is stable, open is not; in grey, too.
_MARKS = {
    "saddle": ("X", "white"),
    "stable focus": ("o", INK),
    "slow stable focus": ("D", INK),
    "centre": ("P", "white"),
    "unstable focus": ("o", "white"),
    "slow unstable focus": ("D", "white"),
    "stable node": ("s", INK),
    "unstable node": ("s", "white"),
    "degenerate": ("*", "white"),
}
_CYCLE: dict[str, Any] = {"color": "#3344DD", "linewidth": 3.2, "zorder": 3}  # the captions' blue
_SIDES = (  # of the circle of fixed points
    ("#117733", "-", r"$\Sigma_s$, attracts"),
    ("#AA4499", (0, (2.5, 1.2)), r"$\Sigma_u$, repels"),
)
_STARTS_DRAWN = 44
_DRAWN = 5.0  # rad, of a manifold
FOLLOWED = 400.0  # s, for a manifold
_FIELD_TURNS = 18.0  # rad, by the rates of the flow, of each pale orbit
_VIEW = View(azimuth=138.0, elevation=28.0)


def draw_field(chart: _Chart, parameters: Parameters, duration: float) -> None:
    """Draw pale orbits with arrows from points all over the sphere, each for a duration [s]."""
    starts = spread_points(_STARTS_DRAWN)
    attitudes = attitude_at(starts)
    times = np.linspace(0.0, duration, 800)
    found = orbits(parameters, attitudes, np.zeros((len(starts), 3)), times, 1e-10)
    for each in found.attitudes:
        gamma = rotation_matrix(each)[:, 2]
        chart.line(gamma, color=FAINT, linewidth=0.6, zorder=1, label=_once(chart, "other orbits"))
        length = np.cumsum(np.linalg.norm(np.diff(gamma, axis=0), axis=1))
        if length[-1] > 0.2:
            k = int(np.searchsorted(length, min(0.2, length[-1] / 2))) + 1
            chart.arrow(gamma[: 2 * k], FAINT)


def draw_points(chart: _Chart, parameters: Parameters, points: Sequence[FixedPoint]) -> None:
    """Draw a mark at each fixed point, by its type, with the paper's name where it has one."""
    for kind in dict.fromkeys(point.kind for point in points):
        mark, fill = _MARKS[kind]
        places = np.array([point.gamma for point in points if point.kind == kind])
        chart.marks(places, mark, color=fill, markeredgecolor=INK, markersize=8, label=kind,
                    zorder=6)  # fmt: skip
    for point in points:
        chart.name(point.gamma, name_of(parameters, point.gamma))


def draw_circle(chart: _Chart, circle: FixedCircle) -> None:
    """Draw the circle of fixed points: Σ_s solid, Σ_u dashed."""
    quarter = np.linspace(0.0, np.pi / 2, 100)
    for k in range(4):
        colour, dashes, name = _SIDES[k % 2]
        chart.line(circle.at(quarter + k * np.pi / 2), color=colour, linestyle=dashes,
                   linewidth=2.6, label=_once(chart, name), zorder=4)  # fmt: skip


def draw_separatrices(
    chart: _Chart, found: Sequence[Separatrix], contour: Sequence[Separatrix]
) -> None:
    """Draw the saddles' manifolds; those of a closed contour in the colour of a cycle."""
    for each in contour:
        chart.line(each.path, label=_once(chart, "closed contour"), **_CYCLE)
    rest = [each for each in found if not any(each is other for other in contour)]
    # Stable ones first, so that the legends of all figures have one order.
    for each in sorted(rest, key=lambda each: not each.stable):
        word, dashes = ("stable", (0, (4, 1.5))) if each.stable else ("unstable", "-")
        label = _once(chart, f"{word} manifolds of the saddles")
        chart.line(_beginning(each.path), color=INK, linewidth=0.9, linestyle=dashes,
                   label=label, zorder=2)  # fmt: skip


def _once(chart: _Chart, label: str) -> str | None:
    """Return a label the first time that a chart is given it: its legend has each once."""
    return None if label in chart.axes.get_legend_handles_labels()[1] else label


def _beginning(path: Array) -> Array:
    """Return the first radians of a line γ (n, 3) on the sphere: later it winds round a focus."""
    lengths = np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))
    return path[: int(np.searchsorted(lengths, _DRAWN)) + 2]


def draw_cycles(chart: _Chart, parameters: Parameters, cycles: Sequence[Cycle]) -> None:
    """Draw limit cycles: solid where they attract, dashed where they repel."""
    for cycle in cycles:
        curve = curve_of(parameters, cycle.gamma, cycle.period)
        word, dashes = ("stable", "-") if abs(cycle.multipliers[0]) < 1 else ("unstable", "--")
        # A cycle that is not its own opposite has one, as γ → -γ is a symmetry (Remark 6).
        for each in (curve,) if lies_on(-cycle.gamma, curve) else (curve, -curve):
            label = _once(chart, f"{word} limit cycle")
            chart.line(each, linestyle=dashes, alpha=0.7, label=label, **_CYCLE)


def portrait(
    title: str,
    parameters: Parameters,
    points: Sequence[FixedPoint],
    circle: FixedCircle | None,
    cycles: Sequence[Cycle],
) -> Figure:
    """Draw all that stands still or repeats on the sphere and on its involute, without a motion."""
    figure = Figure(figsize=(13.0, 5.8), layout="constrained")
    figure.suptitle(f"{title}: fixed points and limit cycles from rest", color=INK)
    left, right = figure.subplots(1, 2, width_ratios=[4.6, 8.4])
    manifolds = separatrices(parameters, points, FOLLOWED)
    for chart in both_charts(left, right):
        draw_field(chart, parameters, _FIELD_TURNS / rate_scale(parameters))
        draw_separatrices(chart, manifolds, ())
        if circle is not None:
            draw_circle(chart, circle)
        draw_cycles(chart, parameters, cycles)
        draw_points(chart, parameters, points)
    handles, labels = right.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def counted(points: Sequence[FixedPoint]) -> list[str]:
    """Return how many fixed points there are of each type, a line each."""
    kinds = [point.kind for point in points]
    return [f"  {kinds.count(kind)} × {kind}" for kind in dict.fromkeys(kinds)]
