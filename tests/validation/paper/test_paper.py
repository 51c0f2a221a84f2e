"""The paper's claims hold, as printed or as corrected; each of them could fail, and would."""

import io
import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rich.cells import cell_len
from rich.console import Console

import validation.paper
from robotball import InputError
from tests.validation.json_keys import misfits
from tests.validation.paper import ours
from validation.cli import main
from validation.paper import SECTIONS
from validation.paper.claim import (
    AtLeast,
    Claim,
    Evidence,
    Part,
    Residual,
    Section,
    Value,
    by,
    examine,
    show_findings,
    verdict_on,
)

finding = cache(examine)

CLAIMS = [claim for section in SECTIONS for claim in section.claims]
# Places of claims that take a third of a second or more: long runs and searches from everywhere.
LONGEST = (
    "1, par. 3", "1, par. 4", "3.3", "5.3", "E6, Prop. 2", "E22, Fig. 14", "E26, 5.3",
    "E7, Prop. 2", "Fig. 7", "Fig. 10", "Fig. 11a", "Fig. 12", "Fig. 13", "Fig. 14", "4",
)  # fmt: skip
CHECKED = [
    pytest.param(
        claim,
        id=f"{claim.place}: {claim.statement}",
        marks=[pytest.mark.study] if claim.place in LONGEST else [],
    )
    for section in (*SECTIONS, ours.SECTION)
    for claim in section.claims
    if not isinstance(claim.check, str)
]


@pytest.mark.parametrize("claim", CHECKED)
def test_a_claim_of_the_paper_holds(claim: Claim) -> None:
    """Findings have the measured value beside its bound; a misprint is refuted by a number."""
    found = finding(claim)
    assert found.verdict == ("holds as corrected" if claim.printed else "holds"), found.evidence
    assert claim.twist


@pytest.mark.study
@pytest.mark.parametrize("claim", CHECKED)
def test_a_claim_of_the_paper_fails_with_one_thing_changed(claim: Claim) -> None:
    """The negative control is a sign, a factor or an index of the statement, as its twist says."""
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


# The command ---------------------------------------------------------------------------------

HELD = Residual(np.float64(0.0), bound=1e-9, printed=1.0)
TRUE = Claim("E1, (3.1)", "true", lambda _: HELD, "arithmetic", "the sign", printed="untrue")
FALSE = Claim("3.2", "false", lambda _: Value(math.nan, corrected=1.0, bound=1e-9, unit="s"))
LOST = Claim("4.1", "lost", "nothing to compute")


def test_exit_status_and_json(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """0 where all holds or is not checked, 1 where a claim fails, 2 where nothing can be written;
    the JSON is strict.
    """

    def run(claims: list[Claim], *arguments: str) -> int | str | None:
        monkeypatch.setattr(validation.paper, "SECTIONS", (Section("3. A section", claims),))
        with pytest.raises(SystemExit) as leaving:
            main(["paper", *arguments])
        return leaving.value.code

    path = tmp_path / "paper.json"
    assert run([TRUE, LOST]) == 0
    assert run([TRUE, FALSE, LOST], "--json", str(path)) == 1
    record = json.loads(path.read_text(), parse_constant=pytest.fail)
    assert misfits("paper", record) == set()
    claims = record["claims"]
    held = {"verdict": "holds as corrected", "printed": 1.0, "corrected": 0.0, "bound": 1e-9}
    held |= {"section": "3. A section", "as_printed": "untrue", "means": "arithmetic"}
    held |= {"control": "the sign"}
    assert claims[0].items() >= held.items()
    failed = {"verdict": "does not reproduce", "measured": None, "as_printed": "false"}
    assert claims[1].items() >= failed.items()
    assert claims[2]["verdict"] == "not checked"
    assert run([TRUE], "--json", str(tmp_path)) == 2


def test_the_table_fits_80_columns_and_says_what_came_of_each_claim() -> None:
    """Each section's title, each place, statement, printed form, means and number; none cut off."""
    claims = [claim for claim in CLAIMS if claim.place not in LONGEST]
    parts = [
        Part(each.title, tuple(finding(claim) for claim in each.claims if claim in claims))
        for each in SECTIONS
    ]
    narrow, wide = io.StringIO(), io.StringIO()
    show_findings(parts, Console(file=narrow, width=80))
    show_findings(parts, Console(file=wide, width=200))
    assert max(map(cell_len, narrow.getvalue().rstrip("\n").split("\n"))) <= 80
    assert narrow.getvalue().count("…") == wide.getvalue().count("…")
    for claim in claims:
        for words in (claim.statement, claim.printed, claim.means, str(finding(claim).evidence)):
            assert words in wide.getvalue()
    assert all(part.title in wide.getvalue() for part in SECTIONS)
