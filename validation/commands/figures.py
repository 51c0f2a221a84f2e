"""The command `robotball figures`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from validation.commands.arguments import AGREES, OUT, File, Threads


@dataclass(frozen=True)
class Figures:
    """Draw the paper's Figs 3 to 14, each with its facts and with an engine's motion over it.

    Example: robotball figures 5 12
    """

    names: Positional[Annotated[tuple[str, ...], arg(metavar="N...", help_behavior_hint="")]] = ()
    """Which figures, 3 to 14 or tori (both rolling models' trajectories on the same tori); all of
    them if none is given."""
    out: Path = OUT
    """Folder for the pictures."""
    threads: Threads = None
    json: File = None
    """Also write which files were drawn."""

    def run(self) -> int:
        from validation.figures.paper_figures import chosen, draw_figures
        from validation.output import progress_bar, writable_folder, write_record

        pictures, out = chosen(self.names), writable_folder(self.out)
        with progress_bar(len(pictures)) as show:
            written = draw_figures(self.names, out, show)
        print(*written, sep="\n")
        write_record(self.json, {"figures": [str(path) for path in written]})
        return AGREES
