"""A fault window in the terminal: its rows, one of them, or one after another."""

import sys

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from robotball.engines.mujoco.fault_window import FaultWindow, Replayed
from robotball.errors import InputError
from validation.output import print_whole


def show_rows(window: FaultWindow, console: Console) -> None:
    """Print all rows, the first bad one marked."""
    table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    for heading in ("row", *window.columns):
        table.add_column(escape(heading), justify="right")
    table.add_column("")
    for i, row in enumerate(window.table):
        bad = i == window.bad
        cells = [f"{i}", *map(_cell, row), "<- bad" if bad else ""]
        table.add_row(*cells, style="yellow" if bad else "")
    if window.bad == len(window.table):
        table.add_row(f"{window.bad}", *("" for _ in window.columns), "<- no further")
    print_whole(table, console)


def walk(window: FaultWindow, console: Console) -> None:
    """Print row after row from the first bad one on, each at a press of Enter."""
    if not sys.stdin.isatty():
        raise InputError("--interactive needs a terminal; leave it out to see all rows at once")
    for i in range(min(window.bad, len(window.table) - 1), len(window.table)):
        show_row(window, i, console)
        if input("Enter for the next row, q to leave: ").strip():
            break


def show_row(window: FaultWindow, row: int, console: Console) -> None:
    """All that is known of one row; raises InputError where there is no such row."""
    if not 0 <= row < len(window.table):
        raise InputError(f"--step must be a row from 0 to {len(window.table) - 1}, not {row}")
    console.print(f"row {row}{', the first bad one' if row == window.bad else ''}")
    for name, value in zip(window.columns, window.table[row], strict=True):
        console.print(escape(f"  {name:20s} {_cell(value, digits=9)}"), highlight=False)
    qpos, qvel = window.coordinates(row)
    for name, values in (("qpos", qpos), ("qvel", qvel)):
        console.print(f"  {name:20s} {' '.join(_cell(v, 9) for v in values)}", highlight=False)


def _cell(value: float | None, digits: int = 4) -> str:
    return "-" if value is None else f"{value:.{digits}g}"


def outcome_of(window: FaultWindow, replayed: Replayed) -> str:
    """What came of taking the steps again, in a line."""
    if replayed.difference is None:
        return f"not stepped again: {replayed.why}"
    what = "the forces at its states" if window.adaptive else "its steps"
    if replayed.difference == 0.0:
        return f"{replayed.rows} rows: {what}, computed again, are the same to the last bit"
    return f"{replayed.rows} rows: {what}, computed again, differ by {replayed.difference:.3g}"
