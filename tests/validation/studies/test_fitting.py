"""`robotball fit`: what it prints, writes and returns."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco import toolbox
from robotball.fit.scene_numbers import numbers_of
from robotball.user_model.mended_file import robot_numbers
from tests.conftest import Robotball
from tests.messages import unnamed
from tests.robotball.fit.test_fitting import NOISE, log, off
from tests.validation.json_keys import misfits
from validation.studies import fitting


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
    assert "χ²" in out
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
    assert "χ²" in page
    assert page.count("<svg") >= 3


def test_a_log_that_tells_nothing_is_no_success(robotball: Robotball, tmp_path: Path) -> None:
    """Positions that are nothing but noise of a metre: status 1, and a line says so."""
    rng, times = np.random.default_rng(0), np.arange(0.0, 1.0, 0.02)
    table = np.column_stack([times, rng.normal(0.0, 1.0, (len(times), 2))])
    np.savetxt(tmp_path / "n.csv", table, delimiter=",", header="t,x,y", comments="")
    status, out, _ = robotball("fit", "pendulum_robot", "n.csv", "--free", "kv")
    assert status == 1
    assert unnamed("logs none numbers", out) == []


@pytest.mark.slow
def test_a_number_at_its_limit_is_no_success(robotball: Robotball, tmp_path: Path) -> None:
    """With so much noise given, a gain of 0.399 explains the log of one of 0.4: status 1."""
    written(log(), tmp_path / "run.csv")
    options = ("--free", "kv=0.39:0.399", "--noise", "position=1e-2,attitude=1e-1,gyro=2e-1")
    scene = off(tmp_path, kv=0.985)
    status, out, _ = robotball("fit", scene, "run.csv", *options, "--json", "a.json")
    assert "the model explains the logs" in out
    (line,) = json.loads((tmp_path / "a.json").read_text())["at_limits"]
    assert line in out
    assert status == 1


@pytest.mark.parametrize(
    ("options", "facts"),
    [
        ((), "fit log t"),
        (("run.csv",), "numbers --free"),
        (("run.csv", "--free", "kv", "--noise", "gyro"), "--noise SENSOR=NUMBER"),
        (("run.csv", "--free", "kv", "--noise", "gyro=inf"), "noise gyro inf"),
        (("run.csv", "--free", "kv", "--engine", "drake"), "--engine presets"),
        (("lost.csv", "--free", "kv"), "lost.csv"),
    ],
)
def test_what_cannot_be_fitted_is_refused_in_a_line(
    options: tuple[str, ...], facts: str, robotball: Robotball, tmp_path: Path
) -> None:
    """Status 2: no log, nothing free, a noise that is none, a file that is not there."""
    written(log(), tmp_path / "run.csv")
    status, _, err = robotball("fit", "pendulum_robot", *options)
    assert status == 2
    assert unnamed(facts, err) == []
    assert err.count("\n") == 1


ROBOT = Path("examples/first_robot.xml").absolute()


def test_a_robots_own_file_has_numbers_by_its_own_names(
    robotball: Robotball, tmp_path: Path
) -> None:
    """Status 2 and a line with the neighbours of a wrong one; all are listed where none is free."""
    written(log(), tmp_path / "run.csv")
    status, out, err = robotball("fit", ROBOT, "run.csv")
    assert (status, {"floor.size.x", "plate.geom.mass"} - {*out.split()}) == (2, set())
    status, _, err = robotball("fit", ROBOT, "run.csv", "--free", "plate.maas")
    assert status == 2
    assert unnamed("'plate.maas' plate.geom.mass", err) == []


def test_a_file_is_not_fitted_as_it_is_without_the_toolbox(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line says how to install it; the equations are fitted none the less."""
    robot = robot_numbers(ROBOT)
    monkeypatch.delattr(toolbox.sysid, "optimize", raising=False)
    assert [*fitting.as_it_is(robot)] == []
    assert "`sysid`" in capsys.readouterr().out
    assert [*fitting.as_it_is(numbers_of("pendulum_robot"))] == []


def test_a_position_that_strays_may_be_of_another_world() -> None:
    """A line names what would find that; of another sensor that strays there is none."""
    found = rb.fit("pendulum_robot", [log()], ["kv"], noise=NOISE)
    for name in ("position", "gyro"):
        sensors = tuple(replace(s, probability=float(s.name != name)) for s in found.sensors)
        said = [*fitting.lines(replace(found, sensors=sensors))]
        assert any("--also world.origin,world.yaw" in each for each in said) == (name == "position")
