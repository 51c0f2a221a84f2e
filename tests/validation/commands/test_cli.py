"""The command: exit status, one-line errors, whole files or none."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import mujoco
import pytest

import robotball as rb
from tests.conftest import Robotball


def test_scenes_lists_the_catalog(robotball: Robotball) -> None:
    """Every scene is named with its rolling model."""
    status, out, _ = robotball("scenes")
    assert status == 0
    for name in rb.catalog():
        assert re.search(rf"{name}\s.*{rb.load_scene(name).rolling}", out)


@pytest.mark.slow
def test_compare_exits_0_where_the_engines_agree(robotball: Robotball, tmp_path: Path) -> None:
    """Agreement: status 0, a row in the table, pictures in out/."""
    status, out, _ = robotball("compare", "fig12", "--duration", 1)
    assert status == 0
    assert re.search(r"fig12\s+rubber\s+balanced\s+5 .* agrees", out)
    written = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert written == [f"fig12-mujoco-balanced-1s-{kind}.png" for kind in ("momentum", "path")]
    assert all(path.read_bytes()[:4] == b"\x89PNG" for path in (tmp_path / "out").iterdir())


def test_compare_exits_1_where_they_do_not(robotball: Robotball) -> None:
    """The naive model: status 1, with the time and the cause of what went wrong."""
    status, out, _ = robotball(
        "compare", "fig12", "--preset", "naive", "--duration", 1, "--no-plots"
    )
    assert status == 1
    assert "faulty" in out
    assert "friction cone saturated at t =" in " ".join(out.split())


@pytest.mark.slow
def test_results_can_be_made_again_from_their_record(robotball: Robotball, tmp_path: Path) -> None:
    """The JSON has every number, setting and version; run again it gives the same numbers."""
    arguments = ["compare", "fig12", "classical_regular", "--preset", "naive,balanced"]
    arguments += ["--duration", "1", "--no-plots", "--json", "a.json", "--csv", "a.csv"]
    assert robotball(*arguments)[0] == 1
    records = json.loads((tmp_path / "a.json").read_text())
    assert [(each["scene"], each["preset"]) for each in records] == [
        ("fig12", "naive"), ("fig12", "balanced"),
        ("classical_regular", "naive"), ("classical_regular", "balanced"),
    ]  # fmt: skip
    naive, balanced = records[:2]
    measures = {"path_error", "gamma_error", "momentum_error", "realtime_factor"}
    assert {"rolling", *measures} <= set(balanced)
    assert balanced["duration"] == 1.0
    assert balanced["settings"]["timestep"] == 0.005
    assert balanced["settings"]["drive"] == {"armature": 1e14}
    assert balanced["versions"]["mujoco"] == mujoco.__version__
    assert balanced["needs"]["torsional_friction"] == pytest.approx(1.873, abs=1e-3)  # m
    assert len(balanced["needs"]["motor_torques"]) == 2
    assert naive["settings"]["drive"]["gain"] == 10.0
    assert not naive["agrees"]
    assert naive["faults"][0]["cause"] == "hinge rate off by over 0.001"
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["path_error"]) for row in rows] == [each["path_error"] for each in records]
    robotball(*arguments)
    again = json.loads((tmp_path / "a.json").read_text())
    assert [each["path_error"] for each in again] == [each["path_error"] for each in records]


def test_model_prints_mjcf_that_is_complete(robotball: Robotball, tmp_path: Path) -> None:
    """What is printed compiles by itself, and starts at the scene's start."""
    status, out, _ = robotball("model", "fig12")
    assert status == 0
    model = mujoco.MjModel.from_xml_string(out)
    start = rb.load_scene("fig12").start.attitude
    assert model.key_qpos[0, 3:7].tolist() == start.tolist()
    assert robotball("model", "fig12", "--out", "m.xml")[0] == 0
    assert (tmp_path / "m.xml").read_text().strip() == out.strip()


def test_model_explains_what_it_leaves_out(robotball: Robotball) -> None:
    """Each thing a scene does not need is named with its reason."""
    _, rubber, _ = robotball("model", "fig12", "--explain")
    _, classical, _ = robotball("model", "chaplygin_ball", "--explain")
    assert "one along K + (J_s + d)Ω makes the same motion" in rubber
    assert "condim 4" not in rubber
    assert "torsional friction row (condim 4)" in classical
    assert "rotor bodies: the scene has none" in classical
    assert "hinge of frame: its rate is zero for good" in classical


