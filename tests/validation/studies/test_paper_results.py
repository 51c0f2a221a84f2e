"""The paper's results by both engines: each line holds, and with another ball it does not."""

from functools import cache

import numpy as np
import pytest

from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.settings import Settings
from robotball.scene import Scene
from tests.imports import PROJECT
from validation.studies import contact_sections, paper_results
from validation.studies.paper_results import PARTS, holds, tables
from validation.study import Row

SLOW = pytest.mark.slow


@cache
def quick_rows(part: str) -> list[Row]:
    """The rows of a part's quick form, computed once."""
    return [*PARTS[part](True)]


@pytest.mark.parametrize(
    "part", ["equilibria", "closed-orbits", "straight-lines", pytest.param("portraits", marks=SLOW)]
)
def test_a_result_is_the_same_by_both_engines(part: str) -> None:
    """Rates, basins, a fold, periods, integrals and f*, in the quick form."""
    rows = quick_rows(part)
    # Measured 3e-7 at most (f*, where the growth over f is not quite straight).
    assert max(row["apart"] for row in rows) < 1e-6
    assert all(map(holds, rows))


@pytest.mark.parametrize(
    ("part", "sign", "factor"),
    [
        ("equilibria", -1, 1.0),
        ("straight-lines", 1, 1.001),
        pytest.param("portraits", -1, 1.001, marks=pytest.mark.study),
    ],
)
def test_another_ball_turns_the_lines(
    part: str, sign: int, factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The engine rolls one whose eigenvalues have the other sign, or with K off by a thousandth."""

    def other(scene: Scene, settings: Settings) -> Model:
        frame, *rotors = (sign * drive.rate(0.0) for drive in scene.drives)
        rates = [frame, *(factor * rate for rate in rotors)]
        return build(scene.with_hinges(command=rates), settings)

    monkeypatch.setattr(contact_sections, "build", other)
    rows = [*PARTS[part](True)]
    rates = [row for row in rows if part == "portraits" or row["quantity"] in ("λ", "Re λ")]
    assert rates
    assert not any(map(holds, rates))
    if part == "equilibria":
        assert rates[0]["contact"] == pytest.approx(-rates[0]["equations"], abs=1e-5)


def test_what_decides_is_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps four times as long leave 4⁴ times the difference."""
    balanced = quick_rows("equilibria")
    monkeypatch.setattr(paper_results, "_BALANCED", paper_results._FAST)
    fast = [*PARTS["equilibria"](True)]
    left = [rows[0]["apart"] for rows in (fast, balanced)]  # of γ in 10 s; rates have rounding too
    assert left[0] / left[1] == pytest.approx(256, rel=0.1)  # measured 262


def test_the_page_has_every_part_with_numbers_of_both_engines() -> None:
    """And the lines of a part are those of a run, to the digits of the equations."""
    page = (PROJECT / "docs" / "results.md").read_text(encoding="utf-8")
    for name in PARTS:
        assert f"### {name.replace('-', ' ').capitalize()}\n" in page
    lines = [line.split(" | ") for line in page.splitlines() if line.startswith("| ")]
    lines = [line for line in lines if len(line) == 6 and line[1] not in ("quantity", "---")]
    numbers = np.array([[float(line[2]), float(line[3].partition(",")[0])] for line in lines])
    assert np.isfinite(numbers).all()
    assert len(numbers) > 40
    rows = quick_rows("straight-lines")
    own = [line.split(" | ")[:3] for line in tables({"": rows}).splitlines() if "σ" in line]
    assert len(own) == len(rows)
    assert [each for each in own if each not in [line[:3] for line in lines]] == []
