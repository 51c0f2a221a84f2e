"""The phase portrait of the motion from rest, (4.1), on the sphere of γ."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from robotball.dynamics.cycles import Cycle, curve_of, involute, separatrices
from robotball.dynamics.equilibria import FixedCircle, FixedPoint, flow, name_of
from robotball.robot.formulas import Parameters
from robotball.robot.looks import INK
from robotball.rotations import Array

from .output import halo

_DURATION = 400.0  # s, length of a manifold in time
_LENGTH = 5.0  # rad, length of a manifold that is drawn; beyond it may wind around a focus
# Symbols of stable points are filled.
_MARKERS = {
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


def portrait(
    title: str,
    parameters: Parameters,
    points: Sequence[FixedPoint],
    circle: FixedCircle | None,
    cycles: Sequence[Cycle],
) -> Figure:
    """Draw fixed points, their manifolds and limit cycles on the sphere, also unrolled."""
    figure = Figure(figsize=(13.0, 5.8), layout="constrained")
    counts = f"{len(points)} fixed points, limit cycles: {len(cycles)}"
    figure.suptitle(f"{title}: {counts}", color=INK)
    views: Any = {"sphere": {"projection": "3d"}}
    axes: dict[str, Any] = figure.subplot_mosaic(
        [["sphere", "involute"]], width_ratios=(4.6, 8.4), per_subplot_kw=views
    )
    sphere, chart = axes["sphere"], axes["involute"]

    def draw(gamma: Array, **style: Any) -> None:
        label = style.pop("label", None)
        if label in chart.get_legend_handles_labels()[1]:  # only one entry in the legend
            label = None
        sphere.plot(*gamma.T, **style)
        chart.plot(*involute(gamma).T, label=label, **style)

    _draw_field(sphere, chart, parameters)
    for manifold in separatrices(parameters, points, _DURATION):
        length = np.cumsum(np.linalg.norm(np.diff(manifold.path, axis=0), axis=1))
        word, dashes = ("stable", "--") if manifold.stable else ("unstable", "-")
        path = manifold.path[: int(np.searchsorted(length, _LENGTH)) + 2]
        draw(path, color=INK, lw=0.9, ls=dashes, label=f"{word} manifolds of the saddles")
    for quarter in range(4 if circle else 0):
        assert circle is not None
        arc = circle.at(np.linspace(quarter, quarter + 1, 100) * np.pi / 2)
        colour, word = ("#AA4499", "Σ_u, repels") if quarter % 2 else ("#117733", "Σ_s, attracts")
        draw(arc, color=colour, lw=2.6, label=word)
    for cycle in cycles:
        curve = curve_of(parameters, cycle.gamma, cycle.period)
        word, dashes = ("stable", "-") if abs(cycle.multipliers[0]) < 1 else ("unstable", "--")
        for gamma in (curve, -curve):  # γ → -γ is a symmetry
            draw(gamma, color="#3344DD", lw=3.2, ls=dashes, label=f"{word} limit cycle")
    for point in sorted(points, key=lambda point: point.kind):
        marker, colour = _MARKERS[point.kind]
        style = {"marker": marker, "color": colour, "mec": INK, "ms": 8, "ls": "", "zorder": 6}
        draw(point.gamma[None], **style, label=point.kind)
        name = name_of(parameters, point.gamma)
        sphere.text(*1.12 * point.gamma, name, fontsize=12)
        chart.text(*involute(point.gamma), f"  {name}", fontsize=12, zorder=7, path_effects=halo())
    sphere.set_box_aspect((1, 1, 1), zoom=1.5)
    sphere.set_axis_off()
    sphere.set_title("vertical γ on the Poisson sphere")
    chart.set(xlim=(0.0, 2 * np.pi), ylim=(-1.2, 1.2), title="the same sphere unrolled")
    chart.set(xlabel="φ = π/4 + arctan(γ₁/γ₂) [rad], full circle", ylabel="γ₃")
    handles, labels = chart.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _draw_field(sphere: Any, chart: Any, parameters: Parameters) -> None:
    """Draw a grid on the sphere, and streamlines of (4.1) on the unrolled sphere."""
    phi, height = np.meshgrid(np.linspace(0.0, 2 * np.pi, 80), np.linspace(-0.99, 0.99, 40))
    across, turn = np.sqrt(1 - height**2), phi - np.pi / 4
    gamma = across * np.sin(turn), across * np.cos(turn), height
    sphere.plot_wireframe(*gamma, rcount=12, ccount=24, color="0.85", lw=0.5)
    rates = flow(parameters, gamma)
    turning = (gamma[1] * rates[0] - gamma[0] * rates[1]) / across**2
    chart.streamplot(phi, height, turning, rates[2], color="0.8", linewidth=0.6)
