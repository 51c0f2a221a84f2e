"""The trade-off: its configurations, its front, and first order beside it."""

import json
import math
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import robotball as rb
from robotball import Settings
from robotball.engines.mujoco.mjcf_export import left_out
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import BY_LOAD, FIRST_ORDER, NAIVE, Prescribed, recipe
from robotball.motors import Servo
from tests.conftest import Robotball
from tests.validation.examples import example
from validation.bench.gallery import numbers_of_tradeoff
from validation.studies.parts_cost import parts_of, split
from validation.studies.tradeoff import (
    TARGET,
    Configuration,
    cells_of,
    configurations,
    describe,
    first_order_lines,
    measure,
    options_of,
    record,
    settings_with,
    sound_pareto_front,
    tradeoff_of,
)
from validation.study import pareto_front
from validation.sweeps import Result

CLOUD = st.lists(st.tuples(st.integers(1, 9), st.integers(1, 9)), min_size=1, max_size=40)


def beats(a: tuple[int, int], b: tuple[int, int]) -> bool:
    """Whether a is nowhere worse than b, and somewhere better."""
    return a != b and a[0] <= b[0] and a[1] <= b[1]


@given(CLOUD)
def test_nothing_beats_what_is_on_the_front(cloud: list[tuple[int, int]]) -> None:
    """And each point that is not on it is beaten by, or the same as, one that is."""
    front = [cloud[i] for i in pareto_front(*zip(*cloud, strict=True))]
    assert not any(beats(point, member) for point in cloud for member in front)
    assert all(point in front or any(beats(m, point) for m in front) for point in cloud)
    assert front == sorted(front, key=lambda point: point[1])


def test_the_study_has_hundreds_of_distinct_configurations() -> None:
    """At least 400, with every preset, integrator, solver and cone, and both kinds of drive."""
    every = configurations()
    assert len(every) >= 400
    assert len({repr(options_of(each)) for each in every}) == len(every)
    assert [each.name for each in every[: len(rb.PRESETS)]] == list(rb.PRESETS)
    assert {each.integrator for each in every} == {None, "RK4", "DOP853", *FIRST_ORDER}
    assert {each.solver for each in every} == {None, BY_LOAD, "PGS", "Newton", "CG"}
    assert {each.cone for each in every} == {None, "elliptic"}
    assert {type(each.drive) for each in every} == {Servo, Prescribed, type(BY_LOAD)}
    for name in ("timestep", "impratio", "noslip_iterations", "solref", "solreffriction"):
        assert len({getattr(each, name) for each in every}) >= 3, name


def test_every_option_that_is_no_default_is_recorded() -> None:
    """A cell, read back from JSON, gives the same settings to the last digit."""
    settings = configurations()
    for each, cell in zip(settings, cells_of("fig12", settings, 1.0, 1), strict=True):
        again = settings_with(json.loads(json.dumps(cell)))
        assert not again.stop_at_fault  # what a run does after its fault is seen too
        unnamed = {
            name: getattr(each, name) for name in ("name", "error_tolerance", "stop_at_fault")
        }
        assert replace(again, **unnamed) == each
    default = Settings(name="", error_tolerance=1.0, drive=NAIVE.drive)
    options = options_of(settings[2])
    for field in fields(Settings):
        differs = getattr(settings[2], field.name) != getattr(default, field.name)
        assert (field.name in options) == (
            differs and field.name not in ("name", "error_tolerance")
        )


def test_a_configuration_is_described_by_what_it_does_otherwise() -> None:
    """From the recipe or from the naive model, whichever is nearer."""
    assert describe(options_of(recipe("", 1, timestep=1e-3))) == "recipe"
    assert describe({**options_of(recipe("", 1)), "impratio": 100.0}) == "recipe, impratio 100"
    assert describe(options_of(replace(NAIVE, cone="elliptic"))) == "naive, cone elliptic"
    servo = replace(recipe("", 1), drive=Servo(gain=5.0))
    assert describe(options_of(servo)) == "recipe, drive gain 5"


