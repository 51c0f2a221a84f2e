"""The command `robotball paper`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import DisallowNone, arg


@dataclass(frozen=True)
class Paper:
    """Check every claim of the paper by computation, misprints included.

    Takes half a minute; the first time, another to compile. Exit status 0 where all that can be
    checked holds, as printed or as corrected.
    """

    json: DisallowNone[Annotated[Path | None, arg(metavar="FILE")]] = None
    """Also write the findings as JSON."""

    def run(self) -> int:
        from rich.console import Console

        from validation.output import writable_file
        from validation.paper import CLAIMS
        from validation.paper.report import examine_all, show_findings, write_findings

        if self.json:
            writable_file(self.json)
        findings = examine_all(CLAIMS)
        if self.json:
            write_findings(self.json, findings)
        show_findings(findings, Console())
        return int(any(each.verdict == "does not reproduce" for each in findings))
