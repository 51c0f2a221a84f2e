"""The error budget as a picture: bars each way, rung beside rung."""

from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from robotball.palette import ENGINE, INK
from validation.comparison.table import scientific
from validation.studies.ablation.ladder import Ladder, Rung

INCHES = (11.0, 6.2)
ERROR_AT, COST_AT = 6, 58  # points right of a panel, where its numbers stand
SOUND, FAULTY, HATCH = ENGINE, "white", "////"
DIAMOND: dict[str, Any] = {
    "marker": "D",
    "color": INK,
    "markerfacecolor": "w",
    "linestyle": "",
    "markersize": 5,
}


def ladder_picture(ladder: Ladder) -> Figure:
    """Path error (bars) and drift of M (diamonds) of every rung, with what it costs beside."""
    figure = Figure(figsize=INCHES, layout="constrained")
    figure.suptitle(f"{ladder.scene.name}: {ladder.scene.title}")
    left, right = figure.subplots(1, 2, sharex=True)
    _panel(left, ladder, ladder.up, "+ ")
    _panel(right, ladder, ladder.undone, "− ")
    left.set_title("from naive up: one choice more", loc="left", fontsize=10.5)
    right.set_title("the recipe with one choice undone", loc="left", fontsize=10.5)
    left.set_xlim(*_ends((*ladder.up, *ladder.undone)))
    handles: list[Artist] = [
        Patch(facecolor=SOUND, edgecolor=INK, label="path error"),
        Patch(facecolor=FAULTY, edgecolor=INK, hatch=HATCH, label="path error, faulty run"),
        Line2D([], [], **DIAMOND, label="drift of M"),
        Line2D([], [], color=INK, linestyle=":", label="path error of the recipe"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _panel(axes: Axes, ladder: Ladder, rungs: Sequence[Rung], sign: str) -> None:
    names = [f"{sign if i else ''}{rung.name}" for i, rung in enumerate(rungs)]
    axes.set_yticks(range(len(rungs)), names)
    axes.set(xscale="log", xlabel="path error over path length, |M - M(0)| over |M(0)|")
    axes.set_ylim(len(rungs) - 0.4, -0.6)
    axes.grid(axis="x", alpha=0.3)
    axes.set_axisbelow(True)
    for row, rung in enumerate(rungs):
        error, drift = rung.agreement.path_error, rung.agreement.momentum_drift
        if error is not None:
            faulty = bool(rung.agreement.faults)
            axes.barh(
                row, error, height=0.62, edgecolor=INK,
                color=FAULTY if faulty else SOUND, hatch=HATCH if faulty else None,
            )  # fmt: skip
        if drift is not None:
            axes.plot([drift], [row], **DIAMOND)
        _beside(axes, row, "broke off" if error is None else scientific(error), ERROR_AT)
        _beside(axes, row, f"{ladder.times_naive(rung).ratio:.1f}", COST_AT)
    _beside(axes, -1, "path\nerror", ERROR_AT)
    _beside(axes, -1, "CPU,\n× naive", COST_AT)
    if (best := ladder.recipe.agreement.path_error) is not None:
        axes.axvline(best, color=INK, linestyle=":")


def _ends(rungs: Sequence[Rung]) -> tuple[float, float]:
    """Ends of the axis, with room beyond all that is drawn; bars begin at the left one."""
    each = [(rung.agreement.path_error, rung.agreement.momentum_drift) for rung in rungs]
    drawn = [value for pair in each for value in pair if value]
    return min(drawn) / 20, max(drawn) * 20


def _beside(axes: Axes, row: float, text: str, place: float) -> None:
    """A text `place` points right of the axes."""
    axes.annotate(
        text,
        (1.0, row),
        xycoords=("axes fraction", "data"),
        xytext=(place, 0),
        textcoords="offset points",
        va="center",
        fontsize=9,
        annotation_clip=False,
    )
