"""The paper's claims hold, as printed or as corrected, and a claim that is wrong is caught."""

import io
import json
import math
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rich.cells import cell_len
from rich.console import Console

import validation.paper
from robotball import InputError
from robotball import equations as eq
from validation.cli import main
from validation.paper import CLAIMS
from validation.paper.claim import Claim, Finding, Residual, Value, examine, verdict_on
from validation.paper.engine import seen
from validation.paper.report import show_findings

finding = cache(examine)


def errata() -> list[Claim]:
    return [claim for claim in CLAIMS if re.match(r"E\d+,", claim.place)]


@pytest.mark.slow
@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: f"{claim.place}: {claim.statement}")
def test_a_claim_of_the_paper_holds(claim: Claim) -> None:
    """None fails to reproduce; what is measured stands in the finding, beside its bound."""
    found = finding(claim)
    assert found.verdict != "does not reproduce", found.evidence


@pytest.mark.parametrize("claim", errata(), ids=lambda claim: f"{claim.place}: {claim.statement}")
def test_a_misprint_is_refuted_by_a_number(claim: Claim) -> None:
    """The printed form is off by more than the bound, the corrected one by less; or it is said why
    there is nothing to compute.
    """
    found = finding(claim)
    if isinstance(found.evidence, str):
        assert found.verdict == "not checked"
        return
    assert found.verdict == "holds as corrected"
    assert found.evidence.printed_error is not None
    assert found.evidence.printed_error > found.evidence.bound >= found.evidence.error


def test_every_erratum_is_there() -> None:
    """E1 to E26, and six claims that the paper as we have it leaves nothing to compute about."""
    assert {int(claim.place[1:].split(",")[0]) for claim in errata()} == set(range(1, 27))
    unchecked = [claim.place for claim in CLAIMS if isinstance(claim.check, str)]
    assert len(unchecked) == 6, unchecked


@pytest.mark.parametrize(("place", "drift"), [("E1, (3.1)", 9.546), ("E2, 3.2", 5.895)])
def test_printed_momenta_drift_along_mujocos_motion(place: str, drift: float) -> None:
    """By more than |M| = 5 kg m²/s, where the corrected ones stay to 2.5e-8 and 2.2e-8."""
    (claim,) = (claim for claim in CLAIMS if claim.place == place)
    evidence = finding(claim).evidence
    assert isinstance(evidence, Residual)
    assert evidence.printed == pytest.approx(drift, abs=1e-3)
    assert evidence.corrected < 2e-7


# The checker can fail ----------------------------------------------------------------------


def test_a_wrong_formula_is_refuted() -> None:
    """M of (3.1) with one part in 1e4 too much of Ĩω drifts; so does M without K."""
    ball = seen("fig12")
    p = ball.parameters
    for wrong in (
        p.momentum(eq.scale(1.0001, ball.omega), ball.gamma),
        replace(p, K=(0.0, 0.0, 0.0)).momentum(ball.omega, ball.gamma),
    ):
        claim = Claim("a test", "M stays", lambda M=wrong: Residual(ball.drift(M), bound=2e-7))  # type: ignore[misc]
        assert examine(claim).verdict == "does not reproduce"


@pytest.mark.parametrize(
    ("evidence", "verdict"),
    [
        (Residual(1e-9, bound=1e-8), "holds"),
        (Residual(-1e-7, bound=1e-8), "does not reproduce"),
        (Residual(math.nan, bound=1e-8), "does not reproduce"),
        (Residual(1e-9, bound=1e-8, printed=1.0), "holds as corrected"),
        (Residual(1.0, bound=1e-8, printed=1e-9), "does not reproduce"),
        (Residual(1e-9, bound=1e-8, printed=2e-9), "does not reproduce"),
        (Residual(1e-9, bound=1e-8, printed=math.nan), "does not reproduce"),
        (Value(0.1161, corrected=0.116, bound=1e-3), "holds"),
        (Value(0.1181, corrected=0.116, bound=1e-3), "does not reproduce"),
        (Value(0.1161, corrected=0.116, bound=1e-3, printed=0.11), "holds as corrected"),
        (Value(0.1161, corrected=0.116, bound=1e-2, printed=0.11), "does not reproduce"),
        (Value(math.nan, corrected=0.116, bound=1e-3), "does not reproduce"),
    ],
)
def test_the_verdict_follows_from_the_numbers(evidence: Residual | Value, verdict: str) -> None:
    """A misprint needs a printed form that fails beside a corrected one that holds."""
    assert verdict_on(evidence) == verdict


def refused() -> Residual:
    raise InputError("no periodic motion found")


def test_what_cannot_be_computed_is_no_agreement() -> None:
    """A computation that gives up does not reproduce its claim, and says why."""
    found = examine(Claim("a test", "a cycle", refused))
    assert (found.verdict, found.evidence) == ("does not reproduce", "no periodic motion found")


# The command -------------------------------------------------------------------------------

TRUE = Claim("E1, (3.1)", "true", lambda: Residual(np.float64(0.0), bound=1e-9, printed=1.0))
FALSE = Claim("3.2", "false", lambda: Value(math.nan, corrected=1.0, bound=1e-9, unit="s"))
LOST = Claim("4.1", "lost", "nothing to compute")


def run(
    monkeypatch: pytest.MonkeyPatch, claims: tuple[Claim, ...], *arguments: str
) -> int | str | None:
    monkeypatch.setattr(validation.paper, "CLAIMS", claims)
    with pytest.raises(SystemExit) as leaving:
        main(["paper", *arguments])
    return leaving.value.code


def test_exit_status_and_json(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """0 where all holds or is not checked, 1 where a claim fails, 2 where nothing can be written;
    the JSON is strict.
    """
    path = tmp_path / "paper.json"
    assert run(monkeypatch, (TRUE, LOST)) == 0
    assert run(monkeypatch, (TRUE, FALSE, LOST), "--json", str(path)) == 1
    claims = json.loads(path.read_text(), parse_constant=pytest.fail)["claims"]
    assert [each["verdict"] for each in claims] == [
        "holds as corrected",
        "does not reproduce",
        "not checked",
    ]
    assert (claims[0]["printed"], claims[0]["corrected"], claims[0]["bound"]) == (1.0, 0.0, 1e-9)
    assert claims[1]["measured"] is None
    assert run(monkeypatch, (TRUE,), "--json", str(tmp_path)) == 2


def test_the_table_takes_two_lines_a_claim_in_80_columns() -> None:
    """Nothing is cut off or wrapped: heading, rule and two lines each, and the summary."""
    out = io.StringIO()
    findings: list[Finding] = [finding(claim) for claim in CLAIMS]
    show_findings(findings, Console(file=out, width=80))
    lines = out.getvalue().rstrip("\n").split("\n")
    assert max(map(cell_len, lines)) <= 80
    assert len(lines) <= 2 + 2 * len(CLAIMS) + 1
    for each in findings:
        assert each.claim.statement in out.getvalue()