def points(
    steps: Sequence[float], errors: Sequence[float], integrator: str = "Euler", drift: float = 1.0
) -> list[Configuration]:
    """Sound points of one line, of which a simulated second costs 1 µs a step."""
    return [
        Configuration(
            {"integrator": integrator, "timestep": h}, e, drift * e, 1.0, (1, 1), 1e-6 / h, ""
        )
        for h, e in zip(steps, errors, strict=True)
    ]


def test_first_order_is_extrapolated_along_its_own_slope() -> None:
    """A power law of order 1.1 that ends at 1e-3 gives the step that has 1e-6."""
    steps = [1e-2, 3e-3, 1e-3]
    (line,) = first_order_lines(points(steps, [2.0 * h**1.1 for h in steps]))
    exact = 1e-6 / (TARGET / 2.0) ** (1 / 1.1)
    assert line.extrapolated
    # Measured 3.4e-15 and 2.1e-14: the logarithms' rounding.
    assert line.order == pytest.approx(1.1, rel=2e-14)
    assert line.at_target == pytest.approx(exact, rel=1e-13)


def test_a_line_steeper_than_first_order_is_not_taken_for_it() -> None:
    """Errors that cancel fall faster for a while; nor is RK4 first order."""
    steps = [1e-2, 3e-3, 1e-3]
    assert not first_order_lines(points(steps, [h**1.5 for h in steps]))
    assert not first_order_lines(points(steps, steps, "RK4"))
    assert not first_order_lines(points(steps[:2], steps[:2]))


def test_no_result_is_on_the_front() -> None:
    """Neither a faulty run, nor a broken one, nor a path that is good while |M| is not."""
    good = points([1e-2], [1e-3])[0]
    faulty = replace(good, error=1e-5, trouble="contact lost at t = 0 s")
    broken = replace(good, error=math.nan, momentum_error=math.nan, trouble="the state diverged")
    lucky = replace(good, error=1e-6, momentum_error=1e-3)
    assert sound_pareto_front([faulty, broken, lucky, good]) == [good]


def test_a_configuration_is_measured_by_its_cell_alone() -> None:
    """Errors, faults and a cost; the naive model's faults are the reason why it is no result."""
    naive, balanced = configurations()[0], configurations()[2]
    cells = cells_of("fig12", [naive, balanced], 0.5, 1)
    study = tradeoff_of(
        rb.load_scene("fig12"), [Result(dict(c), dict(measure(c)), None) for c in cells]
    )
    assert [point.title for point in study.configurations] == ["naive", "balanced"]
    assert [point.title for point in study.pareto_front] == ["balanced"]
    assert study.configurations[0].trouble.startswith("hinge rate off by over 0.001 at t = 0.002 s")
    # Measured 3.3e-10: RK4's error at 5 ms.
    assert study.configurations[1].error < 6e-10
    assert study.configurations[1].cost > 0
    json.dumps(record(study), allow_nan=False)


def test_a_run_that_failed_is_recorded_with_its_reason() -> None:
    """It has no numbers, in JSON null, and is on no front."""
    (cell,) = cells_of("fig12", [configurations()[1]], 1.0, 1)
    study = tradeoff_of(rb.load_scene("fig12"), [Result(dict(cell), None, "took longer than 60 s")])
    assert study.pareto_front == ()
    assert record(study)["configurations"][0]["trouble"] == "took longer than 60 s"
    assert record(study)["configurations"][0]["error"] is None
    assert study.ratio is None


def test_a_rotor_split_in_three_moves_the_ball_alike() -> None:
    """The extra bodies of --parts are the same inertia and the same K."""
    scene, times = rb.load_scene("fig12"), rb.sample_times(2.0)
    one = run(build(scene, rb.preset("accurate")), times)
    three = run(build(split(scene), rb.preset("accurate")), times)
    away = np.abs(one.contact_point - three.contact_point).max()
    assert len(split(scene).ball.rotors) == 3
    # Measured 2.1e-14 m of a path of 4.6 m: rounding.
    assert away < 1e-13


