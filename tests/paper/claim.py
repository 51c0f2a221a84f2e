"""A claim of the paper, the evidence computed about it, and the verdict that follows.

Findings are shown as a table in the terminal and written as JSON.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from robotball import InputError
from robotball.files.json_text import json_text
from robotball.motion import versions
from validation.output import known, progress_bar, write_text

_Verdict = Literal["holds", "holds as corrected", "does not reproduce", "not checked"]


@dataclass(frozen=True)
class Residual:
    """The error of a statement: zero, where it is true.

    corrected: by the statement as it should be, `bound` the most that computing it may leave;
    printed: by the paper's own form where that is a misprint; all in `unit`.
    """

    corrected: float
    bound: float
    printed: float | None = None
    unit: str = ""

    def __str__(self) -> str:
        printed = "" if self.printed is None else f"printed {self.printed:.3g}, corrected "
        bound = "" if self.bound == 0 else f", bound {self.bound:.3g}"
        return f"{printed}{self.corrected:.3g}{bound} {self.unit}".rstrip()


@dataclass(frozen=True)
class Value:
    """A measured number beside the one that is stated.

    corrected: the number as it should be, from which `measured` may be off by `bound`; printed:
    the paper's own number where that is a misprint; all in `unit`.
    """

    measured: float
    corrected: float
    bound: float
    printed: float | None = None
    unit: str = ""

    def __str__(self) -> str:
        printed = "" if self.printed is None else f"printed {self.printed:g}, corrected "
        bound = "" if self.bound == 0 else f" ± {self.bound:.2g}"
        stated = f"{printed}{self.corrected:.6g}{bound} {self.unit}".rstrip()
        # No digit beyond the bound: those of a chaotic number differ from machine to machine.
        places = math.floor(-math.log10(self.bound)) if self.bound else 15
        return f"{stated}; is {round(self.measured, places):.6g}"


@dataclass(frozen=True)
class AtLeast:
    """A number that a statement needs to be as large as `bound`, as "not zero" does; in `unit`."""

    measured: float
    bound: float
    unit: str = ""

    def __str__(self) -> str:
        return f"{self.measured:.3g}, at least {self.bound:.3g} {self.unit}".rstrip()


Evidence = Residual | Value | AtLeast
Check = Callable[[bool], Evidence]
Errors = Iterator[ArrayLike]
"""The errors of a statement at one state after another."""


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, and where it stands there.

    statement: as it should read; printed: as the paper has it, where that is something else.
    means: by what independent means it is checked. check: computes the evidence of the statement
    as it stands, or, told to, of the statement with `twist` changed, which must fail. Where there
    is nothing to compute, check is the reason in words.
    """

    place: str
    statement: str
    check: Check | str
    means: str = ""
    twist: str = ""
    printed: str = ""


_Function = TypeVar("_Function", bound=Callable[..., Any])
_Checked = tuple[_Function, Claim]
"""A function, and the claim that it checks, without its place and statement."""
MINUS = {"twist": -1.0}
"""The control of a check that multiplies one term of its statement by `twist`."""


def by(
    means: str,
    twist: str,
    control: Mapping[str, Any] = MINUS,
    bound: float | None = None,
    unit: str = "",
    printed: Mapping[str, Any] | None = None,
    **given: Any,
) -> Callable[[_Function], _Checked[_Function]]:
    """Return a decorator that makes a function the check of the claim above.

    The function takes the arguments given and returns evidence. Where there is a `bound` it yields
    errors [unit] instead, of which the largest counts; with the bound 0 it yields what is wrong,
    which is counted. control, printed: the arguments with which it checks the statement with
    `twist` changed, and the printed form of a misprint.
    """

    def made(function: _Function) -> _Checked[_Function]:
        def worst(**arguments: Any) -> float:
            errors = [np.abs(each).max() for each in function(**arguments)]
            # By NumPy, to which what is not a number is the largest of all.
            return float(np.max(errors) if bound else np.sum(errors))

        def check(twisted: bool) -> Evidence:
            arguments = {**given, **(control if twisted else {})}
            if bound is None:
                evidence: Evidence = function(**arguments)
                return evidence
            # The printed form is computed as well: an erratum is a claim that it fails.
            refuted = None if printed is None else worst(**{**given, **printed})
            return Residual(worst(**arguments), bound, refuted, unit)

        return function, Claim("", "", check, means, twist)

    return made


