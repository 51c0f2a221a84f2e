"""What rolling and torsional friction do, as a picture of two panels."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotball import Scene
from robotball.engines.mujoco import LABEL
from robotball.palette import ACCENT, INK
from validation.output import in_picture
from validation.studies.friction import HARD, ROLLING, SOFT, TORSIONAL
from validation.sweeps import Result

INCHES = (11.5, 5.6)
LEAST = 1e-10  # of the right panel: what is below is rounding


def friction_picture(scene: Scene, results: Sequence[Result], needed: float) -> Figure:
    """How fast |M| is eaten, and what torsional friction makes of the ball.

    needed: the torsional friction that the motion demands [m].
    """
    figure = Figure(figsize=INCHES, layout="constrained")
    figure.suptitle(f"{in_picture(scene.name)}: the recipe with more friction")
    left, right = figure.subplots(1, 2)
    for axes in (left, right):
        axes.set(xscale="log", yscale="log")
        axes.grid(alpha=0.3)
    _rolling(left, scene, results)
    _torsional(right, results, needed if scene.rolling == "rubber" else None)
    return figure


def _rows(results: Sequence[Result], kind: str) -> list[dict[str, Any]]:
    return [{**r.cell, **r.record} for r in results if r.record and r.cell["friction"] == kind]


def _rolling(axes: Axes, scene: Scene, results: Sequence[Result]) -> None:
    weight = scene.ball.mass * scene.gravity
    rows = _rows(results, ROLLING)
    lengths = np.array(sorted({row["length"] for row in rows}))
    axes.plot(lengths, weight * lengths, color=ACCENT, linewidth=1.6, label="$\\mu_r m g$")
    for rows_of, marker, fill, label in (
        (HARD, "o", LABEL.colour, "friction as stiff as the normal force"),
        (SOFT, "o", "none", "the recipe's friction"),
    ):
        mine = [row for row in rows if row["rows"] == rows_of]
        axes.plot(
            [row["length"] for row in mine],
            [max(row["loss"], 0.0) or np.nan for row in mine],
            marker,
            color=LABEL.colour,
            markerfacecolor=fill,
            label=label,
        )
    axes.set(
        xlabel=r"rolling friction $\mu_r$ [m], condim 6",
        ylabel="loss of |M| in a second [kg m²/s²]",
        title="rolling friction takes the momentum\nthat the rubber model keeps",
    )
    axes.legend(loc="upper left", frameon=False, fontsize=9)


def _torsional(axes: Axes, results: Sequence[Result], needed: float | None) -> None:
    rows = _rows(results, TORSIONAL)
    lengths = [row["length"] for row in rows]
    for key, marker, fill, style, label in (
        ("path_error", "o", LABEL.colour, "-", "path error"),
        ("relative_spin", "s", "none", "--", "spin at the contact / |ω|"),
    ):
        values = [row[key] and max(row[key], LEAST) for row in rows]
        axes.plot(
            lengths, values, marker=marker, color=LABEL.colour, markerfacecolor=fill,
            linestyle=style, label=label,
        )  # fmt: skip
    if needed is not None:
        axes.axvline(needed, color=ACCENT, linewidth=1.4, linestyle=":")
        places = (
            (np.sqrt(lengths[0] * needed / 8), "drag"),
            (needed / 2.2, "transition"),
            (np.sqrt(lengths[-1] * needed), "rubber"),
        )
        for x, word in places:
            axes.annotate(
                word, (x, 1.03), xycoords=("data", "axes fraction"), ha="center", color=INK
            )
        axes.annotate(
            f"the motion needs {needed:.3g} m",
            (needed, 0.35),
            xycoords=("data", "axes fraction"),
            xytext=(-5, 0),
            textcoords="offset points",
            rotation=90,
            ha="right",
            va="center",
            color=INK,
        )
    axes.set(
        xlabel=r"torsional friction $\mu_t$ [m], condim 4",
        ylabel="path error and spin, relative",
    )
    axes.set_title("torsional friction: too little is a drag,\nenough is the rubber model", pad=24)
    axes.legend(loc="center right", frameon=False, fontsize=9)
