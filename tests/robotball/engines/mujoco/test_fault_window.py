"""A faulty run leaves the states around its first fault, and they step again to the last bit."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.fault_window import AROUND, load, replay
from tests.conftest import Robotball

FIG12 = rb.load_scene("fig12")
FAST = rb.preset("fast")
SLIPPERY = replace(FAST, sliding_friction=1.0)


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., Path]:
    """Runs a scene with settings and gives the file of its fault."""

    def run(settings: rb.Settings, scene: rb.Scene = FIG12) -> Path:
        path = tmp_path / "fault.json"
        rb.simulate(scene, settings=settings, fault_window=path)
        return path

    return run


def test_a_sound_run_leaves_nothing(written: Callable[..., Path]) -> None:
    """No fault, no file."""
    assert not written(FAST).exists()


FAULTY = {
    "RK4, contact lost": SLIPPERY,
    "Euler, with warm starts": replace(
        SLIPPERY, integrator="Euler", timestep=2e-3, warmstart="enable"
    ),
    "adaptive": replace(rb.preset("adaptive"), sliding_friction=1.0),
    "the first steps": rb.preset("naive"),
    "across two looks": replace(SLIPPERY, timestep=0.2216 / 4100, solref=(0.04, 1.0)),
}


@pytest.mark.parametrize("settings", FAULTY.values(), ids=FAULTY)
def test_a_dump_steps_again_to_the_last_bit(
    settings: rb.Settings, written: Callable[..., Path]
) -> None:
    """States, steps and readings are those of the run, from the first of the window on."""
    window = load(written(settings))
    assert replay(window).difference == 0.0
    assert replay(window).rows == len(window.rows)
    assert window.bad <= AROUND
    time = window.columns.index("time [s]")
    assert window.table[window.bad][time] == window.time
    assert window.model.nq == len(window.coordinates(0)[0])


def test_a_diverged_run_is_dumped_without_infinities(written: Callable[..., Path]) -> None:
    """Numbers that are none are null, and the steps to the divergence are the same again."""
    wild = replace(
        FAST, integrator="Euler", timestep=0.1, error_tolerance=1e9, drive=rb.Servo(gain=1e4),
        sliding_friction=1e9, torsional_friction=1e9, stop_at_fault=False,
    )  # fmt: skip
    path = written(wild)
    assert "NaN" not in path.read_text()
    assert "Infinity" not in path.read_text()
    assert replay(load(path)).difference == 0.0


def test_drives_in_time_are_stepped_with_their_controls(written: Callable[..., Path]) -> None:
    """The scene in the window tells what the actuators were told."""
    scene = rb.load_scene("wobbling_drive")
    window = load(written(replace(FAST, sliding_friction=0.9), scene))
    assert window.scene is not None
    assert replay(window).difference == 0.0


def test_a_function_of_time_cannot_be_stepped_again(written: Callable[..., Path]) -> None:
    """No file holds it; the table is there all the same, and the command says so."""
    scene = replace(FIG12, frame_rate=lambda t: 2.0 + 0.1 * np.sin(t))
    window = load(written(SLIPPERY, scene))
    assert window.scene is None
    assert replay(window).difference is None
    assert replay(window).why == "its drives are functions of time, which no file holds"
    assert len(window.table) == len(window.rows) > AROUND / 2


def test_a_changed_state_is_seen(written: Callable[..., Path], robotball: Robotball) -> None:
    """One velocity off by 1e-9 in the window: not the same to the last bit."""
    path = written(SLIPPERY)
    fields = json.loads(path.read_text())
    fields["states"][2][12] += 1e-9
    path.write_text(json.dumps(fields))
    difference = replay(load(path)).difference
    assert difference is not None
    assert 0.9e-9 < difference < 1e-3
    assert robotball("replay", path)[0] == 1


def test_the_command_shows_the_window_and_marks_the_bad_step(
    written: Callable[..., Path], robotball: Robotball
) -> None:
    """The cause and its time, every row, and whether the steps are the same."""
    path = written(SLIPPERY)
    status, out, _ = robotball("replay", path)
    assert status == 0
    assert "fig12, fast: contact lost at t = 0.22 s" in out
    (marked,) = [line for line in out.splitlines() if "<- bad" in line]
    assert marked.split()[1] == "0.22"
    assert "computed again, are the same to the last bit" in out
    status, out, _ = robotball("replay", path, "--step", load(path).bad)
    assert status == 0
    assert "the first bad one" in out
    assert "qvel" in out


def test_compare_says_where_the_dump_is(robotball: Robotball, tmp_path: Path) -> None:
    """A faulty run's file is in the output folder, and the command to read it is printed."""
    arguments = ("compare", "fig12", "--preset", "naive", "--duration", 0.2, "--no-plots")
    status, out, _ = robotball(*arguments)
    assert status == 1
    assert "robotball replay out/fig12-mujoco-naive-fault.json" in out
    assert load(tmp_path / "out" / "fig12-mujoco-naive-fault.json").name == "fig12"


