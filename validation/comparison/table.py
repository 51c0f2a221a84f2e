"""Agreements as a table in the terminal."""

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from validation.comparison.results import Record
from validation.output import print_whole, scientific


def show(records: Sequence[Record], console: Console) -> None:
    """Print one row an agreement's record, and below the table what went wrong where it did."""
    # Eighty columns hold it.
    table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    for heading in ("scene", "rolling", "preset"):
        table.add_column(heading, no_wrap=True)
    for heading in ("step\n\\[ms]", "path\nerror", "γ error\n\\[rad]", "M error", "× real\ntime"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for each in records:
        table.add_row(
            escape(each["scene"]),
            each["rolling"],
            escape(each["preset"]),
            f"{each['timestep'] * 1e3:.3g}",
            *(scientific(each[name]) for name in ("path_error", "gamma_error", "momentum_error")),
            f"{each['realtime_factor']:.0f}",
            _word(each),
            style="" if each["agrees"] else "yellow",
        )
    print_whole(table, console)
    for each in records:
        if each["verdict"] != "agrees":
            style = "" if each["agrees"] else "yellow"
            line = f"{each['scene']}, {each['preset']}: {each['verdict']}"
            console.print(escape(line), style=style)


def _word(record: Record) -> str:
    if record["agrees"]:
        return "agrees"
    if record["faults"]:
        return "faulty"
    sensitivity = record["sensitivity"]
    return "sensitive" if sensitivity and sensitivity["explains"] else "off"
