"""The ablation: every variant is one choice, and every choice is worth what it is said to be."""

import csv
import json
from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import pytest

import robotball as rb
from robotball import Settings
from robotball.engines.mujoco.settings import NAIVE
from tests.conftest import Robotball
from validation import Agreement, compare
from validation.studies.ablation import (
    BOTTOM,
    CHOICES,
    TOP,
    built_up,
    each_undone,
    measure_ablation,
    without,
)

pytestmark = pytest.mark.filterwarnings("ignore::robotball.SceneWarning")
NAMES = [choice.name for choice in CHOICES]

# The recipe with one choice undone on fig12 over 10 s, as path error and drift of M; the recipe
# has 2.5e-12 and 7.2e-12. Where friction is too weak the ball leaves the plane, and rounding tells
# how much of M is lost: 2e-4 or 5e-5.
WORTH = {
    "drive": (9.7e-2, 3.3e-11),
    "friction": (4.2e-1, None),
    "cone": (6.5e-2, 1.6e-1),
    "root": (3.0e-1, 1.8e-12),
    "integrator": (3.7e-3, 1.1e-2),
    "start": (8.6e-4, 6.2e-5),
    "softness": (2.9e-10, 8.0e-10),
    "noslip": (3.9e-5, 7.2e-12),
    "timestep": (4.4e-11, 1.0e-10),
}


@cache
def undone(name: str) -> Agreement:
    return compare(rb.load_scene("fig12"), without(TOP, [name]))


def differing(one: Settings, other: Settings) -> set[str]:
    """The fields of the model in which settings differ."""
    names = {field.name for field in fields(Settings)} - {
        "name",
        "error_tolerance",
        "stop_at_fault",
    }
    return {name for name in names if getattr(one, name) != getattr(other, name)}


def test_the_way_up_goes_from_the_naive_preset_to_the_accurate_one() -> None:
    """The lower end is the naive preset with the frame as root; the upper end is `accurate`."""
    variants = built_up()
    assert differing(variants[0], NAIVE) == {"root"}
    assert variants[0].root == "frame"
    assert differing(variants[-1], rb.preset("accurate")) == set()
    assert differing(each_undone()[0], rb.preset("accurate")) == set()


def test_each_variant_is_its_choice_alone() -> None:
    """Built up, a variant differs from the one before in all fields of its choice alone."""
    variants = built_up()
    assert [variant.name for variant in variants] == ["naive", *NAMES]
    for below, variant, choice in zip(variants, variants[1:], CHOICES, strict=False):
        assert differing(below, variant) == set(choice.fields)


def test_each_undone_choice_is_undone_alone() -> None:
    """At the top, the settings differ from the recipe in one choice's fields and no other."""
    top, *variants = each_undone()
    assert [variant.name for variant in variants] == NAMES
    for variant, choice in zip(variants, CHOICES, strict=True):
        assert differing(top, variant) == set(choice.fields)
        assert differing(variant, BOTTOM) == differing(TOP, BOTTOM) - set(choice.fields)


@pytest.mark.parametrize("name", WORTH)
def test_every_choice_is_worth_its_error(name: str) -> None:
    """Undone alone it makes the path's error as large as measured, far over the recipe's own."""
    agreement, (path, drift) = undone(name), WORTH[name]
    assert agreement.path_error is not None
    assert agreement.path_error == pytest.approx(path, rel=0.2)
    assert agreement.path_error > 10 * 2.5e-12
    if drift and drift > 1e-10:  # below, it is the drift of the recipe itself
        assert agreement.momentum_error == pytest.approx(drift, rel=0.2)


@pytest.mark.slow
def test_the_solver_is_chosen_for_its_speed_alone() -> None:
    """MuJoCo's own solver, with all its iterations, rolls the ball no better and no worse."""
    # Measured 2.495e-12, as the recipe's to three digits: RK4's error.
    assert undone("solver").path_error == pytest.approx(2.5e-12, rel=0.2)


def test_momentum_does_not_tell_of_a_wrong_root_or_drive() -> None:
    """With the frame as root or servos on the hinges M is kept, and the path is wrong."""
    for name in ("root", "drive"):
        agreement = undone(name)
        assert agreement.momentum_error is not None
        assert agreement.momentum_error < 1e-10  # measured 3.3e-11 at most
        assert agreement.path_error is not None
        assert agreement.path_error > 0.05  # measured 0.097 at least


def test_errors_hide_one_another() -> None:
    """The integrator is worth nothing while the ball slips, and nearly everything at the top."""
    scene, times = rb.load_scene("fig12"), rb.sample_times(2.0)
    slipping = built_up()[NAMES.index("friction") + 1]
    errors = [
        compare(scene, replace(slipping, integrator=each), times).path_error
        for each in (None, "RK4")
    ]
    # Measured 0.598 and 0.591.
    assert errors[0] == pytest.approx(errors[1], rel=0.1)
    integrator = undone("integrator").path_error
    assert integrator is not None
    assert integrator > 1e8 * 2.5e-12  # measured 1.5e9 times


def test_undoing_a_choice_by_a_wrong_name_says_which_there_are() -> None:
    """A name that no choice has is refused with the names that there are."""
    with pytest.raises(rb.InputError, match="no choice is called 'slip'; did you mean noslip"):
        without(TOP, ["noslip", "slip"])
    assert without(TOP, ["noslip", "start"]).name == "accurate - noslip - start"


@pytest.mark.slow
def test_the_ablation_reports_every_variant() -> None:
    """Both tables, each variant timed as often as requested; slip is over the rolling speed."""
    told: list[float] = []
    rows = measure_ablation(
        rb.load_scene("fig12"), rb.sample_times(0.5), 1, lambda part, what: told.append(part)
    ).rows
    assert [row["choice"] for row in rows] == ["naive", *NAMES, "accurate", *NAMES]
    assert [row["direction"] for row in rows] == ["built up"] * 11 + ["undone"] * 11
    # One round: its ratio is the least and the most.
    assert all(row["times_naive_least"] == row["times_naive_most"] for row in rows)
    assert rows[0]["times_naive"] == 1.0
    assert told == sorted(told)
    assert told[-1] == 1.0
    # The frame as root slips by a good part of the rolling speed; the recipe by RK4's error.
    slips = {row["choice"]: row["slip"] for row in rows[11:]}
    assert slips["root"] == pytest.approx(0.23, rel=0.2)
    assert slips["accurate"] < 5e-12  # measured 1.4e-12


@pytest.mark.slow
def test_the_command_writes_table_picture_and_records(robotball: Robotball, tmp_path: Path) -> None:
    """`ablation --quick`: both tables on the terminal; JSON, CSV and a picture on disk."""
    arguments = ["ablation", "classical_regular", "--quick", "--duration", "0.5"]
    status, printed, _ = robotball(*arguments, "--out", ".", "--json", "a.json", "--csv", "a.csv")
    assert status == 0
    assert all(f"{sign} {name}" in printed for name in NAMES for sign in "+-")
    record = json.loads((tmp_path / "a.json").read_text())
    assert [variant["choice"] for variant in record["variants"]] == [
        "naive",
        *NAMES,
        "accurate",
        *NAMES,
    ]
    assert record["variants"][0]["settings"]["root"] == "frame"
    assert "mujoco" in record["versions"]
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["path_error"]) for row in rows] == [
        variant["path_error"] for variant in record["variants"]
    ]
    picture = tmp_path / "classical_regular-mujoco-ablation-0.5s-quick.png"
    assert picture.read_bytes()[:4] == b"\x89PNG"
