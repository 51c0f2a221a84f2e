"""The history of an engine's versions: which there are, what changed, and in which."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import robotball as rb
from robotball.engines import environments
from tests.messages import naming
from validation.options import Sweep
from validation.studies import history
from validation.studies.bare_steps import compiled
from validation.studies.history import (
    History,
    bisect,
    changelog_line,
    changes_of,
    differ,
    last_patches,
    places_of,
    version_rows,
)
from validation.study import Row
from validation.sweeps import Result

VERSIONS = ["2.3.0", "2.3.1.post1", "3.1.2", "3.9.0", "3.9.1", "3.10.0"]
CHANGELOG = """
Version 3.11.0 (July 27, 2026)
------------------------------
1. Faster.
3. :commit:`f0f` Replaced it by :ref:`derivatives<ge>` in ``fast``. It is so. Really.

Version 3.1.1 (Mar 18, 2024)
----------------------------
1. ``fast`` is new.
"""


def test_versions_are_called_by_the_beginnings_of_their_names() -> None:
    """Last patches are those of each minor version; 3.1 is no 3.10."""
    assert last_patches(VERSIONS) == ["2.3.1.post1", "3.1.2", "3.9.1", "3.10.0"]
    assert [places_of(VERSIONS, each) for each in ("3.1", "3.9", "2.3.0")] == [[2], [3, 4], [0]]
    with pytest.raises(rb.InputError, match=naming("'3.99'")):
        places_of(VERSIONS, "3.99")


@pytest.mark.parametrize(
    ("before", "after", "changed"),
    [
        (7.5e-6, 1.7e-9, True),
        (7.5e-6, 8.5e-6, False),
        (1.6e-2, -1.6e-2, True),
        (2e-14, -3e-14, False),  # rounding
        (2e-14, -1.6e-2, True),
    ],
)
def test_a_number_changes_by_a_factor_or_its_sign(
    before: float, after: float, changed: bool
) -> None:
    """In either direction, and never by rounding."""
    assert differ(before, after) == differ(after, before) == changed


@pytest.mark.parametrize(
    ("numbers", "pairs", "most"),
    [
        ([1.0, *[2.5] * 40], [(0, 1)], 8),
        ([*[1.0] * 40, 2.5], [(39, 40)], 8),
        ([1.0, 1.0, -1.0, -1.0, -1.0], [(1, 2)], 5),
        ([1.0, None, None, 9.0], [(0, 3)], 4),  # what cannot be installed has no number
        ([1.0, None, 1.0, None, 9.0, 9.0], [(2, 4)], 6),
        ([1.0, 9.0], [(0, 1)], 2),
        ([1.0, *[9.0] * 9, *[99.0] * 9], [(0, 1), (9, 10)], 13),
        ([1.0, 1.5, 2.5], [(0, 2)], 3),  # by less than a factor of two in each
        ([1.0, 9.0, 1.0], [], 2),
        ([None, 9.0], [], 2),
    ],
)
def test_bisection_names_each_version_that_changed_a_number(
    numbers: Sequence[float | None], pairs: list[tuple[int, int]], most: int
) -> None:
    """In about as many measurements a change as the logarithm of the number of versions.

    What changed and changed back within a part is not seen.
    """
    measured = set()

    def row(i: int) -> dict[str, float | None]:
        measured.add(i)
        return {"number": numbers[i]}

    assert bisect(row, "number", 0, len(numbers) - 1) == pairs
    assert len(measured) <= most


def result(version: str, recipe: float | None, cost: float = 1.0) -> Result:
    record = {"recipe": recipe, "recipe_cost": cost, "as_it_comes_fault": "slip"}
    return Result({"version": version}, record, None)


def test_a_row_says_what_changed_and_why_there_is_no_number() -> None:
    """A version that cannot be installed is a row with the reason, and hides no change."""
    missing = Result({"version": "2"}, None, "InputError: no wheel")
    rows = version_rows([result("1", 1e-5, cost=0.5), missing, result("3", 1e-9)])
    assert [row["changed"] for row in rows] == ["", "", "recipe"]
    assert [row["fault"] for row in rows] == ["slip", "no wheel", "slip"]
    assert [row["speed"] for row in rows] == [2.0, None, 1.0]
    ((number, before, after),) = changes_of(rows)
    assert (number, before["version"], after["version"]) == ("recipe", "1", "3")


def test_the_changelogs_sentence_is_that_versions() -> None:
    """The first entry with the word, its first sentence, without markup; else nothing."""
    line = "Replaced it by derivatives in fast."
    assert changelog_line(CHANGELOG, "3.11.0", "fast") == line
    assert changelog_line(CHANGELOG, "3.1.1", "fast") == "fast is new."
    assert changelog_line(CHANGELOG, "3.11.0", "RK4") == ""
    assert changelog_line(CHANGELOG, "3.11", "fast") == changelog_line("", "3.11.0", "fast") == ""


def test_an_attribute_that_a_version_lacks_is_left_out_and_named() -> None:
    """The rest of the model stays; another fault of it is an error."""
    model, left_out = compiled('<mujoco><option timestep="0.5" age="3" size="2"/></mujoco>')
    assert (model.opt.timestep, sorted(left_out)) == (0.5, ["age", "size"])
    with pytest.raises(ValueError, match="age"):
        compiled("<mujoco><age/></mujoco>")


def test_each_change_is_found_among_all_releases_between(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Of every number, between the patches that the two names mean."""
    numbers = {each: 1e-9 if each in ("3.9.1", "3.10.0") else 7e-6 for each in VERSIONS}

    def rows(_: History, versions: Sequence[str]) -> list[Row]:
        return version_rows([result(each, numbers[each]) for each in versions])

    monkeypatch.setattr(History, "_rows", rows)
    monkeypatch.setattr(history, "_with_pip", lambda _: Path("python"))
    monkeypatch.setattr(environments, "releases", lambda *_: VERSIONS)
    options: dict[str, Any] = {"sweep": Sweep(out=tmp_path)}
    assert History("mujoco", **options, bisect=("3.10", "2.3")).run() == 0
    assert capsys.readouterr().out.startswith("recipe: 7.0e-06 in 3.9.0, 1.0e-09 in 3.9.1: ")
    assert History("mujoco", **options, bisect=("3.9", "3.10")).run() == 0
    assert capsys.readouterr().out == "no number changed between 3.9.1 and 3.10.0\n"
