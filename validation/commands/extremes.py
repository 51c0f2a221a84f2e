"""The command that maps where MuJoCo's ball breaks.

It loads what it needs when it runs: compiled code and plots take a while to come.
"""

from dataclasses import dataclass, field
from typing import Annotated

from rich.console import Console
from tyro.conf import Positional, arg

from validation.commands.arguments import AGREES, DISAGREES, File, Sweep, SweepOptions
from validation.output import writable_folder, write_record
from validation.progress import progress_bar


@dataclass(frozen=True)
class Extremes:
    """Map where each integrator and contact setting fails, loudly or silently."""

    maps: Positional[Annotated[tuple[str, ...], arg(metavar="MAP...")]] = ()
    """Which maps; all of them if none is given."""
    sweep: SweepOptions = field(default_factory=Sweep)
    json: File = None
    """Also write how many cells have which outcome, and the edges as measured."""

    def run(self) -> int:
        from validation.studies.extremes.atlas import QUICK, WHOLE, cells_of, survey
        from validation.studies.extremes.maps import chosen
        from validation.studies.extremes.pictures import draw
        from validation.studies.extremes.tables import show, summary
        from validation.sweeps import write_table

        maps, out = chosen(self.maps), writable_folder(self.sweep.out)
        cut = QUICK if self.sweep.quick else WHOLE
        with progress_bar(sum(len(cells_of(each, cut)) for each in maps)) as tell:
            found = survey(maps, cut, out / "extremes.jsonl", self.sweep, tell)
        records = summary(found)
        show(records, Console())
        pictures = [out / f"extremes-{each.name}.png" for each in maps]
        for each, picture in zip(maps, pictures, strict=True):
            draw(each, found[each.name], picture)
        table = out / "extremes.csv"
        write_table(table, [result for results in found.values() for result in results])
        print(*pictures, table, sep="\n")
        write_record(self.json, {"quick": self.sweep.quick, "summary": records})
        return DISAGREES if any(each["missed"] for each in records) else AGREES
