"""Maps of the phase portraits of (4.1) over K₃ and Ω, with the curves of section 4.2 over them.

(4.1) is linear in K and Ω together, so that of (K₃, Ω) only three ratios count: the size of both
scales time alone. Each map is a plane through the ball of Figs 6 to 8.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from rich.table import Table
from tyro.conf import arg

from robotball.equations import Parameters, Vector
from robotball.film.looks import ACCENT, INK
from robotball.qualitative.equilibria import kappa, name_of, proposition_2
from robotball.rotations import Array
from validation.options import AGREES, DISAGREES, Several, Sweep, SweepOptions, chosen
from validation.output import halo
from validation.plots import note
from validation.studies.maps import MapStudy, draw_cells, draw_level, grid_cells
from validation.study import Column, table_of
from validation.sweeps import Cell, Result

A: Vector = (0.5, 0.4, 0.3)  # of Figs 5 to 8, 1/(kg m²)
_OMEGA: Vector = (4.0, 2.0, 1.0)  # rad/s
_COUNT, _QUICK_COUNT = 24, 4  # values of an axis
_LIMIT = 300.0  # s of one cell


@dataclass(frozen=True)
class _Plane:
    """A map: K₃ across from -K3 to K3 [kg m²/s]; up is `y`, from `low` to `high`."""

    name: str
    label: str
    held: str
    K3: float
    low: float
    high: float
    Omega: Callable[[float], Vector]

    def ball(self, K3: float, y: float) -> Parameters:
        """Return the ball at a place of the map."""
        # Of I and d the motion from rest has A = (I + d)⁻¹ alone, so that any d does.
        d = 1.0
        I = (1 / A[0] - d, 1 / A[1] - d, 1 / A[2] - d)
        return Parameters("rubber", I, d, 1.0, self.Omega(y), (0.0, 0.0, K3))

    def axes(self, count: int) -> tuple[list[float], list[float]]:
        """Return the values of K₃ and of y; with an even count none is on a line of symmetry."""

        def values(low: float, high: float) -> list[float]:
            # A cell is known by the text of its numbers, which last bits would change.
            return [float(f"{value:.6g}") for value in np.linspace(low, high, count)]

        return values(-self.K3, self.K3), values(self.low, self.high)


def _Omega_at(degrees: float) -> Vector:
    """Return _OMEGA with its part across e₃ turned to this angle from e₁."""
    size, angle = np.hypot(_OMEGA[0], _OMEGA[1]), np.radians(degrees)
    return (float(size * np.cos(angle)), float(size * np.sin(angle)), _OMEGA[2])


PLANES = {
    plane.name: plane
    for plane in (
        _Plane("axial", "Ω₃ [rad/s]", "Ω₁ = 4, Ω₂ = 2 rad/s", 3.0, -4.0, 4.0,
              lambda y: (_OMEGA[0], _OMEGA[1], y)),
        _Plane("azimuth", "angle of (Ω₁, Ω₂) from e₁ [degrees]",
              "√(Ω₁² + Ω₂²) = √20, Ω₃ = 1 rad/s", 3.0, -85.0, 85.0, _Omega_at),
    )
}  # fmt: skip


def cells_of(plane: _Plane, count: int) -> list[Cell]:
    """Return the cells of a map, row by row."""
    across, up = plane.axes(count)
    return grid_cells(("K3", across), ("y", up), map=plane.name)


def measure_portrait(cell: Mapping[str, Any]) -> dict[str, Any]:
    """Return the phase portrait of a cell {map, K3, y}.

    points: the type of each fixed point by its name; cycles: period s and multiplier of each, and
    whether it is its own opposite; basins: the share of the sphere of each attractor.
    """
    # The compiled code takes a while to come, and only who measures needs it.
    from robotball.qualitative.portraits import curve_of, lies_on, phase_portrait

    ball = PLANES[cell["map"]].ball(cell["K3"], cell["y"])
    found = phase_portrait(ball)
    return {
        "points": {name_of(ball, point.gamma): point.kind for point in found.points},
        "cycles": [
            {
                "period": cycle.period,
                "multiplier": float(cycle.multipliers[0].real),
                "symmetric": lies_on(-cycle.gamma, curve_of(ball, cycle.gamma, cycle.period)),
            }
            for cycle in found.cycles
        ],
        "basins": found.basins,
    }


_FINE = 70  # values of an axis for the curves
_CURVES: dict[str, tuple[Callable[[Parameters], float], str, Any]] = {
    "|κ₁| = 1": (lambda ball: abs(kappa(ball, 1)) - 1, ACCENT, "-"),
    "|κ₂| = 1": (lambda ball: abs(kappa(ball, 0)) - 1, INK, "-."),
    "A₁A₂ = 0": (lambda ball: np.prod(proposition_2(ball)[:2]), ACCENT, "--"),
    "B = 0": (lambda ball: proposition_2(ball)[2], INK, ":"),
}
# Apart in grey, too; the same in every picture.
_COLOURS = {
    "2 fixed points": "#DADDE1",
    "6 fixed points": "#A9AFB6",
    "10 fixed points": "#FFFFFF",
    "Γ₅,₆: saddle": "#FFFFFF",
    "Γ₅,₆: slow stable focus": "#DADDE1",
    "Γ₅,₆: slow unstable focus": "#A9AFB6",
    "no limit cycle": "#A9AFB6",
    "cycles: 1 stable": "#FFFFFF",
    "cycles: 1 unstable": "#DADDE1",
    "largest basin: a cycle": "#FFFFFF",
    "largest basin: Γ₅,₆": "#E3E6EA",
    "largest basin: δ₁,₂": "#BFD3E6",
    "largest basin: δ₃,₄": "#F0D58C",
    "largest basin: θ₁,₂": "#A8C8B4",
    "largest basin: θ₃,₄": "#8F92B8",
}
_HATCHES = {"largest basin: δ₃,₄": "..", "largest basin: θ₁,₂": "//", "largest basin: θ₃,₄": "\\\\"}
_OTHER, _NONE = "#F5C9C9", "no result"  # also of a result of a kind not foreseen


def _kind_of_cycles(record: Mapping[str, Any]) -> str:
    """Return how many limit cycles there are, C and -C as one."""
    stable = sum(abs(cycle["multiplier"]) < 1 for cycle in record["cycles"])
    unstable = len(record["cycles"]) - stable
    if stable + unstable == 0:
        return "no limit cycle"
    parts = [f"{n} {word}" for n, word in ((stable, "stable"), (unstable, "unstable")) if n]
    return f"cycles: {', '.join(parts)}"


def _largest_basin(record: Mapping[str, Any]) -> str:
    """Return the attractor with the largest basin."""
    # All of the sphere belongs to some basin but for lines, so one number says whose is largest.
    name = max(record["basins"], key=lambda each: record["basins"][each])
    return f"largest basin: {'a cycle' if name.startswith('cycle') else name}"


# By the record of a cell. Fixed points of index 1 are counted with the saddles; Γ₅ and Γ₆ have the
# same type.
_BORDERS = {  # the curves that bound what a panel shows; all in any other
    "how many fixed points": ("|κ₁| = 1", "|κ₂| = 1"),
    "the type of Γ₅ and Γ₆": ("A₁A₂ = 0", "B = 0"),
    "limit cycles": ("|κ₁| = 1", "A₁A₂ = 0", "B = 0"),
}
_PANELS: dict[str, Callable[[Mapping[str, Any]], str]] = {
    "how many fixed points": lambda record: f"{len(record['points'])} fixed points",
    "the type of Γ₅ and Γ₆": lambda record: f"Γ₅,₆: {record['points'].get('Γ₅', 'none')}",
    "limit cycles": _kind_of_cycles,
    "whose basin is the largest": _largest_basin,
}


def _portrait_picture(name: str, results: Sequence[Result]) -> Figure:
    """Draw four panels of a map's cells, each by one property, with the curves over them."""
    plane = PLANES[name]
    figure = Figure(figsize=(9.6, 10.2), layout="constrained")
    found = summary(plane, results)
    figure.suptitle(
        f"From rest: points and their types change where the corrected formulas say; "
        f"{found['against_the_formulas']} of {found['cells']} cells differ\n"
        f"A = diag{A} 1/(kg m²), K = (0, 0, K₃), {plane.held}",
        color=INK,
    )
    panels, curves = figure.subplots(2, 2), _curves_of(plane)
    for axes, (title, property_of) in zip(panels.flat, _PANELS.items(), strict=True):
        _draw_property(axes, results, property_of)
        for levels, (curve, (_, colour, dashes)) in zip(curves, _CURVES.items(), strict=True):
            if curve in _BORDERS.get(title, _CURVES):
                draw_level(axes, *levels, colour, dashes=dashes)
        axes.set(xlabel="K₃ [kg m²/s]", ylabel=plane.label, title=title)
        for K3, number, side in ((0.3, "6", "right"), (0.52, "7", "left"), (3.0, "8", "right")):
            # Where the paper's own Figs 6 to 8 lie on either map: Ω₃ = 1, or (Ω₁, Ω₂) = (4, 2).
            y = 1.0 if name == "axial" else float(np.degrees(np.arctan2(2.0, 4.0)))
            axes.plot(K3, y, "o", color=INK, mec="white", markersize=6, clip_on=False, zorder=5)
            note(axes, f"Fig. {number}", (K3, y), (-3 if number == "6" else 3, 5), fontsize=8,
                 color=INK, zorder=5, path_effects=halo(), ha=side)  # fmt: skip
    handles = [Line2D([], [], color=colour, linestyle=dashes, linewidth=1.8, label=words)
              for words, (_, colour, dashes) in _CURVES.items()]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False,
                  title="curves by the formulas of section 4.2, corrected")  # fmt: skip
    return figure


