"""The command that draws the figures of the paper."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from validation.options import AGREES, OUT, File, Several, Threads


@dataclass(frozen=True)
class Figures:
    """Draw the paper's Figs 3 to 14, each with its facts and with an engine's motion over it.

    Example: robotball figures 5 12
    """

    names: Annotated[Several, arg(metavar="[N…]")] = ()
    """Which figures, 3 to 14 or tori (the same of both rolling models); all if none is given."""
    out: Path = OUT
    """Folder for the pictures."""
    threads: Threads = None
    json: File = None
    """Also write which files were drawn."""

    def run(self) -> int:
        from robotball.film import gl
        from validation.figures.paper_figures import chosen, draw_figures
        from validation.output import progress_bar, writable_folder, write_record

        pictures, out = chosen(self.names), writable_folder(self.out)
        with progress_bar(len(pictures)) as show:
            written = draw_figures(self.names, out, show)
        print(*written, sep="\n")
        if not self.names and gl.find_backend() is None:
            print(f"robotball: Figs 3 and 4 are left out: {gl.advice()}", file=sys.stderr)
        write_record(self.json, {"figures": [str(path) for path in written]})
        return AGREES
