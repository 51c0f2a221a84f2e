"""A claim of the paper, what is computed about it, and the verdict that follows."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from robotball import InputError

Verdict = Literal["holds", "holds as corrected", "does not reproduce", "not checked"]


@dataclass(frozen=True)
class Residual:
    """How far a statement is from being true: zero, where it is.

    corrected: by the statement as it should be, `bound` the most that computing it may leave;
    printed: by the paper's own form where that is a misprint; all in `unit`.
    """

    corrected: float
    bound: float
    printed: float | None = None
    unit: str = ""

    @property
    def error(self) -> float:
        return abs(self.corrected)

    @property
    def printed_error(self) -> float | None:
        return None if self.printed is None else abs(self.printed)

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

    @property
    def error(self) -> float:
        return abs(self.measured - self.corrected)

    @property
    def printed_error(self) -> float | None:
        return None if self.printed is None else abs(self.measured - self.printed)

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

    @property
    def error(self) -> float:
        return self.bound - self.measured

    def __str__(self) -> str:
        return f"{self.measured:.3g}, at least {self.bound:.3g} {self.unit}".rstrip()


Evidence = Residual | Value | AtLeast
Check = Callable[[float], Evidence]


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, and where it stands there.

    statement: as it should read; printed: as the paper has it, where that is something else.
    means: by what independent means it is checked. check: computes the evidence; at 1 of the
    statement as it stands, at `control` of the statement with `twist` changed, which must fail.
    Where there is nothing to compute, check is the reason in words.
    """

    place: str
    statement: str
    check: Check | str
    means: str = ""
    twist: str = ""
    control: float = -1.0
    printed: str = ""


@dataclass(frozen=True)
class Section:
    """A section of the paper, or the part that is not the paper's, with its claims in order."""

    title: str
    claims: tuple[Claim, ...]


@dataclass(frozen=True)
class Finding:
    """What became of a claim; evidence is words where there are no numbers."""

    claim: Claim
    verdict: Verdict
    evidence: Evidence | str


def examine(claim: Claim, twist: float = 1.0) -> Finding:
    """Compute what there is to compute about a claim, or about it twisted."""
    if isinstance(claim.check, str):
        return Finding(claim, "not checked", claim.check)
    try:
        evidence = claim.check(twist)
    except InputError as error:
        return Finding(claim, "does not reproduce", str(error))
    except Exception as error:  # a wrong formula may end a computation in any way
        words = InputError(f"its check ends in {type(error).__name__}: {error}")  # on one line
        return Finding(claim, "does not reproduce", str(words))
    return Finding(claim, verdict_on(evidence), evidence)


def verdict_on(evidence: Evidence) -> Verdict:
    """The verdict: a misprint is one only if the printed form fails where the corrected holds."""
    # Not a number is no agreement, and for a printed form no refutation either.
    if isinstance(evidence, AtLeast):
        return "holds" if evidence.measured >= evidence.bound else "does not reproduce"
    if not evidence.error <= evidence.bound:
        return "does not reproduce"
    printed = evidence.printed_error
    if printed is None:
        return "holds"
    if math.isnan(printed) or printed <= evidence.bound:
        return "does not reproduce"
    return "holds as corrected"