def test_a_sound_run_takes_the_file_of_a_former_one_away(written: Callable[..., Path]) -> None:
    """It would tell of a fault that is mended."""
    assert written(SLIPPERY).exists()
    assert not written(FAST).exists()


def test_no_number_is_cut_on_a_narrow_terminal(
    written: Callable[..., Path], robotball: Robotball, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Forty columns break the lines, and show the same numbers as two hundred."""
    path, shown = written(SLIPPERY), []
    for columns in ("40", "200"):
        for name, value in (("COLUMNS", columns), ("FORCE_COLOR", "1"), ("TERM", "xterm")):
            monkeypatch.setenv(name, value)
        status, out, _ = robotball("replay", path)
        assert status == 0
        shown.append(out.split())
    assert shown[0] == shown[1]
    assert any("e-" in word for word in shown[0])
    assert not any("…" in word for word in shown[0])


def change(fields: dict[str, Any], **changes: Any) -> str:
    return json.dumps({**fields, **changes})


BROKEN: dict[str, Callable[[dict[str, Any]], str]] = {
    "no fault window of a run: ": lambda fields: "{",
    "no fault window of a run:  ": lambda fields: "[1, 2]",
    "Invalid enum value": lambda fields: change(fields, format="other"),
    "rows do not match": lambda fields: change(fields, lengths=[]),
    "rows do not match ": lambda fields: change(fields, bad=-1),
    "columns do not match": lambda fields: change(fields, columns=["a"]),
    "states are not of its model": lambda fields: change(
        fields, states=[row[:5] for row in fields["states"]]
    ),
    "MuJoCo refuses the model": lambda fields: change(fields, xml="<mujoco>"),
    "no settings of a run": lambda fields: change(fields, settings={}),
    "no settings of a run ": lambda fields: change(
        fields, settings={**fields["settings"], "colour": 1}
    ),
    "timestep must be positive": lambda fields: change(
        fields, settings={**fields["settings"], "timestep": -1}
    ),
    "not TOML": lambda fields: change(fields, scene="= 3"),
}


@pytest.mark.parametrize(("words", "breaking"), BROKEN.items(), ids=BROKEN)
def test_a_broken_file_is_one_line(
    words: str,
    breaking: Callable[[dict[str, Any]], str],
    written: Callable[..., Path],
    robotball: Robotball,
) -> None:
    """Whatever is wrong with it: status 2 and one line."""
    path = written(SLIPPERY)
    path.write_text(breaking(json.loads(path.read_text())))
    status, _, err = robotball("replay", path)
    assert status == 2
    assert re.fullmatch(rf"robotball: .*{words.strip()}.*\n", err)


def test_another_mujoco_is_told(written: Callable[..., Path]) -> None:
    """Its bits may differ, so nothing is stepped."""
    path = written(SLIPPERY)
    path.write_text(path.read_text().replace(f'"{mujoco.__version__}"', '"3.1.0"'))
    assert replay(load(path)).why == f"it is of MuJoCo 3.1.0, and this is {mujoco.__version__}"


def test_interactive_needs_a_terminal(written: Callable[..., Path], robotball: Robotball) -> None:
    """In a pipe it is refused in one line."""
    status, _, err = robotball("replay", written(SLIPPERY), "--interactive")
    assert status == 2
    assert "--interactive needs a terminal" in err
