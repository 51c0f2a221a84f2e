"""The command replay: the steps around the fault of a run, shown and taken again."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from tyro.conf import DisallowNone, Positional, arg

from robotball import InputError
from robotball.engines.mujoco.fault_window import Dump, Replayed, load, replay
from validation.commands.arguments import AGREES, DISAGREES

WIDTH = 100  # characters that the table needs


@dataclass(frozen=True)
class Replay:
    """Step through the window of states that a faulty run left, and take its steps again."""

    file: Positional[Annotated[Path, arg(metavar="FILE")]]
    """A SCENE-PRESET-fault.json of compare or video."""
    step: DisallowNone[Annotated[int | None, arg(metavar="N")]] = None
    """Show all of this row alone: its readings, positions and velocities."""
    interactive: bool = False
    """Go from row to row, each at a press of Enter, from the first bad one on."""

    def run(self) -> int:
        dump, console = load(self.file), Console()
        if self.step is not None:
            _show_row(dump, self.step, console)
            return AGREES
        replayed = replay(dump)
        console.print(
            f"{dump.name}, {dump.settings.get('name')}: {' and '.join(dump.causes)} "
            f"at t = {dump.time:.6g} s"
        )
        if self.interactive:
            _walk(dump, console)
        else:
            _show(dump, console)
        print(_said(dump, replayed))
        return AGREES if replayed.difference in (0.0, None) else DISAGREES


def _show(dump: Dump, console: Console) -> None:
    table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    for heading in ("row", *dump.columns):
        table.add_column(escape(heading), justify="right")
    table.add_column("")
    for i, row in enumerate(dump.table):
        bad = i == dump.bad
        cells = [f"{i}", *map(_cell, row), "<- bad" if bad else ""]
        table.add_row(*cells, style="yellow" if bad else "")
    if dump.bad == len(dump.table):
        table.add_row(f"{dump.bad}", *("" for _ in dump.columns), "<- no further")
    if not console.is_terminal:
        console = Console(width=WIDTH)
    console.print(table)


def _walk(dump: Dump, console: Console) -> None:
    if not sys.stdin.isatty():
        raise InputError("--interactive needs a terminal; leave it out to see all rows at once")
    for i in range(min(dump.bad, len(dump.table) - 1), len(dump.table)):
        _show_row(dump, i, console)
        if input("Enter for the next row, q to leave: ").strip():
            break


def _show_row(dump: Dump, row: int, console: Console) -> None:
    """All that is known of one row; raises InputError where there is no such row."""
    if not 0 <= row < len(dump.table):
        raise InputError(f"--step must be a row from 0 to {len(dump.table) - 1}, not {row}")
    console.print(f"row {row}{', the first bad one' if row == dump.bad else ''}")
    for name, value in zip(dump.columns, dump.table[row], strict=True):
        console.print(escape(f"  {name:20s} {_cell(value, digits=9)}"), highlight=False)
    qpos, qvel = dump.coordinates(row)
    for name, values in (("qpos", qpos), ("qvel", qvel)):
        console.print(f"  {name:20s} {' '.join(_cell(v, 9) for v in values)}", highlight=False)


def _cell(value: float | None, digits: int = 4) -> str:
    return "-" if value is None else f"{value:.{digits}g}"


def _said(dump: Dump, replayed: Replayed) -> str:
    if replayed.difference is None:
        return f"not stepped again: {replayed.why}"
    what = "the forces at its states" if dump.adaptive else "its steps"
    if replayed.difference == 0.0:
        return f"{replayed.rows} rows: {what}, computed again, are the same to the last bit"
    return f"{replayed.rows} rows: {what}, computed again, differ by {replayed.difference:.3g}"
