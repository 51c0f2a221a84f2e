"""Findings, as a table in the terminal and as JSON."""

import json
import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from validation.output import versions, write_text
from validation.paper.claim import Finding, Section, Verdict, examine
from validation.progress import progress_bar

STYLES: dict[Verdict, str] = {"does not reproduce": "bold red", "not checked": "yellow"}
PLACE, VERDICT = 10, 9  # columns


@dataclass(frozen=True)
class Part:
    """The findings of a section."""

    title: str
    findings: tuple[Finding, ...]


def examine_all(sections: Sequence[Section]) -> list[Part]:
    """Examine all claims, one after the other, with a bar on standard error."""
    done, parts = 0, []
    with progress_bar(sum(len(section.claims) for section in sections)) as show:
        for section in sections:
            findings = []
            for claim in section.claims:
                show(done, f"{claim.place}: {claim.statement}")
                findings.append(examine(claim))
                done += 1
            parts.append(Part(section.title, tuple(findings)))
    return parts


def show_findings(parts: Sequence[Part], console: Console) -> None:
    """Print each section with its claims, and how many met which verdict; 80 columns hold it.

    A claim has a line for what is checked, one for what is printed where that is something else,
    and one for the means, the number and its bound.
    """
    for part in parts:
        console.print(f"\n[bold]{part.title}[/]")
        console.print(table_of(part))
    console.print(f"\n{summary(parts)}")


def table_of(part: Part) -> Table:
    """The findings of a section."""
    table = Table("place", "what is checked", "verdict", box=box.SIMPLE_HEAD, expand=True)
    table.padding, table.show_edge, table.pad_edge = (0, 0), False, False
    table.columns[0].width, table.columns[1].ratio, table.columns[2].width = PLACE, 1, VERDICT
    for each in part.findings:
        lines = [each.claim.statement]
        if each.claim.printed:
            lines.append(f"printed: {each.claim.printed}")
        means = f"{each.claim.means}: " if each.claim.means else ""
        lines.append(f"[dim]{means}{escape(str(each.evidence))}[/]")
        place = re.sub(r"^(E\d+), ", r"\1\n", each.claim.place)
        style = STYLES.get(each.verdict, "")
        table.add_row(place, "\n".join(lines), each.verdict, style=style)
    return table


def summary(parts: Sequence[Part]) -> str:
    """How many claims met which verdict."""
    counts = Counter(each.verdict for part in parts for each in part.findings)
    return ", ".join(f"{verdict}: {counts[verdict]}" for verdict in get_args(Verdict))


def record(title: str, finding: Finding) -> dict[str, Any]:
    """One finding as plain data; numbers that are not finite are None."""
    claim, evidence = finding.claim, finding.evidence
    numbers = {} if isinstance(evidence, str) else asdict(evidence)
    return {
        "section": title,
        "place": claim.place,
        "statement": claim.statement,
        "as_printed": claim.printed or claim.statement,
        "means": claim.means,
        "control": claim.twist,
        "verdict": finding.verdict,
        "evidence": str(evidence),
        **{
            name: float(value) if value is not None and math.isfinite(value) else None
            for name, value in numbers.items()
            if name != "unit"
        },
        "unit": numbers.get("unit"),
    }


def write_findings(path: Path, parts: Sequence[Part]) -> None:
    """The records and the versions that they depend on."""
    claims = [record(part.title, each) for part in parts for each in part.findings]
    content = {"versions": versions(), "claims": claims}
    text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False)
    write_text(path, text + "\n")
