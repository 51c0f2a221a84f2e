"""Orders of convergence against the limit of the contact model and against the equations."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robotball as rb
from robotball.engines.mujoco.settings import INTEGRATORS
from tests.conftest import Robotball
from tests.messages import naming
from tests.validation.examples import example
from validation.output import write_picture
from validation.studies import convergence
from validation.studies.ablation import TOP, without
from validation.studies.convergence import Runs, measure_convergence
from validation.studies.measuring import Order, fit_order, stalled_at

SOFT = ("softness", "noslip")

# Measured over 1 s on fig12 and classical_regular. The next power of the step bends the line. The
# errors of RK8 are nearer to rounding, and its interpolant has order 7.
BOUNDS = {
    "Euler": 0.1,  # 0.997, 1.027
    "implicit": 0.1,  # 1.042, 0.999
    "implicitfast": 0.1,  # 0.997, 1.027
    "discrete": 0.1,  # 0.997, 1.027
    "RK4": 0.1,  # 4.034, 4.000
    "RK8": 0.4,  # 7.98, 7.83; last bits decide how many of the shortest steps count
}


@cache
def study(scene: str, *undone: str) -> Runs:
    """Study one simulated second of the recipe's contact model, with some choices undone."""
    settings = without(TOP, undone)
    return measure_convergence(rb.load_scene(scene), settings, rb.sample_times(1.0), 6)


def order(runs: Runs, name: str) -> Order:
    """Return the order against the contact model's own limit, which must exist."""
    fitted, _ = runs.order(name, "own")
    assert fitted is not None
    return fitted


@pytest.mark.parametrize("scene", ["fig12", "classical_regular"])
def test_every_integrator_has_the_order_that_is_claimed(scene: str) -> None:
    """The fit uses all steps of the power law. The limit of the recipe is the equations' motion."""
    runs = study(scene)
    for name, integrator in INTEGRATORS.items():
        fitted = order(runs, name)
        assert abs(fitted.order - integrator.order) < BOUNDS[name], name
        assert fitted.points >= 4
        assert fitted.stderr < 0.3  # measured at most 0.161, with RK8
    # Measured 6.5e-15 and 5.8e-15 of the path: rounding.
    assert runs.limit["model_error"] < 1e-13
    assert all(abs(row["own_error"] - row["equations_error"]) < 1e-13 for row in runs.rows)


def test_a_soft_contact_has_a_limit_of_its_own() -> None:
    """The error against this limit keeps falling; the error against the equations stalls."""
    runs = study("fig12", *SOFT)
    model_error = runs.limit["model_error"]
    assert model_error == pytest.approx(3.77e-3, rel=0.05)
    assert runs.limit["known_to"] < 1e-12  # measured 9.7e-15
    assert order(runs, "RK4").order == pytest.approx(4, abs=0.2)  # measured 4.07
    fitted, stall = runs.order("RK4", "equations")
    assert fitted is None
    assert stall == pytest.approx(model_error, rel=1e-3)
    # Measured 5.7e-12 / 3.8e-3.
    assert runs.by_name["RK4"][-1]["own_error"] < 5e-9 * model_error
    # Euler's error falls below the model's error: measured order 1.00, and a stall at 2.0e-3.
    assert order(runs, "Euler").order == pytest.approx(1, abs=0.05)
    assert runs.order("Euler", "equations")[1] is not None


def test_a_start_out_of_equilibrium_is_an_error_of_the_integrator() -> None:
    """The error of a ball that starts just touching falls with the step, but RK4 has order 1.

    The normal force is not smooth at the start.
    """
    runs = study("fig12", "start")
    fitted, stall = runs.order("RK4", "equations")
    assert fitted is not None
    assert (fitted.points, stall) == (6, None)
    assert fitted.order == pytest.approx(1, abs=0.1)  # measured 0.983
    # Measured 4.64e-4 and 4.63e-4 of the path: at order 1 the shortest step leaves what it is from
    # twice as long a step.
    assert runs.limit["model_error"] == pytest.approx(runs.limit["known_to"], rel=0.1)


@pytest.mark.parametrize("name", ["Euler", "RK4"])
def test_richardson_estimates_the_true_error(name: str) -> None:
    """The estimate from two runs is as accurate as the order, far above rounding."""
    runs = study("fig12")
    # At an error of 1e-13, rounding alone changes the ratio by 0.06.
    ratios = [
        row["richardson"] / row["own_error"]
        for row in runs.by_name[name]
        if row["richardson"] and row["own_error"] > 20 * runs.limit["known_to"]
    ]
    assert len(ratios) >= 3
    # Measured 0.989 to 1.075 with every kernel of OpenBLAS: the next power of the step.
    assert 0.95 < min(ratios) < max(ratios) < 1.15


def test_no_step_is_so_long_that_mujoco_changes_the_contact() -> None:
    """Steps over half of solref's time constant, which MuJoCo would raise, are left out."""
    for undone, longest in (((), 0.02), (SOFT, 0.01)):  # time constants of 0.04 s and 0.02 s
        assert study("fig12", *undone).by_name["RK4"][0]["step"] == pytest.approx(longest)


