"""Findings, as a table in the terminal and as JSON."""

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args

from rich import box
from rich.console import Console
from rich.table import Table

from validation.output import versions, write_text
from validation.paper.claim import Claim, Finding, Verdict, examine
from validation.progress import progress_bar

STYLES: dict[Verdict, str] = {"does not reproduce": "bold red", "not checked": "yellow"}


def examine_all(claims: Sequence[Claim]) -> list[Finding]:
    """Examine claims one after the other, with a bar on standard error."""
    findings: list[Finding] = []
    with progress_bar(len(claims)) as show:
        for claim in claims:
            show(len(findings), f"{claim.place}: {claim.statement}")
            findings.append(examine(claim))
    return findings


def show_findings(findings: Sequence[Finding], console: Console) -> None:
    """Print two lines a claim, and how many claims met which verdict; 80 columns hold it."""
    table = Table("place", "claim, and what it is off by", "verdict", box=box.SIMPLE_HEAD)
    table.padding, table.show_edge, table.pad_edge = (0, 0), False, False
    table.columns[0].no_wrap, table.columns[2].width = True, 9
    for each in findings:
        table.add_row(
            each.claim.place.replace(", ", "\n"),
            f"{each.claim.statement}\n[dim]{each.evidence}[/]",
            each.verdict,
            style=STYLES.get(each.verdict, ""),
        )
    console.print(table)
    console.print(summary(findings))


def summary(findings: Sequence[Finding]) -> str:
    """How many claims met which verdict."""
    counts = Counter(each.verdict for each in findings)
    return ", ".join(f"{verdict}: {counts[verdict]}" for verdict in get_args(Verdict))


def record(finding: Finding) -> dict[str, Any]:
    """One finding as plain data; numbers that are not finite are None."""
    numbers = {} if isinstance(finding.evidence, str) else asdict(finding.evidence)
    return {
        "place": finding.claim.place,
        "statement": finding.claim.statement,
        "verdict": finding.verdict,
        "evidence": str(finding.evidence),
        **{
            name: float(value) if value is not None and math.isfinite(value) else None
            for name, value in numbers.items()
            if name != "unit"
        },
        "unit": numbers.get("unit"),
    }


def write_findings(path: Path, findings: Sequence[Finding]) -> None:
    """The records and the versions that they depend on."""
    content = {"versions": versions(), "claims": [record(each) for each in findings]}
    text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False)
    write_text(path, text + "\n")
