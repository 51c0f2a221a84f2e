"""The command that maps where MuJoCo's ball breaks.

It loads what it needs when it runs: compiled code and plots take a while to come.
"""

from dataclasses import asdict, dataclass, field
from typing import Annotated

from rich import box
from rich.console import Console
from rich.table import Table
from tyro.conf import Positional, arg

from validation.commands.arguments import AGREES, DISAGREES, File, Sweep, SweepOptions
from validation.results import writable_folder, write_record
from validation.runs import progress_bar


@dataclass(frozen=True)
class Extremes:
    """Map where each integrator and contact setting fails, loudly or silently."""

    maps: Positional[Annotated[tuple[str, ...], arg(metavar="MAP...")]] = ()
    """Which maps; all of them if none is given."""
    sweep: SweepOptions = field(default_factory=Sweep)
    json: File = None
    """Also write how many cells have which outcome, and the measured edges."""

    def run(self) -> int:
        from validation.extremes.atlas import (
            QUICK,
            WHOLE,
            Outcome,
            cells_of,
            measured_edges,
            missed,
            survey,
            tally,
        )
        from validation.extremes.maps import chosen
        from validation.extremes.pictures import draw
        from validation.sweeps import write_table

        maps, out = chosen(self.maps), writable_folder(self.sweep.out)
        cut = QUICK if self.sweep.quick else WHOLE
        with progress_bar(sum(len(cells_of(each, cut)) for each in maps)) as show:
            found = survey(maps, cut, out / "extremes.jsonl", self.sweep, show)
        table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
        for heading in ("map", "integrator", *(each.name for each in Outcome), "missed"):
            table.add_column(heading.lower().replace("_", "\n"), justify="right")
        summary = []
        for each in maps:
            results = found[each.name]
            for integrator in cut.integrators:
                mine = [one for one in results if one.cell["integrator"] == integrator]
                counts, lost = tally(mine), sum(map(missed, mine))
                edges = list(measured_edges(mine))
                numbers = [str(counts[kind] or "") for kind in Outcome]
                table.add_row(each.name, integrator, *numbers, str(lost or ""))
                summary.append(
                    {"map": each.name, "integrator": integrator, "missed": lost}
                    | {"outcomes": {kind.name: counts[kind] for kind in Outcome}}
                    | {"edges": [asdict(edge) for edge in edges]}
                )
        Console().print(table)
        for each in maps:
            path = out / f"extremes-{each.name}.png"
            draw(each, found[each.name], path)
            print(path)
        write_table(out / "extremes.csv", [one for each in maps for one in found[each.name]])
        print(out / "extremes.csv")
        write_record(self.json, {"quick": self.sweep.quick, "summary": summary})
        return DISAGREES if any(one["missed"] for one in summary) else AGREES
