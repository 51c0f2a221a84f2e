"""The command `robotball paper`."""

from dataclasses import dataclass

from validation.commands.arguments import File


@dataclass(frozen=True)
class Paper:
    """Check the paper's statements one by one, in its order, misprints included.

    Each row has its place, what is checked, what is printed where that is something else, by what
    means, and the number with its bound; then come statements of our own. Takes about a minute;
    the first time, another to compile. Exit status 0 where all that can be checked holds, as
    printed or as corrected.

    Example: robotball paper --json paper.json
    """

    json: File = None
    """Also write the findings as JSON."""

    def run(self) -> int:
        from rich.console import Console

        from validation.output import writable_file
        from validation.paper import SECTIONS
        from validation.paper.claim import examine_all, show_findings, write_findings

        if self.json:
            writable_file(self.json)
        parts = examine_all(SECTIONS)
        if self.json:
            write_findings(self.json, parts)
        show_findings(parts, Console())
        failing = "does not reproduce"
        return int(any(each.verdict == failing for part in parts for each in part.findings))
