"""The script that measures an engine in every version: selection, changes, and one measurement."""

from collections.abc import Sequence

import mujoco
import pytest

import robotball as rb
from bench.bare_steps import compiled
from bench.history import (
    bisect,
    cell_of,
    changelog_line,
    changes_between,
    changes_of,
    chosen,
    differ,
    last_patches,
    measure_version,
    package_of,
    places_of,
    releases,
    searched,
    spans_of,
    version_rows,
)
from tests.messages import naming
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


def test_versions_are_selected_by_the_beginning_of_their_name() -> None:
    """By default the last patch of each minor version is used; 3.1 does not match 3.10."""
    assert last_patches(VERSIONS) == ["2.3.1.post1", "3.1.2", "3.9.1", "3.10.0"]
    assert [places_of(VERSIONS, beginning) for beginning in ("3.1", "3.9", "2.3.0")] == [
        [2],
        [3, 4],
        [0],
    ]
    with pytest.raises(rb.InputError, match=naming("'3.99'")):
        places_of(VERSIONS, "3.99")


def test_versions_with_the_same_printed_numbers_are_one_row() -> None:
    """The row has the first version's date; a number that changes or is missing ends it."""
    rows: list[Row] = [
        {"version": "1", "date": "2020", "recipe": 7.501e-6},
        {"version": "2", "date": "2021", "recipe": 7.502e-6},
        {"version": "3", "date": "2022", "recipe": None},
        {"version": "4", "date": "2023", "recipe": 1e-9},
    ]
    found = [(row["version"], row["date"]) for row in spans_of(rows)]
    assert found == [("1 to 2", "2020"), ("3", "2022"), ("4", "2023")]


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
    """The factor works in both directions, and rounding does not count."""
    assert differ(before, after) == differ(after, before) == changed


@pytest.mark.parametrize(
    ("numbers", "pairs", "most"),
    [
        ([1.0, *[2.5] * 40], [(0, 1)], 8),
        ([*[1.0] * 40, 2.5], [(39, 40)], 8),
        ([1.0, 1.0, -1.0, -1.0, -1.0], [(1, 2)], 5),
        ([1.0, None, None, 9.0], [(0, 3)], 4),  # a version that cannot be installed has no number
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
    """The number of measurements per change is about the logarithm of the number of versions.

    Two opposite changes within a part are missed.
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


def test_a_row_has_the_changes_or_the_reason_for_missing_numbers() -> None:
    """A version that cannot be installed has a row with the reason, and hides no change."""
    missing = Result({"version": "2"}, None, "InputError: no wheel")
    rows = version_rows([result("1", 1e-5, cost=0.5), missing, result("3", 1e-9)])
    assert [row["changed"] for row in rows] == ["", "", "recipe"]
    assert [row["fault"] for row in rows] == ["slip", "no wheel", "slip"]
    assert [row["speed"] for row in rows] == [2.0, None, 1.0]
    ((number, before, after),) = changes_of(rows)
    assert (number, before["version"], after["version"]) == ("recipe", "1", "3")


def test_the_sentence_of_the_changelog_belongs_to_the_version() -> None:
    """It is the first sentence of the first entry with the word, without markup, or empty."""
    line = "Replaced it by derivatives in fast."
    assert changelog_line(CHANGELOG, "3.11.0", "fast") == line
    assert changelog_line(CHANGELOG, "3.1.1", "fast") == "fast is new."
    assert changelog_line(CHANGELOG, "3.11.0", "RK4") == ""
    assert changelog_line(CHANGELOG, "3.11", "fast") == changelog_line("", "3.11.0", "fast") == ""


def test_an_attribute_that_a_version_lacks_is_left_out_and_named() -> None:
    """The other attributes stay; other faults of the model are errors."""
    model, left_out = compiled('<mujoco><option timestep="0.5" age="3" size="2"/></mujoco>')
    assert (model.opt.timestep, sorted(left_out)) == (0.5, ["age", "size"])
    with pytest.raises(ValueError, match="age"):
        compiled("<mujoco><age/></mujoco>")


@pytest.mark.parametrize(("names", "changes"), [(("3.10", "2.3"), 1), (("3.9", "3.10"), 0)])
def test_each_change_is_found_among_the_releases_between(
    names: tuple[str, str], changes: int
) -> None:
    """The search covers all releases between the two named versions, in either order."""
    numbers = {version: 1e-9 if version in ("3.9.1", "3.10.0") else 7e-6 for version in VERSIONS}
    some = searched(VERSIONS, *names)

    def row(i: int) -> Row:
        return version_rows([result(some[i], numbers[some[i]])])[0]

    found = [
        (number, before["version"], after["version"])
        for number, before, after in changes_between(row, len(some))
    ]
    assert found == [("recipe", "3.9.0", "3.9.1")][:changes]


def test_versions_are_chosen_by_their_first_and_last_names() -> None:
    """They range from the first patch of one to the last patch of another version."""
    assert chosen(VERSIONS, "2.3", "3.9", every=True) == VERSIONS[:5]
    assert chosen(VERSIONS, "3.9", "", every=False) == ["3.9.1", "3.10.0"]


def test_the_version_here_is_measured() -> None:
    """One second of fig12 and the free body run with the installed MuJoCo, without pip."""
    cell = cell_of("mujoco", mujoco.__version__, 1.0, None)
    (row,) = version_rows([Result({**cell}, measure_version(cell), None)])
    assert row["as_it_comes"] == pytest.approx(0.387, abs=0.05)
    assert row["recipe"] == pytest.approx(6.0e-10, rel=0.1)
    assert row["free_body"] == pytest.approx(-1.571e-2, abs=2e-5)  # since MuJoCo 3.11
    assert "t = 0.02 s" in row["fault"]


@pytest.mark.parametrize(
    ("engine", "facts"), [("mujco", "'mujco' mujoco"), ("multibody", "multibody")]
)
def test_an_engine_without_released_versions_is_refused(engine: str, facts: str) -> None:
    """Examples: an unknown engine, and an engine that comes with robotball."""
    with pytest.raises(rb.InputError, match=naming(facts)):
        package_of(engine)


TALK = """
  Found link https://a/engine_x-3.10.0-py3-none-any.whl (from b), version: 3.10.0
  Found link https://a/engine_x-3.9.1.tar.gz (from b), version: 3.9.1
  Skipping link: none of the wheel's tags (cp312) are compatible: https://a/Engine.X-3.9.0-cp312.whl
  Link requires a different Python (3.11.7 not in: '>=3.12'): https://a/engine_x-3.11.0rc1-cp312.whl
  Found link https://a/engine_x-2.3.1.post1-cp311.whl (from b), version: 2.3.1.post1
  Found link https://a/other-4.0.0-cp311.whl (from b), version: 4.0.0
"""


def test_releases_are_the_versions_with_a_wheel() -> None:
    """Wheels for any Python count, the oldest first, without candidates and other packages."""
    assert releases(TALK, "engine-x") == ["2.3.1.post1", "3.9.0", "3.10.0"]
