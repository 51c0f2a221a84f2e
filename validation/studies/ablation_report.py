"""The error budget as tables in the terminal and as a picture of bars, each way."""

from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from robotball.engines.mujoco import LABEL
from robotball.palette import INK
from validation.output import print_whole, scientific, title
from validation.studies.ablation import Ablation, Variant, fault_of

BUILT = "Built up, every choice made so far: the worst to come hides what is done."
UNDONE = "The recipe with one choice undone: what it is worth by itself."
NOTE = (
    "slip: sliding velocity, root mean square, over the rolling speed.\n"
    "CPU: of a simulated second. × naive: median of rounds, ± the farthest from it.\n"
    "A run with a fault is no rolling ball, whatever its numbers."
)
INCHES = (11.0, 6.2)
ERROR_AT, COST_AT = 6, 58  # points right of a panel, where its numbers stand
SOUND, FAULTY, HATCH = LABEL.colour, "white", "////"
DIAMOND: dict[str, Any] = {
    "marker": "D",
    "color": INK,
    "markerfacecolor": "w",
    "linestyle": "",
    "markersize": 5,
}


def show_ablation(ablation: Ablation, console: Console) -> None:
    """Print both tables, and what the columns mean."""
    console.print(escape(f"{ablation.scene.name}: {ablation.scene.title}"), style="bold")
    console.print(BUILT)
    print_whole(_table(ablation, ablation.built, "+ "), console)
    console.print(UNDONE)
    print_whole(_table(ablation, ablation.undone, "- "), console)
    console.print(NOTE)


def _table(ablation: Ablation, variants: Sequence[Variant], sign: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("choice", no_wrap=True)
    for heading in ("path\nerror", "M error", "slip", "CPU\n\\[ms]", "× naive"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("first fault")
    for i, variant in enumerate(variants):
        cost = ablation.times_naive(variant)
        table.add_row(
            f"{sign if i else ''}{variant.name}",
            scientific(variant.agreement.path_error),
            scientific(variant.agreement.momentum_error),
            scientific(variant.slip),
            f"{variant.cost.seconds * 1e3:.1f}",
            f"{cost.ratio:.1f} ±{max(abs(end - cost.ratio) for end in cost.spread):.1f}",
            fault_of(variant),
            style="yellow" if variant.agreement.faults else "",
        )
    return table


def ablation_picture(ablation: Ablation) -> Figure:
    """Path error (bars) and momentum error (diamonds) of every variant, its cost beside."""
    figure = Figure(figsize=INCHES, layout="constrained")
    title(figure, f"{ablation.scene.name}: {ablation.scene.title}")
    left, right = figure.subplots(1, 2, sharex=True)
    _panel(left, ablation, ablation.built, "+ ")
    _panel(right, ablation, ablation.undone, "− ")
    left.set_title("from the naive model: one choice more", loc="left", fontsize=10.5)
    right.set_title("the recipe with one choice undone", loc="left", fontsize=10.5)
    left.set_xlim(*_ends((*ablation.built, *ablation.undone)))
    handles: list[Artist] = [
        Patch(facecolor=SOUND, edgecolor=INK, label="path error"),
        Patch(facecolor=FAULTY, edgecolor=INK, hatch=HATCH, label="path error, faulty run"),
        Line2D([], [], **DIAMOND, label="momentum error"),
        Line2D([], [], color=INK, linestyle=":", label="path error of the recipe"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _panel(axes: Axes, ablation: Ablation, variants: Sequence[Variant], sign: str) -> None:
    names = [f"{sign if i else ''}{variant.name}" for i, variant in enumerate(variants)]
    axes.set_yticks(range(len(variants)), names)
    axes.set(xscale="log", xlabel="path error and momentum error, relative")
    axes.set_ylim(len(variants) - 0.4, -0.6)
    axes.grid(axis="x", alpha=0.3)
    axes.set_axisbelow(True)
    for row, variant in enumerate(variants):
        error, off = variant.agreement.path_error, variant.agreement.momentum_error
        if error is not None:
            faulty = bool(variant.agreement.faults)
            axes.barh(
                row, error, height=0.62, edgecolor=INK,
                color=FAULTY if faulty else SOUND, hatch=HATCH if faulty else None,
            )  # fmt: skip
        if off is not None:
            axes.plot([off], [row], **DIAMOND)
        _beside(axes, row, "broke off" if error is None else scientific(error), ERROR_AT)
        _beside(axes, row, f"{ablation.times_naive(variant).ratio:.1f}", COST_AT)
    _beside(axes, -1, "path\nerror", ERROR_AT)
    _beside(axes, -1, "CPU,\n× naive", COST_AT)
    if (best := ablation.recipe.agreement.path_error) is not None:
        axes.axvline(best, color=INK, linestyle=":")


def _ends(variants: Sequence[Variant]) -> tuple[float, float]:
    """Ends of the axis, with room beyond all that is drawn; bars begin at the left one."""
    each = [
        (variant.agreement.path_error, variant.agreement.momentum_error) for variant in variants
    ]
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
