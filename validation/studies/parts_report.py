"""What each modelled thing costs a step: a table in the terminal, and plain data."""

from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from validation.output import print_whole
from validation.studies.parts import Part
from validation.studies.timing import Cost

SIZES = ("bodies", "dofs", "sensors", "geoms")


def show_parts(parts: Sequence[Part], costs: Sequence[Cost], console: Console) -> None:
    """Print what a step costs with each part, relative to the minimal model."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("the minimal model with", no_wrap=True)
    table.add_column("a step costs", justify="right", no_wrap=True)
    for name in SIZES:
        table.add_column(name, justify="right")
    for each in rows(parts, costs):
        ratio = f"{each['ratio']:.2f} ({each['least']:.2f}-{each['most']:.2f})"
        table.add_row(each["part"], ratio, *(str(each[name]) for name in SIZES))
    print_whole(table, console)


def rows(parts: Sequence[Part], costs: Sequence[Cost]) -> list[dict[str, Any]]:
    """A row of plain numbers for every part."""
    return [
        {
            "part": part.name,
            "ratio": cost.ratio,
            "least": cost.spread[0],
            "most": cost.spread[1],
            "bodies": part.compiled.nbody,
            "dofs": part.compiled.nv,
            "sensors": part.compiled.nsensor,
            "geoms": part.compiled.ngeom,
        }
        for part, cost in zip(parts, costs, strict=True)
    ]