def _draw_property(
    axes: Axes, results: Sequence[Result], property_of: Callable[[Mapping[str, Any]], str]
) -> None:
    """Draw each cell in the colour of its property, with a legend with the share of each."""
    across, up = (sorted({each.cell[key] for each in results}) for key in ("K3", "y"))
    words = [property_of(each.record) if each.record else _NONE for each in results]
    styles: dict[str, dict[str, Any]] = {
        word: {"fc": _COLOURS.get(word, _OTHER), "hatch": _HATCHES.get(word), "ec": "0.5"}
        for word in words
    }
    draw_cells(axes, across, up, [{**styles[word], "lw": 0} for word in words])
    order = [*_COLOURS, *sorted(set(words) - set(_COLOURS) - {_NONE}), _NONE]
    shown = sorted(styles, key=order.index)
    parts = {word: words.count(word) / len(words) for word in shown}
    handles = [Patch(**styles[word], label=f"{word}, {parts[word]:.0%}") for word in shown]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2,
                frameon=False, fontsize=8, columnspacing=1.0, handlelength=1.5)  # fmt: skip
    axes.set(xlim=(across[0], across[-1]), ylim=(up[0], up[-1]))


def _curves_of(plane: _Plane) -> list[tuple[Array, Array, Array]]:
    """Return for each of _CURVES K₃ (n,), y (m,) and the function (m, n) whose zeros it is."""
    across = np.linspace(-plane.K3, plane.K3, _FINE)
    up = np.linspace(plane.low, plane.high, _FINE)
    balls = [[plane.ball(K3, y) for K3 in across] for y in up]
    return [
        (across, up, np.array([[function(ball) for ball in row] for row in balls]))
        for function, _, _ in _CURVES.values()
    ]


