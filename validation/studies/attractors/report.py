"""The attractors in the terminal, and as plain data."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from robotball.engines.mujoco import LABEL
from robotball.engines.reduced import LABEL as EQUATIONS
from validation.output import print_whole
from validation.studies.attractors.measure import Measurement


def show_attractors(measurements: Sequence[Measurement], console: Console) -> None:
    """Print a row a measurement; σ is the sampling's standard error."""
    table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    table.add_column("", no_wrap=True)
    for heading in (LABEL.name, EQUATIONS.name, "apart", "bound", "σ", ""):
        table.add_column(heading, justify="right", no_wrap=True)
    for each in measurements:
        numbers = (f"{each.contact:.8g}", f"{each.equations:.8g}")
        sizes = (
            f"{each.apart:.1e}",
            f"{each.bound:.1e}",
            f"{each.error:.1e}" if each.error else "",
        )
        verdict = "holds" if each.holds else "DOES NOT HOLD"
        table.add_row(each.claim, *numbers, *sizes, verdict)
    print_whole(table, console)


def record(measurements: Sequence[Measurement]) -> dict[str, Any]:
    """The measurements as plain data."""
    return {"measurements": [{**asdict(each), "holds": each.holds} for each in measurements]}
