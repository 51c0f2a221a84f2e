"""The trade-off study: configurations, Pareto front, first-order lines, and costs."""

import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import robotball as rb
from bench.gallery import numbers_of_cost
from bench.parts import parts_of, rows_of, split
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import NAIVE, recipe
from robotball.robot.motors import Servo
from tests.conftest import Robotball
from tests.messages import unnamed
from tests.robotball.scene_files.scene_texts import PLATE
from tests.validation.examples import example
from validation.studies import measuring
from validation.studies.cost import (
    TARGET,
    cells_of,
    configurations,
    costs_of,
    describe,
    first_order_lines,
    measure_settings,
    options_of,
    settings_with,
)
from validation.studies.measuring import Cost, measure_costs, simulated_second
from validation.study import Row, pareto_front, scene_cell
from validation.sweeps import Result

FIG12 = rb.load_scene("fig12")
CLOUD = st.lists(st.tuples(st.integers(1, 9), st.integers(1, 9)), min_size=1, max_size=40)


def test_a_cell_depends_on_the_values_of_its_controls(tmp_path: Path) -> None:
    """So a journal cannot mix results of two tables with the same name."""
    robot, table = tmp_path / "mybot.xml", tmp_path / "fly.csv"
    robot.write_text(PLATE)
    cells = []
    for end in (20, 30):
        table.write_text(f"t,value\n0,0\n1,{end}\n")
        cells.append(scene_cell(str(robot), 0.5, [f"fly={table}"]))
    first, other = cells
    assert first["control"] == [f"fly={table}"]
    assert first | {"digest": other["digest"]} == other != first
    assert "control" not in scene_cell("fig12", 0.5)


def beats(a: tuple[int, int], b: tuple[int, int]) -> bool:
    """Return whether a is at least as good as b in both, and better in one."""
    return a != b and a[0] <= b[0] and a[1] <= b[1]


@given(CLOUD)
def test_the_front_is_not_dominated(cloud: list[tuple[int, int]]) -> None:
    """Each other point is dominated by a point of the front, or equal to it."""
    front = [cloud[i] for i in pareto_front(*zip(*cloud, strict=True))]
    assert not any(beats(point, member) for point in cloud for member in front)
    assert all(point in front or any(beats(m, point) for m in front) for point in cloud)
    assert front == sorted(front, key=lambda point: point[1])


def test_every_option_that_is_not_a_default_is_recorded() -> None:
    """A cell read from JSON gives the same settings to the last digit, and all are distinct."""
    settings = configurations()
    assert len({repr(options_of(variant)) for variant in settings}) == len(settings)
    cells = cells_of(scene_cell("fig12", 1.0), settings, 1)
    for variant, cell in zip(settings, cells, strict=True):
        again = settings_with(json.loads(json.dumps(cell)))
        assert not again.stop_at_fault  # a run continues after a fault
        assert replace(variant, stop_at_fault=False, name=again.name, error_tolerance=1.0) == again


def test_a_configuration_is_described_by_its_changes() -> None:
    """Changes from the recipe or from the naive model, whichever are fewer."""
    assert describe(options_of(recipe("", 1, timestep=1e-3))) == "recipe"
    assert describe({**options_of(recipe("", 1)), "impratio": 100.0}) == "recipe, impratio 100"
    assert describe(options_of(replace(NAIVE, cone="elliptic"))) == "naive, cone elliptic"
    servo = replace(recipe("", 1), drive=Servo(gain=5.0))
    assert describe(options_of(servo)) == "recipe, drive gain 5"


def points(steps: Sequence[float], errors: Sequence[float], by: str = "Euler") -> list[Row]:
    """Return sound points of one line. A simulated second costs 1 µs per step."""
    shared = {"integrator": by, "sound": True}
    return [
        {"options": {"integrator": by, "timestep": h}, "timestep": h, "error": e, "cost": 1e-6 / h}
        | shared
        for h, e in zip(steps, errors, strict=True)
    ]


def test_first_order_is_extrapolated_along_its_own_slope() -> None:
    """A power law of order 1.1 that ends at 1e-3 is extrapolated to 1e-6.

    A steeper line, whose errors cancel, is excluded, as are RK4 and a line of two points.
    """
    steps = [1e-2, 3e-3, 1e-3]
    (line,) = first_order_lines(points(steps, [2.0 * h**1.1 for h in steps]))
    assert line["extrapolated"]
    # Measured 3.4e-15 and 2.1e-14: rounding of the logarithms.
    assert line["order"] == pytest.approx(1.1, rel=2e-14)
    assert line["cost_at_target"] == pytest.approx(1e-6 / (TARGET / 2.0) ** (1 / 1.1), rel=1e-13)
    assert not first_order_lines(points(steps, [h**1.5 for h in steps]))
    assert not first_order_lines(points(steps, steps, "RK4"))
    assert not first_order_lines(points(steps[:2], steps[:2]))


def test_invalid_results_are_not_on_the_front() -> None:
    """Invalid are faulty runs, broken runs, and accurate paths with an inaccurate M."""
    (cell,) = cells_of(scene_cell("fig12", 1.0), [rb.preset("fast")], 1)
    good: Any = {"path_error": 1e-3, "momentum_error": 1e-3, "faults": [], "baseline": 1.0}
    good |= dict.fromkeys(("ratio", "ratio_least", "ratio_most"), 1.0)
    others: Any = (
        {"path_error": 1e-5, "faults": ["contact lost at t = 0 s"]},
        {"path_error": None, "momentum_error": None, "faults": ["the state diverged"]},
        {"path_error": 1e-6},
        {},
    )
    results = [Result(dict(cell), {**good, **other}, None) for other in others]
    study = costs_of(FIG12, results)
    assert [each["error"] for each in study["pareto_front"]] == [1e-3]