def summary(plane: _Plane, results: Sequence[Result]) -> dict[str, Any]:
    """Return the record of a map: how many cells have which portrait, where formulas fail."""
    sound = [(each.cell, each.record) for each in results if each.record is not None]
    right = [as_predicted(plane.ball(cell["K3"], cell["y"]), record) for cell, record in sound]
    return {
        "map": plane.name,
        "cells": len(results),
        "failed": len(results) - len(sound),
        "against_the_formulas": right.count(False),
        "counts": {
            title: dict(Counter(property_of(record) for _, record in sound).most_common())
            for title, property_of in _PANELS.items()
        },
    }


def as_predicted(ball: Parameters, record: Mapping[str, Any]) -> bool:
    """Return whether κ₁, κ₂ give the number of points, and Proposition 2 the type of Γ₅."""
    expected = 2 + 4 * (abs(kappa(ball, 1)) < 1) + 4 * (abs(kappa(ball, 0)) < 1)
    # B/A₁ decides the focus as corrected (E6, E7), and A₁A₂ < 0 makes it a saddle.
    A1, A2, B = proposition_2(ball)
    focus = "slow stable focus" if B / A1 < 0 else "slow unstable focus"
    kind = "saddle" if A1 * A2 < 0 else focus
    return len(record["points"]) == expected and record["points"]["Γ₅"] == kind


def shown(records: Sequence[Mapping[str, Any]]) -> Iterator[Table | str]:
    """Yield the counts, and how the formulas did."""
    for record in records:
        columns = (
            Column(f"map {record['map']}: {record['cells']} cells", "what", words=True),
            Column("cells", "count", form="d"),
        )
        rows = [
            {"title": title, "what": words, "count": count}
            for title, counts in record["counts"].items()
            for words, count in counts.items()
        ]
        yield table_of(columns, rows, section="title")
        yield (
            f"number of fixed points and type of Γ₅: in {record['against_the_formulas']} cells "
            f"another than by section 4.2's formulas; {record['failed']} cells without a result"
        )


@dataclass(frozen=True)
class Portraits:
    """Map the phase portraits of motion from rest over K₃ and Ω, which section 4.2 leaves open.

    Example: robotball portraits axial --quick
    """

    maps: Annotated[Several, arg(metavar="[MAP…]")] = ()
    """Which maps, axial (K₃ and Ω₃) or azimuth (K₃ and the angle of Ω₁, Ω₂); both if none."""
    sweep: SweepOptions = field(default_factory=Sweep)

    def run(self) -> int:
        planes = chosen("map", self.maps, PLANES)
        count = _QUICK_COUNT if self.sweep.quick else _COUNT
        study = MapStudy("portraits", measure_portrait, self.sweep)
        found = study.results({each.name: (cells_of(each, count), _LIMIT) for each in planes})
        records = [summary(each, found[each.name]) for each in planes]
        study.present(found, _portrait_picture, shown(records), {"summary": records})
        return DISAGREES if any(each["against_the_formulas"] for each in records) else AGREES
