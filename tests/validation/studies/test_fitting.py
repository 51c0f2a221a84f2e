"""`robotball fit`: its output, files and exit status."""

import json
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from tests.conftest import Robotball
from tests.messages import unnamed
from tests.robotball.fit.test_fitting import log, off
from tests.validation.json_keys import misfits


def written(run: rb.Log, path: Path) -> None:
    """Write a log to a CSV file."""
    position, attitude, gyro = run.sensors
    table = np.column_stack([position.times, position.values, attitude.values, gyro.values])
    header = "t,x,y,qw,qx,qy,qz,wx,wy,wz"
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.12g")


def test_a_fit_writes_a_scene_a_page_and_a_record(robotball: Robotball, tmp_path: Path) -> None:
    """They have the fitted numbers, and the log and the options in their names.

    The keys of the record are those of docs/json.md.
    """
    written(log(), tmp_path / "run.csv")
    options = ("--free", "battery.mass,kv", "--noise", "position=1e-3,attitude=1e-2,gyro=2e-2")
    status, out, _ = robotball("fit", "pendulum_robot", "run.csv", *options, "--json", "a.json")
    assert status == 0
    assert "χ²" in out
    record = json.loads((tmp_path / "a.json").read_text())
    assert misfits("fit", record) == set()
    mass, kv = record["numbers"]
    assert (mass["name"], kv["name"]) == ("frame.part.battery.mass", "frame.kv")
    name = "fit-pendulum_robot-run-battery.mass-kv-position-1e-3-attitude-1e-2-gyro-2e-2"
    fitted = rb.load_scene(tmp_path / "out" / f"{name}.toml")
    assert fitted.hinges[0].motor.gain == kv["value"]  # type: ignore[union-attr]
    page = (tmp_path / "out" / f"{name}.html").read_text()
    assert "χ²" in page
    assert page.count("histogram of the residuals") == 3
    assert page.count("readings over the model") == 2  # not of the attitude


def test_a_log_that_constrains_no_number_gives_status_1(
    robotball: Robotball, tmp_path: Path
) -> None:
    """Positions of pure noise of one metre; a line explains it."""
    rng, times = np.random.default_rng(0), np.arange(0.0, 1.0, 0.02)
    table = np.column_stack([times, rng.normal(0.0, 1.0, (len(times), 2))])
    np.savetxt(tmp_path / "n.csv", table, delimiter=",", header="t,x,y", comments="")
    status, out, _ = robotball("fit", "pendulum_robot", "n.csv", "--free", "kv")
    assert status == 1
    assert unnamed("logs any parameters", out) == []


@pytest.mark.slow
def test_a_number_at_its_limit_that_explains_the_log_gives_status_0(
    robotball: Robotball, tmp_path: Path
) -> None:
    """With this noise, the limit of 0.399 explains a log with a gain of 0.4."""
    written(log(), tmp_path / "run.csv")
    options = ("--free", "kv=0.39:0.399", "--noise", "position=1e-2,attitude=1e-1,gyro=2e-1")
    scene = off(tmp_path, kv=0.985)
    status, out, _ = robotball("fit", scene, "run.csv", *options, "--json", "a.json")
    assert "the model explains the logs" in out
    (line,) = json.loads((tmp_path / "a.json").read_text())["at_limits"]
    assert line in out
    assert unnamed("kv limit 0.399 explains", line) == []
    assert status == 0


def test_a_held_out_log_that_fails_is_told_from_the_fitted_one(
    robotball: Robotball, tmp_path: Path
) -> None:
    """With its χ²/n; long names of files end with a checksum."""
    runs: dict[str, str | Path] = {
        "a": "pendulum_robot",
        "h" * 120: off(tmp_path, battery__mass=1.3),
    }
    for name, scene in runs.items():
        written(log(of=rb.integrate(scene, rb.sample_times(2.0))), tmp_path / f"{name}.csv")
    logs = [f"{name}.csv" for name in runs]
    options = ("--free", "kv", "--noise", "position=1e-3,attitude=1e-2,gyro=2e-2")
    status, out, _ = robotball("fit", "pendulum_robot", *logs, *options)
    assert status == 1
    (verdict,) = (line for line in out.splitlines() if "degrees of freedom" in line)
    assert unnamed(f"explains a.csv held-out {logs[1]} χ²/n", verdict) == []
    assert float(verdict.rpartition(" = ")[2]) > 3  # measured 11.3, from a mass that is 30 % off
    assert len(max(path.stem for path in (tmp_path / "out").iterdir())) < 120


@pytest.mark.parametrize(
    ("options", "facts"),
    [
        ((), "fit log t"),
        (("run.csv",), "numbers --free"),
        (("run.csv", "--free", "kv", "--noise", "gyro"), "--noise SENSOR=NUMBER"),
        (("run.csv", "--free", "kv", "--noise", "gyro=inf"), "noise gyro inf"),
        (("lost.csv", "--free", "kv"), "lost.csv"),
    ],
)
def test_invalid_fits_are_refused_in_one_line(
    options: tuple[str, ...], facts: str, robotball: Robotball, tmp_path: Path
) -> None:
    """Status 2: no log, no free number, invalid noise, missing file."""
    written(log(), tmp_path / "run.csv")
    status, _, err = robotball("fit", "pendulum_robot", *options)
    assert status == 2
    assert unnamed(facts, err) == []
    assert err.count("\n") == 1


ROBOT = Path("examples/first_robot.xml").absolute()


def test_numbers_of_a_robot_file_have_its_names(robotball: Robotball, tmp_path: Path) -> None:
    """All are listed if no number is free; a misspelt name gets status 2 and suggestions."""
    written(log(), tmp_path / "run.csv")
    status, out, err = robotball("fit", ROBOT, "run.csv")
    assert (status, {"floor.size.x", "plate.geom.mass"} - {*out.split()}) == (2, set())
    status, _, err = robotball("fit", ROBOT, "run.csv", "--free", "plate.maas")
    assert status == 2
    assert unnamed("'plate.maas' plate.geom.mass", err) == []