def test_a_cell_is_measured_and_recorded() -> None:
    """A record has errors, faults and a cost. The naive model is invalid because of its faults.

    A failed run has its reason and no numbers, and is not on the front.
    """
    naive, balanced, lost = cells_of(scene_cell("fig12", 0.5), configurations()[:5:2], 1)
    results = [Result(dict(c), dict(measure_settings(c)), None) for c in (naive, balanced)]
    results.append(Result(dict(lost), None, "took longer than 60 s"))
    study = json.loads(json.dumps(costs_of(FIG12, results), allow_nan=False))
    slipped, sound, failed = study["configurations"]
    assert (slipped["title"], sound["title"]) == ("naive", "balanced")
    assert study["pareto_front"] == [sound]
    assert unnamed("hinge 0.1~% 0.002~s", slipped["trouble"]) == []
    assert sound["error"] < 6e-10  # measured 3.3e-10: the error of RK4 at 5 ms
    assert sound["cost"] > 0
    assert (failed["trouble"], failed["error"]) == ("took longer than 60 s", None)
    assert study["ratio"] is None


def test_a_rotor_split_in_three_gives_the_same_motion() -> None:
    """The parts of the rotor have together its inertia and its K."""
    times = rb.sample_times(2.0)
    one, three = (
        run(build(scene, rb.preset("accurate")), times) for scene in (FIG12, split(FIG12))
    )
    away = np.abs(one.contact_point - three.contact_point).max()
    assert len(split(FIG12).ball.rotors) == 3
    # Measured 2.1e-14 m of a path of 4.6 m: rounding.
    assert away < 1e-13


@pytest.mark.parametrize("name", ["fig12", "chaplygin_ball", "servo_motors"])
def test_each_part_is_in_its_variant_alone(name: str) -> None:
    """The minimal model is the smallest variant, and the last variant has all parts."""
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
        assert getattr(whole, size) == max(getattr(part, size) for part in parts.values()), size
        assert getattr(minimal, size) == min(getattr(part, size) for part in parts.values()), size


def test_the_quick_study_writes_its_files(robotball: Robotball, tmp_path: Path) -> None:
    """It writes a picture, a table and the data. A second start repeats no run."""
    options = "--duration 0.5 --workers 1 --json a.json"
    arguments = [*example("study cost").split(), *options.split()]
    status, shown, _ = robotball(*arguments)
    assert status == 0
    assert "Pareto front" in shown
    assert "times as much" in shown
    stem = "fig12-mujoco-cost-0.5s-quick"
    names = [*(f"{stem}{kind}" for kind in (".png", ".json", ".csv")), "fig12-cost.jsonl"]
    files = [tmp_path / "out" / name for name in names]
    assert sorted((tmp_path / "out").iterdir()) == sorted(files)
    written = json.loads(files[1].read_text())
    count = len(configurations(quick=True))
    assert len(written["configurations"]) == count
    numbers = numbers_of_cost(written)
    assert numbers["configurations"] == count > numbers["no_result"] >= numbers["servos"] == 6
    assert numbers["servos_off_their_rates"] == numbers["servos"]
    assert 1e-4 < numbers["best_of_first_order"] < 1e-1
    journal = files[3].read_bytes()
    assert robotball(*arguments)[0] == 0
    assert files[3].read_bytes() == journal


def test_the_parts_are_listed_with_their_costs() -> None:
    """Costs are relative to the cost of the minimal model."""
    rows = rows_of(FIG12, 1)
    assert [row["part"] for row in rows] == list(parts_of(FIG12))
    assert rows[0]["ratio"] == rows[0]["least"] == rows[0]["most"] == 1.0
    assert all(row["least"] <= row["ratio"] <= row["most"] for row in rows)


def test_a_machine_that_slows_down_changes_no_ratio(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work that takes twice as long as the bare loop costs 2, even if the speed drifts."""
    speed: Iterator[float] = itertools.count(1.0, 0.5)
    monkeypatch.setattr(measuring, "bare_loop", lambda: next(speed))
    # The loops before and after each work take `now` and `now` + 0.5.
    seen = iter([2 * (1.25 + 0.5 * n) for n in range(8)])
    costs = measure_costs([lambda: next(seen), lambda: next(seen)], rounds=3)
    assert [cost.ratios for cost in costs] == [pytest.approx((2.0, 2.0, 2.0))] * 2
    # The first round is a warm-up. The six loops after it take 2.5, 3, … 5.
    assert costs[0].baseline == pytest.approx(3.75)
    assert costs[0].seconds == pytest.approx(7.5)
    # One slow round widens the spread and does not change the ratio.
    cost = Cost((2.0, 9.0, 2.2, 1.9, 2.1), baseline=0.5)
    assert (cost.ratio, cost.spread) == (2.1, (1.9, 9.0))
    assert cost.over(cost) == Cost((1.0,) * 5, baseline=1.05)
    assert cost.seconds == 1.05


def test_cost_is_of_a_simulated_second(monkeypatch: pytest.MonkeyPatch) -> None:
    """If the run broke off, the simulated time is its number of steps times the step."""
    times, model = rb.sample_times(2.0), build(FIG12, rb.preset("fast"))
    motion = run(model, times)
    slow = replace(motion, report=replace(motion.report, seconds=3.0))
    for result in (slow, replace(slow, times=times[:5])):
        monkeypatch.setattr(measuring, "run", lambda *_, result=result: result)
        assert simulated_second(model, times)() == pytest.approx(1.5)
