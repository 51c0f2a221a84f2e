"""The command `robotball attractors`."""

from dataclasses import dataclass

from validation.commands.arguments import AGREES, DISAGREES, File, check_files


@dataclass(frozen=True)
class Attractors:
    """Measure the attractors of Fig. 11 by a contact engine and by the equations.

    Period, multiplier, torus, strange attractor, exponents and drifts; three minutes in all.

    Example: robotball attractors --quick --json attractors.json
    """

    quick: bool = False
    """The periodic orbit of Fig. 11a alone, in a few seconds."""
    json: File = None
    """Also write the measurements."""

    def run(self) -> int:
        from rich.console import Console

        from validation.output import progress_bar, write_record
        from validation.studies.attractors import measure_attractors, record, show_attractors

        check_files(self.json)
        with progress_bar(8) as show:
            measurements = measure_attractors(show, self.quick)
        show_attractors(measurements, Console())
        write_record(self.json, record(measurements))
        return AGREES if all(each.holds for each in measurements) else DISAGREES