def test_a_model_that_always_breaks_off_has_no_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message names the shortest step tried."""
    monkeypatch.setattr(convergence, "_whole_run", lambda *_: None)
    with pytest.raises(rb.InputError, match=naming("fig12 0.0003125~s")):
        study.__wrapped__("fig12")


def test_the_command_writes_table_picture_and_records(robotball: Robotball, tmp_path: Path) -> None:
    """`convergence --quick`: orders on the terminal; JSON and a picture on disk."""
    arguments = [*example("study convergence").split(), "--duration", "0.3"]
    status, printed, _ = robotball(*arguments, "--out", ".", "--json", "a.json")
    assert status == 0
    assert "fig12, accurate - softness - noslip: " in printed
    record = json.loads((tmp_path / "a.json").read_text())
    assert record["orders"].keys() == INTEGRATORS.keys()
    assert record["orders"]["RK4"]["own"]["order"]["order"] == pytest.approx(4, abs=0.3)
    assert record["settings"]["name"] == "accurate - softness - noslip"
    errors = [run["own_error"] for run in record["runs"] if run["integrator"] == "Euler"]
    assert np.all(np.diff(errors) < 0)
    picture = "fig12-mujoco-accurate-softness-noslip-convergence-0.3s-quick.png"
    assert (tmp_path / picture).is_file()


STEPS = [0.1 / 2**n for n in range(16)]
H = np.array(STEPS)


@settings(max_examples=120)
@given(
    order=st.floats(0.9, 8.0),
    floor=st.floats(1e-15, 1e-6),
    at_once=st.floats(0.01, 10.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_line_stops_at_the_floor(order: float, floor: float, at_once: float, seed: int) -> None:
    """For any order and floor, the fitted order is right and uses errors above the floor."""
    truth = at_once * H**order
    noise = np.random.default_rng(seed).uniform(0.3, 1.0, len(H))
    fitted = fit_order(STEPS, (truth + floor * noise).tolist())
    above = int((truth > 30 * floor).sum())
    if fitted is None:
        # Three points would make a line, but the floor bends it.
        assert above < 4
        return
    # Measured at most 6.1 % off over 60 000 draws, and 15 % with few points above the floor,
    # which bends the line at its lower end.
    assert abs(fitted.order - order) < (0.08 if above >= 4 else 0.2) * order
    # Measured 0.51 at least.
    assert at_once * fitted.shortest**order > 0.3 * floor


@given(order=st.floats(0.9, 8.0), floor=st.floats(1e-12, 1e-6))
def test_errors_below_a_given_floor_are_ignored(order: float, floor: float) -> None:
    """Errors may keep falling below the floor."""
    errors = 10 * H**order
    fitted = fit_order(STEPS, errors.tolist(), floor)
    if fitted is not None:
        assert fitted.shortest > 0.9 * H[errors > floor].min()
        assert fitted.order == pytest.approx(order, rel=1e-9)
        assert fitted.stderr < 1e-9


def test_too_long_steps_are_left_out() -> None:
    """Saturated errors at long steps and broken runs do not affect the line."""
    h = H[:10]
    errors: list[float | None] = [float(e) for e in np.minimum(1e6 * h**4, 0.3 + h)]
    fitted = fit_order([0.4, 0.2, *h], [None, np.inf, *errors])
    assert fitted is not None
    # Measured 3.978: the line includes one point that is slightly low.
    assert fitted.order == pytest.approx(4, abs=0.04)
    assert fitted.longest < 2.1 * h[1e6 * h**4 < 0.3].max()


def test_errors_that_do_not_fall_have_no_order() -> None:
    """If errors stall from the first step, the stall is reported and there is no line."""
    errors = [3e-4 * (1 + 0.01 * n) for n in range(16)]
    assert (fit_order(STEPS, errors), stalled_at(STEPS, errors)) == (None, 3e-4)
    assert stalled_at(STEPS, [h**2 for h in STEPS]) is None
    assert fit_order([], []) is None
    assert fit_order([0.1] * 4, [1.0, 2.0, 3.0, 4.0]) is None


def test_the_standard_error_is_the_standard_error_of_the_slope() -> None:
    """On noisy points it equals the result of NumPy's polyfit."""
    h = H[:8]
    errors = h**4 * np.exp(np.random.default_rng(1).normal(0, 0.05, 8))
    fitted = fit_order(STEPS[:8], errors.tolist())
    assert fitted is not None
    slope, covariance = np.polyfit(np.log(h), np.log(errors), 1, cov=True)
    assert fitted.order == pytest.approx(slope[0])
    assert fitted.stderr == pytest.approx(np.sqrt(covariance[0, 0]))
    # The line passes through the middle of the points.
    assert fitted.error_at(h) == pytest.approx(np.exp(np.polyval(slope, np.log(h))))


@pytest.mark.filterwarnings("ignore:Data has no positive values")
def test_a_ball_at_rest_whose_rates_are_drives_has_a_study(tmp_path: Path) -> None:
    """All its errors are 0."""
    scene = rb.load_scene("fig12")
    zeros = rb.Samples(times=(0.0, 20.0), values=(0.0, 0.0))
    scene = scene.with_hinges(command=(zeros, zeros))
    scene = scene.from_start(rb.Start(scene.start.attitude, np.zeros(3)))
    runs = measure_convergence(scene, TOP, np.array([0.0, 0.01, 0.02]), halvings=2)
    assert {row["own_error"] for row in runs.rows} == {0.0}
    picture = convergence._convergence_study(runs).picture
    assert picture is not None
    assert write_picture(tmp_path / "orders.png", picture).exists()