@pytest.mark.parametrize("name", ["fig12", "classical_regular", "chaplygin_ball", "servo_motors"])
def test_each_part_is_in_its_variant_alone(name: str) -> None:
    """The minimal model is the smallest of all; the last has everything."""
    parts = parts_of(rb.load_scene(name))
    minimal, whole = parts["minimal"], parts["all of it"]
    assert parts["geoms, textures, lights"].ngeom > minimal.ngeom
    assert parts["geoms, textures, lights"].nlight == 1
    assert parts["sensors of every body"].nsensor > minimal.nsensor
    assert parts["Newton for PGS"].opt.solver == mujoco.mjtSolver.mjSOL_NEWTON
    assert parts["100 iterations"].opt.iterations == 100
    assert parts["condim 6"].pair_dim.tolist() == [6]
    assert ("condim 4" in parts) == (rb.load_scene(name).rolling == "classical")
    assert ("servos for the rates" in parts) == (minimal.nv > 6 and name != "servo_motors")
    for size in ("ngeom", "nsensor", "nbody", "nv"):
        assert getattr(whole, size) == max(getattr(each, size) for each in parts.values()), size
        assert getattr(minimal, size) == min(getattr(each, size) for each in parts.values()), size


@pytest.mark.slow
def test_the_quick_study_writes_its_files(robotball: Robotball, tmp_path: Path) -> None:
    """A picture, a table and the data; started again, nothing is run again."""
    arguments = (*example("tradeoff").split(), "--duration", 0.5)
    status, shown, _ = robotball(*arguments)
    assert status == 0
    assert "The Pareto front: nothing is both cheaper and better." in shown
    assert "times as much" in shown
    stem = "fig12-mujoco-tradeoff-0.5s-quick"
    names = [*(f"{stem}{kind}" for kind in (".png", ".json", ".csv")), "fig12-tradeoff.jsonl"]
    files = [tmp_path / "out" / name for name in names]
    assert sorted((tmp_path / "out").iterdir()) == sorted(files)
    assert files[0].read_bytes()[:4] == b"\x89PNG"
    written = json.loads(files[1].read_text())
    count = len(configurations(quick=True))
    assert len(written["configurations"]) == count
    numbers = numbers_of_tradeoff(written)
    assert numbers["configurations"] == count > numbers["no_result"] >= numbers["servos"] == 6
    assert 1e-4 < numbers["best_of_first_order"] < 1e-1
    journal = files[3].read_bytes()
    assert robotball(*arguments)[0] == 0
    assert files[3].read_bytes() == journal


@pytest.mark.slow
def test_the_parts_are_listed_with_what_they_cost(robotball: Robotball, tmp_path: Path) -> None:
    """A row each, relative to the minimal model, which is 1."""
    status, shown, _ = robotball("tradeoff", "fig12", "--parts", "--quick", "--out", ".")
    assert status == 0
    assert "all of it" in shown
    rows = json.loads((tmp_path / "fig12-mujoco-parts-quick.json").read_text())["parts"]
    assert rows[0]["ratio"] == rows[0]["least"] == rows[0]["most"] == 1.0
    assert all(row["least"] <= row["ratio"] <= row["most"] for row in rows)


def test_what_the_parts_switch_on_is_what_the_model_says_it_leaves_out() -> None:
    """`model --explain` names every part of `tradeoff --parts`, and where their cost stands."""
    for name in ("fig12", "classical_regular"):
        said = " ".join(left_out(rb.load_scene(name), rb.preset("balanced")))
        named = ["rotor bodies", "condim 6", "geoms", "lights", "textures", "sensors"]
        named += ["Newton", "100 iterations"]
        named += ["condim 4"] if name == "classical_regular" else []
        assert all(word in said for word in named)


def test_islands_of_contacts_make_no_difference() -> None:
    """The flag that saves their search leaves the motion as it is, to the last bit."""
    scene, times = rb.load_scene("fig12"), rb.sample_times(1.0)
    balanced = rb.preset("balanced")
    with_search = run(build(scene, replace(balanced, island=None)), times)
    without = run(build(scene, balanced), times)
    assert np.array_equal(with_search.contact_point, without.contact_point)
    assert np.array_equal(with_search.momentum, without.momentum)
