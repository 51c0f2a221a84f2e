"""The error budget as a picture: bars each way, rung beside rung."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from robotball.palette import ENGINE, INK
from validation.table import scientific
from validation.tradeoffs.ladder import Ladder, Rung

INCHES = (11.0, 6.2)
FAULTY, SOUND = "#FFFFFF", ENGINE  # a faulty bar is hollow and hatched
LEAST = 1e-13  # the bars' left end: below the least that double precision lets MuJoCo reach here


def ladder_picture(ladder: Ladder) -> Figure:
    """Path error (bars) and drift of M (diamonds) of every rung, with what it costs beside."""
    figure = Figure(figsize=INCHES, layout="constrained")
    figure.suptitle(f"{ladder.scene.name}: {ladder.scene.title}")
    left, right = figure.subplots(1, 2, sharex=True)
    _panel(left, ladder, ladder.up, "+ ")
    _panel(right, ladder, ladder.undone, "− ")
    left.set_title("from the naive model up: one choice more a bar", fontsize=11)
    right.set_title("the recipe with one choice undone", fontsize=11)
    figure.legend(
        handles=[
            Patch(facecolor=SOUND, edgecolor=INK, label="path error"),
            Patch(facecolor=FAULTY, edgecolor=INK, hatch="////", label="path error, faulty run"),
            Line2D([], [], **DIAMOND, label="drift of M"),
            Line2D([], [], color=INK, linestyle=":", label="path error of the recipe"),
        ],
        loc="outside lower center",
        ncols=4,
        frameon=False,
    )
    return figure


DIAMOND = {"marker": "D", "color": INK, "markerfacecolor": "w", "linestyle": "", "markersize": 5}


def _panel(axes: Axes, ladder: Ladder, rungs: Sequence[Rung], sign: str) -> None:
    names = [f"{sign if i else ''}{rung.name}" for i, rung in enumerate(rungs)]
    axes.set_yticks(range(len(rungs)), names)
    axes.set(xscale="log", xlim=(LEAST, 1e4), xlabel="relative error")
    axes.invert_yaxis()
    axes.grid(axis="x", alpha=0.3)
    axes.set_axisbelow(True)
    for row, rung in enumerate(rungs):
        error, drift = rung.agreement.path_error, rung.agreement.momentum_drift
        if error is not None:
            look = {"color": FAULTY, "hatch": "////"} if rung.agreement.faults else {"color": SOUND}
            axes.barh(row, error - LEAST, left=LEAST, height=0.62, edgecolor=INK, **look)
        if drift is not None:
            axes.plot([drift], [row], **DIAMOND)
        _beside(axes, row, scientific(error), 1.02)
        _beside(axes, row, f"{ladder.times_naive(rung).ratio:.1f}", 1.2)
    _beside(axes, -1, "path\nerror", 1.02)
    _beside(axes, -1, "CPU,\n× naive", 1.2)
    if (best := ladder.recipe.agreement.path_error) is not None:
        axes.axvline(best, color=INK, linestyle=":")


def _beside(axes: Axes, row: float, text: str, place: float) -> None:
    """A text right of the axes, `place` axes' widths from their left."""
    axes.annotate(
        text,
        (place, row),
        xycoords=("axes fraction", "data"),
        va="center",
        fontsize=9,
        annotation_clip=False,
    )
