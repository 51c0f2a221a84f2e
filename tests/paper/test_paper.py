"""The paper's claims hold, as printed or as corrected; each of them could fail, and would."""

import io
import math
from functools import cache

import pytest
from rich.console import Console

from robotball import InputError
from tests.paper import SECTIONS
from tests.paper import test_buildable_balls as ours
from tests.paper.claim import (
    AtLeast,
    Claim,
    Evidence,
    Part,
    Residual,
    Value,
    by,
    examine,
    show_findings,
    verdict_on,
)

finding = cache(examine)

CLAIMS = [claim for section in SECTIONS for claim in section.claims]
# In these are the long runs, the searches from everywhere and what compiles for seconds.
LONG = ("1.", "3.3.", "4.2.", "5.3.", ours.SECTION.title)
CHECKED = [
    pytest.param(
        claim,
        id=f"{claim.place}: {claim.statement}",
        marks=[pytest.mark.slow] if section.title.startswith(LONG) else [],
    )
    for section in (*SECTIONS, ours.SECTION)
    for claim in section.claims
    if not isinstance(claim.check, str)
]


@pytest.mark.parametrize("claim", CHECKED)
def test_a_claim_of_the_paper_holds_and_fails_with_one_thing_changed(claim: Claim) -> None:
    """Findings have the measured value beside its bound; a misprint is refuted by a number.

    The negative control is a sign, a factor or an index of the statement, as its twist says.
    """
    found = finding(claim)
    assert found.verdict == ("holds as corrected" if claim.printed else "holds"), found.evidence
    assert claim.twist
    twisted = finding(claim, twisted=True)
    assert twisted.verdict == "does not reproduce", twisted.evidence
    assert not isinstance(twisted.evidence, str), "it fails by a number, not by giving up"


def test_no_erratum_and_no_place_of_the_paper_is_left_out() -> None:
    """Each equation, proposition, remark and figure has a row.

    But Remark 2, which is notation, and (4.5), which (4.6) takes for granted. Of E1 to E26 E20 is a
    name, in E23 the paper itself says what is true, and E26 is a matter of digits. What is not
    checked says why: photographs, drawings, a name, a theorem, other machines, what is open.
    """
    theirs = [each.place for part in SECTIONS for each in part.claims]
    equations = {2: "1234567", 3: "123", 4: "12346", 5: "123456", "A": "123"}
    for place in (
        *(f"Remark {i}" for i in (1, 3, 4, 5, 6, 7, 8)),
        *(f"Prop. {i}" for i in (1, 2, 3, 4)),
        *("Figs 1-2", "Figs 3-4", "Fig. 5b", "Fig. 5c", "Fig. 5d"),
        *(f"Fig. {i}" for i in (6, 7, 8, 9, 10, "11a", 12, 13, 14)),
        *(f"({chapter}.{i})" for chapter, numbers in equations.items() for i in numbers),
        *("3.2", "3.3"),
    ):
        assert any(place == each or each.endswith(f", {place}") for each in theirs), place
    numbered = {int(each.place[1:].split(",")[0]): each for each in CLAIMS if each.place[0] == "E"}
    assert set(numbered) == set(range(1, 27))
    assert {number for number, each in numbered.items() if not each.printed} == {20, 23, 26}
    reasons = {each.place for each in CLAIMS if isinstance(each.check, str)}
    of_figures = {"Figs 1-2", "Figs 3-4"}
    assert reasons == of_figures | {"4", "4.2", "Remark 8", "E20, App. A"}


# The checker ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("evidence", "verdict"),
    [
        (Residual(1e-9, bound=1e-8), "holds"),
        (Residual(-1e-7, bound=1e-8), "does not reproduce"),
        (Residual(math.nan, bound=1e-8), "does not reproduce"),
        (Residual(1e-9, bound=1e-8, printed=1.0), "holds as corrected"),
        (Residual(1.0, bound=1e-8, printed=1e-9), "does not reproduce"),
        (Residual(1e-9, bound=1e-8, printed=-2e-9), "does not reproduce"),
        (Residual(1e-9, bound=1e-8, printed=math.nan), "does not reproduce"),
        (Value(0.1161, corrected=0.116, bound=1e-3), "holds"),
        (Value(0.1181, corrected=0.116, bound=1e-3), "does not reproduce"),
        (Value(0.1161, corrected=0.116, bound=1e-3, printed=0.11), "holds as corrected"),
        (Value(0.1161, corrected=0.116, bound=1e-2, printed=0.11), "does not reproduce"),
        (Value(math.nan, corrected=0.116, bound=1e-3), "does not reproduce"),
        (AtLeast(2.0, bound=1.0), "holds"),
        (AtLeast(0.5, bound=1.0), "does not reproduce"),
        (AtLeast(math.nan, bound=1.0), "does not reproduce"),
    ],
)
def test_the_verdict_follows_from_the_numbers(evidence: Evidence, verdict: str) -> None:
    """A misprint needs a printed form that fails beside a corrected one that holds."""
    assert verdict_on(evidence) == verdict


def test_a_chaotic_number_has_the_digits_that_are_known() -> None:
    """Λ₁ as measured with three kernels prints one line; what is exact keeps six digits."""
    measured = (0.11590076, 0.11620019, 0.11629094)
    lines = {str(Value(each, 0.116, bound=2e-3, printed=0.11, unit="1/s")) for each in measured}
    assert lines == {"printed 0.11, corrected 0.116 ± 0.002 1/s; is 0.12"}
    assert str(Value(2.0806241873, 16 / 7.69, bound=1e-9)).endswith("is 2.08062")
    assert str(Value(2, corrected=2, bound=0)) == "2; is 2"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (InputError("no periodic motion found"), "no periodic motion found"),
        (IndexError("[1]\nhas no third"), "its check ends in IndexError: [1] has no third"),
    ],
)
def test_a_check_that_ends_in_an_error_reproduces_nothing(error: Exception, words: str) -> None:
    """As an index where a wrong sign left no crossing: its row says so, and the others follow."""

    def gives_up(_: bool) -> Residual:
        raise error

    found = examine(Claim("a test", "a cycle", gives_up))
    assert (found.verdict, found.evidence) == ("does not reproduce", words)
    printed = io.StringIO()
    show_findings([Part("a test", (found,))], Console(file=printed, width=200))
    assert words in printed.getvalue()


@pytest.mark.parametrize(
    ("bound", "errors", "evidence"),
    [
        (0.1, [0.01, -0.03], "printed 9, corrected 0.03, bound 0.1 m"),
        (0.1, [math.nan, 0.01], "printed 9, corrected nan, bound 0.1 m"),
        (0, [True, False, 2], "printed 9, corrected 3 m"),
    ],
)
def test_the_largest_error_counts_or_the_number_of_wrong_ones(
    bound: float, errors: list[float], evidence: str
) -> None:
    """The largest of a check's errors is its evidence; NaN is larger than all."""
    nine = {"errors": [9.0]}
    made = by("arithmetic", "the sign", bound=bound, unit="m", printed=nine, errors=errors)
    assert str(examine(made(lambda errors: iter(errors))[1]).evidence) == evidence
