"""The command `robotball extremes`: where the ball breaks, loudly or silently."""

from dataclasses import dataclass, field
from typing import Annotated

from tyro.conf import DisallowNone, Positional, arg

from validation.commands.arguments import AGREES, DISAGREES, File, Sweep, SweepOptions


@dataclass(frozen=True)
class Extremes:
    """Map where each integrator and contact setting fails, loudly or silently.

    Example: robotball extremes momentum --quick
    """

    maps: Positional[Annotated[tuple[str, ...], arg(metavar="MAP...", help_behavior_hint="")]] = ()
    """Which maps; all of them if none is given. There are
    momentum, frame, rotor, masses, scale, friction, torsion, gravity, contact, servo, duration."""
    random: DisallowNone[Annotated[int | None, arg(metavar="N", help_behavior_hint="")]] = None
    """Instead of maps, N random extreme runs and N ordinary ones.
    Is any failure missed by the precheck and the monitor, and is any alarm false?"""
    seed: int = 0
    """Of the random runs."""
    sweep: SweepOptions = field(default_factory=Sweep)
    json: File = None
    """Also write how many cells have which outcome, and the limits as measured."""

    def run(self) -> int:
        from robotball import InputError

        if self.random is None:
            return self._maps()
        if self.maps:
            raise InputError("extremes does one study at a time: give maps or --random")
        return self._random(self.random)

    def _maps(self) -> int:
        from rich.console import Console

        from validation.output import progress_bar, writable_folder, write_picture, write_record
        from validation.results import changed
        from validation.studies.atlas import picture, show, summary, survey, totals
        from validation.studies.extremes import QUICK, WHOLE, cells_of, chosen
        from validation.sweeps import write_table

        maps, out = chosen(self.maps), writable_folder(self.sweep.out)
        cut = QUICK if self.sweep.quick else WHOLE
        with progress_bar(sum(len(cells_of(each, cut)) for each in maps)) as tell:
            found = survey(
                maps,
                cut,
                out / "extremes.jsonl",
                tell,
                workers=self.sweep.workers,
                cluster=self.sweep.cluster,
            )
        records = summary(found)
        show(records, Console())
        for each in maps:
            stem = "-".join(["extremes", each.name, *changed(self.sweep, "quick")])
            print(write_picture(out / f"{stem}.png", picture(each, found[each.name])))
            write_table(out / f"{stem}.csv", found[each.name])
            print(out / f"{stem}.csv")
        all_maps = totals([each for results in found.values() for each in results])
        write_record(self.json, {"quick": self.sweep.quick, "totals": all_maps, "summary": records})
        return DISAGREES if any(each["missed"] for each in records) else AGREES

    def _random(self, count: int) -> int:
        from robotball.errors import check_count, check_seed
        from validation.output import progress_bar, write_record
        from validation.studies.random_runs import measure_detection

        check_count("random", count, 1)
        seed = check_seed(self.seed)
        with progress_bar(2 * count) as tell:
            found = measure_detection(count, seed, tell)
        print(*found.lines, sep="\n")
        write_record(self.json, found.record())
        return DISAGREES if found.missed else AGREES
