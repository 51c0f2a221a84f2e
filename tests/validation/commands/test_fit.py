"""`robotball fit`: what it prints, writes and returns."""

import json
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from tests.conftest import Robotball
from tests.robotball.test_fitting import log
from tests.validation.json_keys import misfits


def written(found: rb.Log, path: Path) -> None:
    """A log as a file."""
    position, attitude, gyro = found.sensors
    table = np.column_stack([position.times, position.values, attitude.values, gyro.values])
    header = "t,x,y,qw,qx,qy,qz,wx,wy,wz"
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.12g")


@pytest.mark.slow
def test_a_log_is_fitted_by_the_equations_and_by_an_engine(
    robotball: Robotball, tmp_path: Path
) -> None:
    """The engine as it comes pays for its contact; files and the record hold what is printed."""
    written(log(), tmp_path / "run.csv")
    options = ("--free", "battery.mass,kv", "--noise", "position=1e-3,attitude=1e-2,gyro=2e-2")
    status, out, _ = robotball(
        "fit", "pendulum_robot", "run.csv", *options, "--preset", "naive", "--json", "a.json"
    )
    assert status == 0
    assert "the model explains the logs: χ² over" in out
    assert "mujoco, naive" in out
    record = json.loads((tmp_path / "a.json").read_text())
    assert misfits("fit", record) == set()
    mass, kv = record["numbers"]
    assert (mass["name"], kv["name"]) == ("frame.part.battery.mass", "frame.kv")
    (naive,) = record["by_engines"]
    # Measured: 6 standard deviations in 3 s; the contact lets the shell slip and spin.
    assert abs(naive["numbers"][0]["value"] - mass["value"]) > 4 * mass["deviation"]
    assert naive["chi2_per_degree"] > 1.5 * record["chi2"] / record["degrees_of_freedom"]
    fitted = rb.load_scene(tmp_path / "out" / "fit-pendulum_robot.toml")
    assert fitted.hinges[0].motor.gain == kv["value"]  # type: ignore[union-attr]
    page = (tmp_path / "out" / "fit-pendulum_robot.html").read_text()
    assert "The model explains the logs" in page or "the model explains the logs" in page
    assert page.count("<svg") >= 3


@pytest.mark.slow
def test_a_log_that_tells_nothing_is_no_success(robotball: Robotball, tmp_path: Path) -> None:
    """Positions that are nothing but noise of a metre: status 1, and a line says so."""
    rng, times = np.random.default_rng(0), np.arange(0.0, 1.0, 0.02)
    table = np.column_stack([times, rng.normal(0.0, 1.0, (len(times), 2))])
    np.savetxt(tmp_path / "n.csv", table, delimiter=",", header="t,x,y", comments="")
    status, out, _ = robotball("fit", "pendulum_robot", "n.csv", "--free", "kv")
    assert status == 1
    assert "the logs tell none of the numbers, and any model explains them" in out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((), "fit needs a log: a table of t and what the sensors read"),
        (("run.csv",), "name the numbers to find with --free; the scene has gravity, friction"),
        (("run.csv", "--free", "kv", "--noise", "gyro"), "--noise takes SENSOR=NUMBER"),
        (("lost.csv", "--free", "kv"), "lost.csv"),
    ],
)
def test_what_cannot_be_fitted_is_refused_in_a_line(
    options: tuple[str, ...], said: str, robotball: Robotball, tmp_path: Path
) -> None:
    """Status 2: no log, nothing free, a noise that is none, a file that is not there."""
    written(log(), tmp_path / "run.csv")
    status, _, err = robotball("fit", "pendulum_robot", *options)
    assert status == 2
    assert said in err
    assert err.count("\n") == 1
