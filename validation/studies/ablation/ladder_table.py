"""The error budget in the terminal: a table each way."""

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from validation.comparison.table import scientific
from validation.studies.ablation.ladder import Ladder, Rung, fault_of

UP = "Going up, every choice made so far: the worst to come hides what is done."
UNDONE = "At the top, one choice undone: what it is worth by itself."
NOTE = (
    "slip: sliding velocity, root mean square, over the rolling speed.\n"
    "CPU: of a simulated second. × naive: median of rounds, ± the farthest from it.\n"
    "A run with a fault is no rolling ball, whatever its numbers."
)


def show_ladder(ladder: Ladder, console: Console) -> None:
    """Print both ways, and what the columns mean."""
    console.print(f"{ladder.scene.name}: {ladder.scene.title}", style="bold")
    console.print(UP)
    console.print(_table(ladder, ladder.up, "+ "))
    console.print(UNDONE)
    console.print(_table(ladder, ladder.undone, "- "))
    console.print(NOTE)


def _table(ladder: Ladder, rungs: Sequence[Rung], sign: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("choice", no_wrap=True)
    for heading in ("path\nerror", "M drift", "slip", "CPU\n\\[ms]", "× naive"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("first fault")
    for i, rung in enumerate(rungs):
        cost = ladder.times_naive(rung)
        table.add_row(
            f"{sign if i else ''}{rung.name}",
            scientific(rung.agreement.path_error),
            scientific(rung.agreement.momentum_drift),
            scientific(rung.slip),
            f"{rung.cost.seconds * 1e3:.1f}",
            f"{cost.ratio:.1f} ±{max(abs(end - cost.ratio) for end in cost.spread):.1f}",
            fault_of(rung),
            style="yellow" if rung.agreement.faults else "",
        )
    return table
