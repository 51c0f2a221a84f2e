"""The commands about the paper: its statements checked, its figures drawn."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from validation.options import AGREES, OUT, File, Several, Threads


@dataclass(frozen=True)
class Paper:
    """Check the paper's statements one by one, in its order, misprints included.

    Each row has its place, what is checked, what is printed where that is something else, by what
    means, and the number with its bound. Where robotball has the formula that a row is about, the
    row holds that, too. Takes about a minute; the first time, another to compile. Exit status 0
    where all that can be checked holds, as printed or as corrected.

    Example: robotball paper --json paper.json
    """

    json: File = None
    """Also write the findings as JSON."""

    def run(self) -> int:
        from rich.console import Console

        from validation.paper import SECTIONS
        from validation.paper.claim import examine_all, show_findings, write_findings

        parts = examine_all(SECTIONS)
        if self.json:
            write_findings(self.json, parts)
        show_findings(parts, Console())
        failing = "does not reproduce"
        return int(any(each.verdict == failing for part in parts for each in part.findings))


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
