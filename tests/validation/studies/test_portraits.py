"""The maps of phase portraits over K₃ and Ω, and the portrait of one ball."""

import json
from pathlib import Path

import numpy as np
import pytest

from robotball.qualitative.equilibria import fixed_points
from robotball.qualitative.portraits import basin_shares, limit_cycles, phase_portrait
from tests.conftest import Robotball
from tests.figures import ball, from_rest
from tests.validation.examples import example
from validation.studies import portrait_maps
from validation.studies.portrait_maps import PLANES, as_predicted, cells_of, measure_portrait


def test_back_in_time_the_repelling_cycle_attracts_all() -> None:
    """Fig. 8's ball turned round: its cycle has the whole sphere, with the multiplier's inverse."""
    some = ball((0.5, 0.4, 0.3), (-4.0, -2.0, -1.0), (0.0, 0.0, -3.0))
    found = phase_portrait(some)
    assert found.basins == {"cycle 0": 1.0}
    (forwards,) = limit_cycles(from_rest(3.0))
    assert found.cycles[0].multipliers[0] * forwards.multipliers[0] == pytest.approx(1, abs=1e-8)


def test_a_basin_goes_to_whoever_is_nearest_at_the_end() -> None:
    """Without the slow foci among the attractors, a control, θ₃,₄ would be given all of Fig. 6."""
    some = from_rest(0.3)
    points = fixed_points(some)
    shares = basin_shares(some, points, [], 200)
    assert 0.03 < shares["Γ₅,₆"] < 0.09  # measured 0.055
    fast = [point for point in points if "slow" not in point.kind]
    assert basin_shares(some, fast, [], 200) == {"θ₃,₄": 1.0}


def test_no_limit_cycle_is_a_closed_orbit_of_an_integrable_ball() -> None:
    """K = 0 and Ω = 0: whole families of closed orbits, and none of them counts."""
    assert limit_cycles(from_rest(0.0)) == []
    assert limit_cycles(ball((0.5, 0.4, 0.3), (0.0, 0.0, 0.0), (1.0, 2.0, 0.5))) == []


def test_a_cycle_that_settling_misses_is_found_once_with_its_own_period() -> None:
    """Its cycle closes after 0.65913 s, and has no shorter or longer copies."""
    rng = np.random.default_rng(5)
    A, Omega, K = rng.uniform(0.25, 1, 3), 2 * rng.normal(size=3), rng.normal(size=3)
    some = ball(tuple(A), tuple(Omega), tuple(K * 10 ** rng.uniform(-1.5, 1)), d=0.01)
    (cycle,) = limit_cycles(some, 60.0)
    assert cycle.period == pytest.approx(0.659134, abs=1e-6)
    assert cycle.multipliers[0].real == pytest.approx(1.0264, abs=1e-4)


def test_a_search_whose_correction_vanishes_ends_without_a_cycle() -> None:
    """Of a cell at which half a period's correction is exactly zero, and was divided by."""
    record = measure_portrait({"map": "axial", "K3": 1.95652, "y": 0.869565})
    assert [cycle["period"] for cycle in record["cycles"]] == [pytest.approx(8.577869, abs=1e-5)]


def test_every_map_passes_through_the_balls_of_the_paper() -> None:
    """The balls' Ω is at the place that the pictures mark; and no cell is on the line K₃ = 0."""
    angle = float(np.degrees(np.arctan2(2.0, 4.0)))
    for name, y in (("axial", 1.0), ("azimuth", angle)):
        assert PLANES[name].ball(0.3, y).Omega == pytest.approx((4.0, 2.0, 1.0))
        assert pytest.approx((0.5, 0.4, 0.3)) == PLANES[name].ball(0.3, y).A
        assert all(cell["K3"] != 0 for cell in cells_of(PLANES[name], 24))


def test_a_cell_agrees_with_the_formulas_and_a_wrong_one_would_not() -> None:
    """Number of points and type of Γ₅; for another K₃ the same record is told to be wrong."""
    record = measure_portrait({"map": "axial", "K3": 0.52, "y": 1.0})
    assert [cycle["multiplier"] > 1 for cycle in record["cycles"]] == [True]
    assert set(record["basins"]) == {"Γ₅,₆", "θ₃,₄"}
    assert sum(record["basins"].values()) == pytest.approx(1)
    assert as_predicted(PLANES["axial"].ball(0.52, 1.0), record)
    assert not as_predicted(PLANES["axial"].ball(0.3, 1.0), record)
    assert not as_predicted(PLANES["axial"].ball(-0.52, -1.0), record)


def test_the_command_draws_a_map(
    robotball: Robotball, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A quick map: a picture, a table, a record."""
    monkeypatch.setattr(portrait_maps, "_QUICK_COUNT", 2)
    status, out, _ = robotball(*example("portraits").split(), "--workers", 1, "--json", "a.json")
    assert status == 0
    assert "in 0 cells another" in " ".join(out.split())
    (record,) = json.loads((tmp_path / "a.json").read_text())["summary"]
    assert (record["cells"], record["failed"]) == (4, 0)
    assert all((tmp_path / f"out/portraits-axial-quick.{end}").is_file() for end in ("png", "csv"))