def test_design_prints_bodies_and_writes_a_scene_that_runs(robotball: Robotball) -> None:
    """Masses, radii, rates and the verdict; the scene beside them agrees in both engines."""
    status, out, _ = robotball("design", "fig12")
    assert status == 0
    assert re.search(r"rotor1 .* ring of radius .* rad/s", out)
    assert "can be built: mass lies inside the shell" in out
    path = out.split()[-1]
    assert robotball("compare", path, "--duration", 1, "--no-plots")[0] == 0


# A weight that turns so fast that it lifts the ball.
LIFTING_OFF = replace(rb.load_scene("pendulum_robot"), motors=(), frame_rate=25.0)


def test_a_scene_refused_by_the_equations_leaves_nothing(
    robotball: Robotball, tmp_path: Path
) -> None:
    """Found out only when the motion is asked for, after the output folder was checked."""
    (tmp_path / "off.toml").write_text(rb.scene_toml(LIFTING_OFF))
    status, out, err = robotball("compare", "off.toml", "--out", "new/folder")
    assert (status, out) == (2, "")
    assert re.fullmatch(
        r"robotball: off \(off\.toml\): the ball lifts off the plane at t = 0\.1017\d+ s, .*\n",
        err,
    )
    assert [path.name for path in tmp_path.iterdir()] == ["off.toml"]


@pytest.mark.slow
def test_a_scene_that_is_refused_does_not_end_the_batch(
    robotball: Robotball, tmp_path: Path
) -> None:
    """The others are run, drawn and written; a line names the scene and its file; status 2."""
    (tmp_path / "off.toml").write_text(rb.scene_toml(LIFTING_OFF))
    status, out, err = robotball(
        "compare", "fig12", "off.toml", "fig13", "--preset", "fast", "--duration", 0.2,
        "--json", "a.json",
    )  # fmt: skip
    assert status == 2
    assert re.fullmatch(r"robotball: off \(off\.toml\): the ball lifts off .*\n", err)
    assert [line.split()[0] for line in out.splitlines() if "agrees" in line] == ["fig12", "fig13"]
    records = json.loads((tmp_path / "a.json").read_text())
    assert [each["scene"] for each in records] == ["fig12", "fig13"]
    assert (tmp_path / "out" / "fig13-mujoco-fast-0.2s-path.png").exists()


def test_rotors_are_counted_from_one_in_every_message(robotball: Robotball, tmp_path: Path) -> None:
    """As the bodies are named: by a wrong key, a wrong value, a servo without a gain, a body."""
    text = rb.scene_toml(rb.load_scene("three_rotors"))
    first, *rotors = text.split("[[rotor]]")
    changes = {
        "rotor2.mas: ": ("mass", "mas"),
        "rotor2.mass: it must be a number": ("mass = ", "mass = true #"),
        "rotor2.mass must be finite": ("mass = ", "mass = nan #"),
        'rotor2: drive = "servo" needs the key': ("rate = ", 'drive = "servo"\nrate = '),
        "rotor2's mass must be positive": ("mass = ", "mass = -"),
        "rotor2's axis must have a length": ("axis = ", "axis = [0.0, 0.0, 0.0] #"),
    }
    for words, change in changes.items():
        changed = [rotors[0], rotors[1].replace(*change), *rotors[2:]]
        (tmp_path / "bad.toml").write_text("[[rotor]]".join([first, *changed]))
        status, _, err = robotball("compare", "bad.toml")
        assert status == 2
        assert words.removesuffix(".mas: ") in err
        assert "rotor[" not in err


def test_an_old_result_stays_whole_when_writing_fails(
    robotball: Robotball, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that fills up leaves the file that was there, and no fragment beside it."""
    old = tmp_path / "a.json"
    old.write_text("old")

    def full_disk(path: Path, text: str, **_: str) -> int:
        path.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full_disk)
    arguments = ("compare", "fig12", "--duration", 0.1, "--no-plots", "--json", "a.json")
    status, _, err = robotball(*arguments)
    assert status == 2
    assert "a.json cannot be written: No space left on device" in err
    assert old.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
