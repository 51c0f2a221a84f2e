"""The command `robotball portraits`."""

from dataclasses import dataclass, field
from typing import Annotated

from tyro.conf import Positional, arg

from validation.commands.arguments import AGREES, DISAGREES, File, Sweep, SweepOptions


@dataclass(frozen=True)
class Portraits:
    """Map the phase portraits of motion from rest over K₃ and Ω, which section 4.2 leaves open.

    Example: robotball portraits axial --quick
    """

    maps: Positional[Annotated[tuple[str, ...], arg(metavar="MAP...", help_behavior_hint="")]] = ()
    """Which maps, axial (K₃ and Ω₃) or azimuth (K₃ and the angle of Ω₁, Ω₂); both if none."""
    sweep: SweepOptions = field(default_factory=Sweep)
    json: File = None
    """Also write how many cells have which portrait."""

    def run(self) -> int:
        from rich.console import Console

        from validation.output import progress_bar, writable_folder, write_picture, write_record
        from validation.results import changed
        from validation.studies.portrait_maps import (
            COUNT,
            QUICK_COUNT,
            chosen,
            picture,
            show,
            summary,
            survey,
        )
        from validation.sweeps import write_table

        planes, out = chosen(self.maps), writable_folder(self.sweep.out)
        count = QUICK_COUNT if self.sweep.quick else COUNT
        with progress_bar(len(planes) * count**2) as tell:
            found = survey(
                planes,
                count,
                out / "portraits.jsonl",
                tell,
                workers=self.sweep.workers,
                cluster=self.sweep.cluster,
            )
        records = summary(planes, found)
        show(records, Console())
        for plane in planes:
            stem = "-".join(["portraits", plane.name, *changed(self.sweep, "quick")])
            print(write_picture(out / f"{stem}.png", picture(plane, found[plane.name])))
            write_table(out / f"{stem}.csv", found[plane.name])
            print(out / f"{stem}.csv")
        write_record(self.json, {"quick": self.sweep.quick, "summary": records})
        return DISAGREES if any(each["against_the_formulas"] for each in records) else AGREES
