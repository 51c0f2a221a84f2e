"""The trade-off as a picture: path error across, processor time up, the front below them all."""

import math
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball.palette import ENGINE, INK, THEORY
from validation.studies.tradeoff.front import TARGET, Line, Point, Tradeoff

INCHES = (10.0, 7.2)
FAINT = "#B4B9BF"
# High order is filled, first order hollow.
MARKERS = {"DOP853": "^", "RK4": "o", "Euler": "s", "implicit": "D", "implicitfast": "v"}
MARKERS |= {"discrete": "P"}
WILD = 1e3  # a path error from where on a run is not drawn
ABOVE = ("adaptive",)  # its place is the left end of the front
HIGH_ORDER = ("DOP853", "RK4")


def tradeoff_picture(study: Tradeoff) -> Figure:
    """Every configuration that has an error, the front, the presets, and first order prolonged."""
    figure = Figure(figsize=INCHES, layout="constrained")
    figure.suptitle(f"{study.scene.name}: what accuracy costs, {len(study.points)} configurations")
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", xlabel="path error, relative to the path's length")
    axes.set_ylabel("processor time of a simulated second [s]")
    axes.grid(alpha=0.3)
    _scatter(axes, study.points)
    errors, costs = zip(*((p.error, p.cost) for p in study.front), strict=True)
    axes.plot(errors, costs, color=INK, linewidth=1.6, zorder=3, label="front")
    if study.first_order is not None:
        _prolong(axes, study.first_order)
    _compare(axes, study)
    for name, point in study.presets.items():
        if not math.isnan(point.error):
            _name(axes, name, (point.error, point.cost))
    low, high = axes.get_xlim()
    axes.set_xlim(low / 3, high * 3)
    axes.set_ylim(axes.get_ylim()[0] / 2.5)
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure


def _scatter(axes: Axes, points: Sequence[Point]) -> None:
    faulty = [p for p in points if not p.sound and p.error < WILD]
    axes.plot(
        [p.error for p in faulty],
        [p.cost for p in faulty],
        "x",
        color=FAINT,
        markersize=4,
        zorder=1,
        label="slips, lifts off or misses a rate",
    )
    for integrator, marker in MARKERS.items():
        mine = [p for p in points if p.sound and p.integrator == integrator]
        high = integrator in HIGH_ORDER
        axes.plot(
            [p.error for p in mine],
            [p.cost for p in mine],
            marker,
            color=ENGINE,
            markerfacecolor=ENGINE if high else "none",
            markersize=5 if high else 4.5,
            linestyle="",
            zorder=2,
            label=integrator,
        )


def _prolong(axes: Axes, line: Line) -> None:
    """The best line of first order, on to the target."""
    points = [(p.error, p.cost) for p in line.points]
    axes.plot(*zip(*points, strict=True), color=THEORY, linewidth=1.4, label="first order, best")
    if line.extrapolated:
        axes.plot(
            [line.nearest.error, TARGET],
            [line.nearest.cost, line.at_target],
            color=THEORY,
            linewidth=1.4,
            linestyle="--",
            label=f"extrapolated, order {line.order:.2f}",
        )


def _compare(axes: Axes, study: Tradeoff) -> None:
    """The two costs at the target, and how many times one is the other."""
    axes.axvline(TARGET, color=INK, linewidth=0.8, linestyle=":")
    if study.best is None or study.first_order is None or study.ratio is None:
        return
    low, high = study.best.cost, study.first_order.at_target
    arrow = {"arrowstyle": "<->", "color": INK, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (TARGET, high), xytext=(TARGET, low), arrowprops=arrow)
    times = float(f"{study.ratio:.2g}")
    axes.annotate(
        f"{times:,.0f}".replace(",", "\u2009") + f" times\nat {TARGET:g}",
        (TARGET, high / 4),
        xytext=(-8, 0),
        textcoords="offset points",
        ha="right",
        va="center",
        color=INK,
    )


def _name(axes: Axes, name: str, place: tuple[float, float]) -> None:
    """A preset's ring and its name, on the side where nothing else is."""
    above = name in ABOVE
    axes.plot(*place, "o", color=INK, markerfacecolor="none", markersize=11, zorder=4)
    axes.annotate(
        name,
        place,
        xytext=(0, 10 if above else -12),
        textcoords="offset points",
        ha="center",
        va="bottom" if above else "top",
        color=INK,
        zorder=5,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85},
    )