@dataclass(frozen=True)
class Section:
    """A section of the paper with its claims in order."""

    title: str
    claims: list[Claim] = field(default_factory=list)

    def claim(
        self, place: str, statement: str, printed: str = ""
    ) -> Callable[[_Checked[_Function]], _Function]:
        """Return a decorator that adds a claim, checked `by` what stands below, to the section.

        Of several claims above one function Python adds the lowest first.
        """

        def add(checked: _Checked[_Function]) -> _Function:
            function, claim = checked
            self.claims.append(replace(claim, place=place, statement=statement, printed=printed))
            return function

        return add

    def unchecked(self, place: str, statement: str, reason: str) -> None:
        """Add a statement about which there is nothing to compute, for a reason."""
        self.claims.append(Claim(place, statement, reason))


@dataclass(frozen=True)
class _Finding:
    """The verdict on a claim; evidence is words where there are no numbers."""

    claim: Claim
    verdict: _Verdict
    evidence: Evidence | str


def examine(claim: Claim, twisted: bool = False) -> _Finding:
    """Compute what there is to compute about a claim, or about it twisted."""
    if isinstance(claim.check, str):
        return _Finding(claim, "not checked", claim.check)
    try:
        evidence = claim.check(twisted)
    except Exception as error:  # a wrong formula may end a computation in any way
        if not isinstance(error, InputError):
            error = InputError(f"its check ends in {type(error).__name__}: {error}")  # on one line
        return _Finding(claim, "does not reproduce", str(error))
    return _Finding(claim, verdict_on(evidence), evidence)


def verdict_on(evidence: Evidence) -> _Verdict:
    """Return the verdict: of a misprint the printed form fails and the corrected one holds."""
    # Not a number is no agreement, and for a printed form no refutation either.
    if isinstance(evidence, AtLeast):
        return "holds" if evidence.measured >= evidence.bound else "does not reproduce"
    measured = evidence.measured if isinstance(evidence, Value) else 0.0
    if not abs(measured - evidence.corrected) <= evidence.bound:
        return "does not reproduce"
    if evidence.printed is None:
        return "holds"
    # By the same bound: else a printed value within the scatter would count as wrong.
    refuted = abs(measured - evidence.printed) > evidence.bound
    return "holds as corrected" if refuted else "does not reproduce"


_STYLES: dict[_Verdict, str] = {"does not reproduce": "bold red", "not checked": "yellow"}
_PLACE, _VERDICT = 10, 9  # columns


@dataclass(frozen=True)
class Part:
    """The findings of a section."""

    title: str
    findings: tuple[_Finding, ...]


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
        console.print(_table_of(part))
    counts = Counter(each.verdict for part in parts for each in part.findings)
    words = (f"{verdict}: {counts[verdict]}" for verdict in get_args(_Verdict))
    console.print("\n" + ", ".join(words))


def _table_of(part: Part) -> Table:
    """Return the findings of a section as a table."""
    table = Table("place", "what is checked", "verdict", box=box.SIMPLE_HEAD, expand=True)
    table.padding, table.show_edge, table.pad_edge = (0, 0), False, False
    table.columns[0].width, table.columns[1].ratio, table.columns[2].width = _PLACE, 1, _VERDICT
    for each in part.findings:
        lines = [each.claim.statement]
        if each.claim.printed:
            lines.append(f"printed: {each.claim.printed}")
        means = f"{each.claim.means}: " if each.claim.means else ""
        lines.append(f"[dim]{means}{escape(str(each.evidence))}[/]")
        # The erratum's number on a line of its own, as the column is narrow.
        place = re.sub(r"^(E\d+), ", r"\1\n", each.claim.place)
        style = _STYLES.get(each.verdict, "")
        table.add_row(place, "\n".join(lines), each.verdict, style=style)
    return table


def _record(title: str, finding: _Finding) -> dict[str, Any]:
    """Return one finding as plain data; numbers that are not finite are None."""
    claim, evidence = finding.claim, finding.evidence
    numbers = {} if isinstance(evidence, str) else asdict(evidence)
    unit = numbers.pop("unit", None)
    return {
        "section": title,
        "place": claim.place,
        "statement": claim.statement,
        "as_printed": claim.printed or claim.statement,
        "means": claim.means,
        "control": claim.twist,
        "verdict": finding.verdict,
        "evidence": str(evidence),
        **{name: known(value) for name, value in numbers.items()},
        "unit": unit,
    }


def write_findings(path: Path, parts: Sequence[Part]) -> None:
    """Write the records and the versions that they depend on, as JSON."""
    claims = [_record(part.title, each) for part in parts for each in part.findings]
    content = {"versions": versions(), "claims": claims}
    write_text(path, json_text(content, indent=2) + "\n")
