"""The phase portrait of motion from rest (4.1), on any chart of the sphere."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from robotball.engines.reduced.compiled.kernels import orbits
from robotball.palette import INK
from robotball.parameters import Parameters
from robotball.qualitative.cycles import Cycle
from robotball.qualitative.equilibria import FixedPoint, attitude_at, rate_scale
from robotball.qualitative.fixed_circle import FixedCircle
from robotball.qualitative.fixed_point_formulas import name_of
from robotball.qualitative.limit_cycles import curve_of, lies_on, spread_points
from robotball.qualitative.separatrices import Separatrix, separatrices
from robotball.rotations import Array, rotation_matrix
from validation.figures.parts import FAINT
from validation.figures.sphere import Chart, Globe, Involute
from validation.figures.view import View

# Filled is stable, open is not; in grey, too.
MARKS = {
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
CYCLE, ATTRACTS, REPELS = "#009E73", "#117733", "#AA4499"
STARTS_DRAWN = 44
DRAWN = 5.0  # rad, of a manifold
FOLLOWED = 400.0  # s, for a manifold
FIELD_TURNS = 18.0  # rad, by the rates of the flow, of each pale orbit
VIEW = View(azimuth=62.0, elevation=30.0)


def draw_field(chart: Chart, parameters: Parameters, duration: float) -> None:
    """Pale orbits with arrows from points all over the sphere, each for a duration [s]."""
    starts = spread_points(STARTS_DRAWN)
    attitudes = attitude_at(starts)
    times = np.linspace(0.0, duration, 800)
    found = orbits(parameters, attitudes, np.zeros((len(starts), 3)), times, 1e-10)
    for each in found.attitudes:
        gamma = rotation_matrix(each)[:, 2]
        chart.line(gamma, color=FAINT, linewidth=0.6, alpha=0.8, zorder=1)
        length = np.cumsum(np.linalg.norm(np.diff(gamma, axis=0), axis=1))
        if length[-1] > 0.2:
            k = int(np.searchsorted(length, min(0.2, length[-1] / 2))) + 1
            chart.arrow(gamma[: 2 * k], FAINT)


def draw_points(chart: Chart, parameters: Parameters, points: Sequence[FixedPoint]) -> None:
    """A mark at each fixed point, by its type, with the paper's name where it has one."""
    for kind in dict.fromkeys(point.kind for point in points):
        mark, fill = MARKS[kind]
        places = np.array([point.gamma for point in points if point.kind == kind])
        chart.marks(places, mark, color=fill, markeredgecolor=INK, markersize=8, label=kind,
                    zorder=6)  # fmt: skip
    for point in points:
        chart.name(point.gamma, name_of(parameters, point.gamma))


def draw_circle(chart: Chart, circle: FixedCircle) -> None:
    """The circle of fixed points: Σ_s solid, Σ_u dashed."""
    quarter = np.linspace(0.0, np.pi / 2, 100)
    for k, (colour, dashes, name) in enumerate(
        2
        * (
            (ATTRACTS, "-", r"$\Sigma_s$, attracts"),
            (REPELS, (0, (2.5, 1.2)), r"$\Sigma_u$, repels"),
        )
    ):
        label = name if k < 2 else None
        chart.line(circle.at(quarter + k * np.pi / 2), color=colour, linestyle=dashes,
                   linewidth=2.6, label=label, zorder=4)  # fmt: skip


def draw_separatrices(
    chart: Chart, found: Sequence[Separatrix], contour: Sequence[Separatrix]
) -> None:
    """The saddles' manifolds; those of a closed contour in the colour of a cycle."""
    for k, each in enumerate(contour):
        label = "closed contour" if k == 0 else None
        chart.line(each.path, color=CYCLE, linewidth=2.4, label=label, zorder=3)
    rest = [each for each in found if not any(each is other for other in contour)]
    for stable, dashes in ((True, (0, (4, 1.5))), (False, "-")):
        some = [each for each in rest if each.stable == stable]
        for k, each in enumerate(some):
            word = "stable" if stable else "unstable"
            label = f"{word} manifolds of the saddles" if k == 0 else None
            chart.line(beginning(each.path), color=INK, linewidth=0.9, linestyle=dashes,
                       label=label, zorder=2)  # fmt: skip


def beginning(path: Array) -> Array:
    """The first radians of a line γ (n, 3) on the sphere: later it winds round a focus."""
    lengths = np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))
    return path[: int(np.searchsorted(lengths, DRAWN)) + 2]


def draw_cycles(chart: Chart, parameters: Parameters, cycles: Sequence[Cycle]) -> None:
    """Limit cycles: solid where they attract, dashed where they repel."""
    known: set[str] = set()
    for cycle in cycles:
        curve = curve_of(parameters, cycle.gamma, cycle.period)
        attracts = abs(cycle.multipliers[0]) < 1
        name = "stable limit cycle" if attracts else "unstable limit cycle"
        opposite = [] if lies_on(-cycle.gamma, curve) else [-curve]
        for each in (curve, *opposite):
            label = None if name in known else name
            known.add(name)
            chart.line(each, color=CYCLE, linestyle="-" if attracts else "--",
                       linewidth=2.4, label=label, zorder=3)  # fmt: skip


def portrait(
    title: str,
    parameters: Parameters,
    points: Sequence[FixedPoint],
    circle: FixedCircle | None,
    cycles: Sequence[Cycle],
) -> Figure:
    """All that stands still or repeats, on the sphere and on its involute, without a motion."""
    figure = Figure(figsize=(13.0, 5.8), layout="constrained")
    figure.suptitle(f"{title}: motion from rest", color=INK)
    left, right = figure.subplots(1, 2, width_ratios=[4.6, 8.4])
    manifolds = separatrices(parameters, points, FOLLOWED)
    charts: tuple[Chart, ...] = (
        Globe(left, VIEW, "vertical γ on the Poisson sphere"),
        Involute(right, "its involute"),
    )
    for chart in charts:
        draw_field(chart, parameters, FIELD_TURNS / rate_scale(parameters))
        draw_separatrices(chart, manifolds, ())
        if circle is not None:
            draw_circle(chart, circle)
        draw_cycles(chart, parameters, cycles)
        draw_points(chart, parameters, points)
    handles, labels = right.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def counted(points: Sequence[FixedPoint]) -> list[str]:
    """How many fixed points there are of each type."""
    kinds = [point.kind for point in points]
    return [f"  {kinds.count(kind)} × {kind}" for kind in dict.fromkeys(kinds)]
