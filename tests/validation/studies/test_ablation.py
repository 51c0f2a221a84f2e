"""The ablation: each variant changes one choice, and each choice has its measured effect."""

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball import Settings
from robotball.engines.mujoco.settings import NAIVE
from tests.conftest import Robotball
from tests.messages import naming
from validation import compare
from validation.studies.ablation import (
    BOTTOM,
    CHOICES,
    TOP,
    _part_row,
    built_up,
    each_undone,
    without,
)
from validation.studies.measuring import Cost

pytestmark = pytest.mark.filterwarnings("ignore::robotball.SceneWarning")
FIG12, NAMES = rb.load_scene("fig12"), [choice.name for choice in CHOICES]

# Path error and error of M of the recipe with one choice undone, on fig12 over 10 s. The recipe has
# 2.5e-12 and 7.2e-12. With weak friction the ball leaves the plane, and the lost M depends on
# rounding: 2e-4 or 5e-5.
WORTH = {
    "drive": (3.8e-1, 8.6e-12),
    "friction": (4.2e-1, None),
    "cone": (6.5e-2, 1.6e-1),
    "root": (3.0e-1, 1.8e-12),
    "integrator": (3.7e-3, 1.1e-2),
    "start": (8.6e-4, 6.2e-5),
    "softness": (2.9e-10, 8.0e-10),
    "noslip": (3.9e-5, 7.2e-12),
    "solver": (2.5e-12, 7.2e-12),  # it affects the speed alone
    "timestep": (4.4e-11, 1.0e-10),
}


def differing(one: Settings, other: Settings) -> set[str]:
    """Return the fields of the model in which settings differ."""
    names = {field.name for field in fields(Settings)}
    names -= {"name", "error_tolerance", "stop_at_fault"}
    return {name for name in names if getattr(one, name) != getattr(other, name)}


def test_each_variant_is_its_choice_alone() -> None:
    """They lead from naive, with the frame as root, to `accurate`; then undo one choice each."""
    up, (top, *undone) = built_up(), each_undone()
    assert up[0].root == "frame"
    assert differing(up[0], NAIVE) == {"root"}
    assert differing(up[-1], rb.preset("accurate")) == differing(top, up[-1]) == set()
    assert [settings.name for settings in up] == ["naive", *NAMES]
    assert [settings.name for settings in undone] == NAMES
    for below, above, down, choice in zip(up, up[1:], undone, CHOICES, strict=False):
        assert differing(below, above) == differing(top, down) == set(choice.fields)
        assert differing(down, BOTTOM) == differing(TOP, BOTTOM) - set(choice.fields)


# `make test-studies` runs the others.
QUICK = ("drive", "friction", "cone", "integrator", "noslip")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.study) for n in WORTH]
)
def test_undoing_a_choice_has_its_measured_effect(name: str) -> None:
    """Path error and error of M are as measured.

    With the frame as root, or with servos on the hinges, M is constant but the path is wrong.
    """
    agreement, (path, drift) = compare(FIG12, settings=without(TOP, [name])), WORTH[name]
    assert agreement.path_error == pytest.approx(path, rel=0.2)
    if drift and drift > 1e-10:
        assert agreement.momentum_error == pytest.approx(drift, rel=0.2)
    elif drift:
        assert agreement.momentum_error < 2e-10  # measured 1.0e-10 at most


def test_errors_hide_one_another() -> None:
    """The integrator has no effect while the ball slips, and a large effect in the recipe."""
    slipping = built_up()[NAMES.index("friction") + 1]
    euler, rk4 = (
        compare(FIG12, rb.sample_times(2.0), settings=replace(slipping, integrator=each)).path_error
        for each in (None, "RK4")
    )
    assert euler == pytest.approx(rk4, rel=0.1)  # measured 0.598 and 0.591
    assert WORTH["integrator"][0] > 1e9 * WORTH["solver"][0]


def test_an_unknown_choice_is_refused_with_the_known_ones() -> None:
    """The message has the unknown name and the known names."""
    with pytest.raises(rb.InputError, match=naming("'slip' noslip")):
        without(TOP, ["noslip", "slip"])
    assert without(TOP, ["noslip", "start"]).name == "accurate - noslip - start"


def test_the_command_writes_table_picture_and_records(robotball: Robotball, tmp_path: Path) -> None:
    """`ablation --quick`: both tables on the terminal; JSON and a picture on disk."""
    arguments = ["study", "ablation", "fig12", "--quick", "--duration", "0.3", "--out", "."]
    status, printed, _ = robotball(*arguments, "--json", "a.json")
    assert status == 0
    assert all(f"{sign} {name}" in printed for name in NAMES for sign in "+-")
    record = json.loads((tmp_path / "a.json").read_text())
    variants = record["variants"]
    assert [run["choice"] for run in variants] == ["naive", *NAMES, "accurate", *NAMES]
    assert [run["direction"] for run in variants] == ["built up"] * 11 + ["undone"] * 11
    assert (variants[0]["settings"]["root"], variants[0]["times_naive"]) == ("frame", 1.0)
    assert all(v["times_naive_least"] <= v["times_naive_most"] for v in variants)
    # With the frame as root slip is a large part of the rolling speed; the recipe has RK4's error.
    slips = {run["choice"]: run["slip"] for run in variants[11:]}
    assert slips["root"] == pytest.approx(0.15, rel=0.2)
    assert slips["accurate"] < 3e-12  # measured 7.9e-13
    assert "mujoco" in record["versions"]
    assert (tmp_path / "fig12-mujoco-ablation-0.3s-quick.png").is_file()


def test_the_slip_of_a_ball_that_spins_on_the_spot_is_relative_to_its_radius() -> None:
    """The path of such a ball has no length."""
    scene = rb.load_scene("fig12").with_hinges(command=(0.0, 0.0))
    still = scene.from_start(rb.Start(scene.start.attitude, np.zeros(3)))
    cost = Cost((1.0,), 1.0)
    row = _part_row("", compare(still, rb.sample_times(0.1), settings="fast"), cost, cost)
    assert row["slip"] == 0.0
