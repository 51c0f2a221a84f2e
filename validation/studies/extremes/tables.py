"""The atlas as tables in the terminal, and as plain data."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from validation.studies.extremes.outcome import Outcome
from validation.studies.extremes.summary import measured_edges, missed, tally
from validation.sweeps import Result


def summary(found: Mapping[str, Sequence[Result]]) -> list[dict[str, Any]]:
    """A record for each map and integrator: outcomes, what was missed, and the edges."""
    records = []
    for name, results in found.items():
        for integrator in dict.fromkeys(each.cell["integrator"] for each in results):
            mine = [each for each in results if each.cell["integrator"] == integrator]
            counts = tally(mine)
            records.append(
                {
                    "map": name,
                    "integrator": integrator,
                    "cells": len(mine),
                    "outcomes": {kind.name: counts[kind] for kind in Outcome},
                    "missed": sum(map(missed, mine)),
                    "edges": [asdict(edge) for edge in measured_edges(mine)],
                }
            )
    return records


def show(records: Sequence[Mapping[str, Any]], console: Console) -> None:
    """Print how many cells have which outcome, then the edges as predicted and as measured."""
    outcomes = _table("map", "integrator", *(each.sign or "=" for each in Outcome), "missed")
    edges = _table("map", "integrator", "predicted edge", "kept up to", "broken from", "beyond")
    for each in records:
        place = (each["map"], each["integrator"])
        counts = (*each["outcomes"].values(), each["missed"])
        outcomes.add_row(*place, *(str(count or "") for count in counts))
        for edge in each["edges"]:
            numbers = (f"{edge[key]:.2g}" if edge[key] else "-" for key in ("kept", "broken"))
            edges.add_row(*place, edge["edge"], *numbers, str(edge["cells"]))
    console.print(outcomes)
    for kind in Outcome:
        console.print(f"  {kind.sign or '='}  {kind.sentence}")
    console.print("  missed: wrong, with neither a warning before the run nor a fault in it\n")
    console.print(edges)
    console.print("kept up to, broken from: in parts of the predicted limit; beyond: cells past it")


def _table(*headings: str) -> Table:
    # Eighty columns hold it, so the smallest padding there is.
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    for i, heading in enumerate(headings):
        left = i < 2 or "edge" in heading
        table.add_column(heading, justify="left" if left else "right", no_wrap=True)
    return table
