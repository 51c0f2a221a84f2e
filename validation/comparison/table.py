"""Agreements as a table in the terminal."""

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from validation.comparison.agreement import Agreement
from validation.output import print_whole, scientific


def show(agreements: Sequence[Agreement], console: Console) -> None:
    """Print one row an agreement, and below the table what went wrong where it did."""
    # Eighty columns hold it.
    table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    for heading in ("scene", "rolling", "preset"):
        table.add_column(heading, no_wrap=True)
    for heading in ("step\n\\[ms]", "path\nerror", "γ error\n\\[rad]", "M error", "× real\ntime"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for each in agreements:
        table.add_row(
            escape(each.scene.name),
            each.scene.rolling,
            escape(each.settings.name),
            f"{each.report.timestep * 1e3:.3g}",
            scientific(each.path_error),
            scientific(each.gamma_error),
            scientific(each.momentum_error),
            f"{each.realtime_factor:.0f}",
            _word(each),
            style="" if each.agrees else "yellow",
        )
    print_whole(table, console)
    for each in agreements:
        if each.verdict != "agrees":
            style = "" if each.agrees else "yellow"
            line = f"{each.scene.name}, {each.settings.name}: {each.verdict}"
            console.print(escape(line), style=style)


def _word(agreement: Agreement) -> str:
    if agreement.agrees:
        return "agrees"
    if agreement.faults:
        return "faulty"
    return "sensitive" if agreement.sensitive else "off"
