"""A faulty run leaves the states around its first fault, and they step again to the last bit."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.fault_window import AROUND, load, replay
from robotball.scene import Friction
from tests.conftest import Robotball
from tests.robots import worked

FIG12 = rb.load_scene("fig12")
FAST = rb.preset("fast")
SLIPPERY = replace(FAST, sliding_friction=1.0)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "fault.json"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The file of fig12 that slips."""
    path = tmp_path_factory.mktemp("written") / "fault.json"
    rb.simulate(FIG12, settings=SLIPPERY, fault_window=path)
    return path.read_text()


FAULTY = {
    "RK4, contact lost": (FIG12, SLIPPERY),
    "Euler, with warm starts": (
        FIG12, replace(SLIPPERY, integrator="Euler", timestep=2e-3, warmstart="enable"),
    ),
    "adaptive": (FIG12, replace(rb.preset("adaptive"), sliding_friction=1.0)),
    "across two looks": (
        FIG12, replace(SLIPPERY, timestep=0.2216 / 4100, solref=(0.04, 1.0)),
    ),
    "drives in time": (rb.load_scene("wobbling_drive"), replace(FAST, sliding_friction=0.9)),
    "diverged": (
        FIG12,
        replace(
            FAST, integrator="Euler", timestep=0.1, error_tolerance=1e9, drive=rb.Servo(gain=1e4),
            sliding_friction=1e9, torsional_friction=1e9, stop_at_fault=False,
        ),
    ),
    # On both sides of its torque limits, and with its hard contact.
    "a robot": (
        replace(worked("W4"), friction=Friction(sliding=0.05)), rb.preset("balanced"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTY)
def test_a_dump_steps_again_to_the_last_bit(name: str, path: Path) -> None:
    """States, steps and readings are those of the run, from the first of the window on.

    Numbers that are none, of a diverged run, are null.
    """
    scene, settings = FAULTY[name]
    rb.simulate(scene, settings=settings, fault_window=path)
    assert not re.search("NaN|Infinity", path.read_text())
    window = load(path)
    replayed = replay(window)
    assert (replayed.difference, replayed.why) == (0.0, "")
    assert replayed.rows == len(window.rows) > AROUND / 2
    assert window.bad <= AROUND
    time = window.columns.index("time [s]")
    assert window.table[window.bad][time] == window.time
    assert window.model.nq == len(window.coordinates(0)[0])


def test_the_command_shows_the_window_and_marks_the_bad_step(
    path: Path, written: str, robotball: Robotball
) -> None:
    """The cause and its time, every row, and whether the steps are the same.

    A sound run takes the file of a former one away: it would tell of a fault that is mended.
    """
    path.write_text(written)
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
    rb.simulate(FIG12, np.array([0.0, 0.1]), FAST, fault_window=path)
    assert not path.exists()


def test_a_changed_state_is_seen(path: Path, written: str, robotball: Robotball) -> None:
    """One velocity off by 1e-9 in the window: not the same to the last bit."""
    fields = json.loads(written)
    fields["states"][2][12] += 1e-9
    path.write_text(json.dumps(fields))
    difference = replay(load(path)).difference
    assert difference is not None
    assert 0.9e-9 < difference < 1e-3
    assert robotball("replay", path)[0] == 1


# (changes of the file's fields, what is said)
BROKEN: list[tuple[dict[str, Any], str]] = [
    ({"format": "other"}, "no fault window of a run: Invalid enum value"),
    ({"lengths": []}, "rows do not match"),
    ({"bad": -1}, "rows do not match"),
    ({"columns": ["a"]}, "columns do not match"),
    ({"states": lambda rows: [row[:5] for row in rows]}, "states are not of its model"),
    ({"xml": "<mujoco>"}, "MuJoCo refuses the model"),
    ({"settings": {}}, "no settings of a run"),
    ({"settings": lambda given: {**given, "colour": 1}}, "no settings of a run"),
    ({"settings": lambda given: {**given, "timestep": -1}}, "timestep must be positive"),
    ({"scene": "= 3"}, "not TOML"),
]


@pytest.mark.parametrize(("changes", "words"), BROKEN)
def test_a_broken_file_is_one_line(
    changes: dict[str, Any], words: str, path: Path, written: str, robotball: Robotball
) -> None:
    """Whatever is wrong with it: status 2 and one line."""
    fields = json.loads(written)
    for name, value in changes.items():
        fields[name] = value(fields[name]) if callable(value) else value
    path.write_text(json.dumps(fields))
    status, _, err = robotball("replay", path)
    assert status == 2
    assert re.fullmatch(rf"robotball: .*{words}.*\n", err)


def test_what_cannot_be_replayed_says_why(path: Path, written: str, robotball: Robotball) -> None:
    """Another MuJoCo's bits may differ, no file holds a function of time, a pipe has no keys."""
    scene = replace(FIG12, frame_rate=lambda t: 2.0 + 0.1 * np.sin(t))
    rb.simulate(scene, settings=SLIPPERY, fault_window=path)
    window = load(path)
    why = "its drives are functions of time, which no file holds"
    assert (window.scene, replay(window).difference, replay(window).why) == (None, None, why)
    assert len(window.table) == len(window.rows) > AROUND / 2
    path.write_text(written.replace(f'"{mujoco.__version__}"', '"3.1.0"'))
    assert replay(load(path)).why == f"it is of MuJoCo 3.1.0, and this is {mujoco.__version__}"
    status, _, err = robotball("replay", path, "--interactive")
    assert status == 2
    assert "--interactive needs a terminal" in err
