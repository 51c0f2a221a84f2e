"""The commands about long-run motion: their results, and what they say to a scene not theirs."""

import json
import re
from pathlib import Path

import pytest

from tests.validation.conftest import Robotball

COMMANDS = {
    "section fig12 --count 40 --preset fast --json a.json": (
        r"equations: 40 crossings, 20 with g growing, 20 falling\nMuJoCo: 40 crossings"
    ),
    "section fig10_stable --count 20 --json a.json": (
        r"attracts: what ends there crosses only by\nrounding; 'robotball equilibria fig10_stable'"
    ),
    "section classical_chaotic --starts 3 --count 20 --skip 2 --g 0.4 --json a.json": (
        r"equations: 60 crossings"
    ),
    "lyapunov fig14 --starts 4 --duration 500 --transient 100 --preset fast --json a.json": (
        r"λ₁ \[1/s\] +0\.1[\s\S]*λ₁ by MuJoCo, fast"
    ),
    "basins fig12 --starts 24 --transient 2000 --json a.json": r"cycle of period 8\.743261 s +0\.",
    "equilibria fig07 --longest 70 --json a.json": r"saddle[\s\S]*period 60\.0086320 s",
    "equilibria fig05c --json a.json": (
        r"Γ₁ [\s\S]*centre,[\s\S]*Σ_s [\s\S]*attracts[\s\S]*Σ_u [\s\S]*repels[\s\S]*"
        r"points add up to 2, with the 0 of the circle[\s\S]*out/fig05c-equilibria\.png"
    ),
    "equilibria rubber_chaplygin_gyrostat --longest 0 --json a.json": (
        r"at rest[\s\S]*every motion from rest is closed"
    ),
    "basins fig10_stable --starts 8 --json a.json": r"straight line +1\.000",
    "equilibria classical_regular --json a.json": r"straight +0\.",
    "figures 3 --json a.json": r"out/fig03\.png",
}


@pytest.mark.slow
@pytest.mark.parametrize(("arguments", "words"), COMMANDS.items())
def test_the_commands_say_it_and_write_it(
    robotball: Robotball,
    tmp_path: Path,
    arguments: str,
    words: str,
) -> None:
    """Status 0, the result on standard output, and the same as JSON with its versions."""
    status, out, _ = robotball(*arguments.split())
    assert status == 0
    assert re.search(words, out)
    record = json.loads((tmp_path / "a.json").read_text())
    assert record["versions"]["mujoco"]


BAD_INPUT = {
    "figures 2": r"no figure 2 to draw; there are 3 to 14, and tori",
    "figures ten": r"no figure ten to draw",
    "section fig12 --count 0": r"count must be at least 1, not 0",
    "section fig12 --preset fastt": r"no preset is called 'fastt'",
    "section fig12 --preset naive --count 2": r"MuJoCo's run is no result",
    "lyapunov fig12 --starts 0": r"starts must be at least 1, not 0",
    "lyapunov fig12 --duration -1": r"duration and transient must be positive",
    "basins fig12 --starts 1": r"starts must be at least 2, not 1",
    # Each scene that a command is not for is told the one that is.
    **{
        f"{command} wobbling_drive": (
            r"its drives change in time, and an? \w+ needs constant rates; "
            r"'robotball compare wobbling_drive' shows its motion"
        )
        for command in ("equilibria", "section", "lyapunov", "basins")
    },
    **{
        f"{command} fig06": (
            r"fig06 starts from rest, and an? \w+ needs a momentum M other than zero; "
            r"'robotball equilibria fig06' shows the motion from rest"
        )
        for command in ("section", "lyapunov", "basins")
    },
    "basins chaplygin_ball": r"does not turn .* no attractors; 'robotball section chaplygin_ball'",
    "equilibria rubber_chaplygin_ball": (
        r"the ball rests at every γ; 'robotball section rubber_chaplygin_ball' shows how it rolls"
    ),
}


@pytest.mark.parametrize(("arguments", "words"), BAD_INPUT.items())
def test_what_they_cannot_use_is_one_line(
    robotball: Robotball,
    arguments: str,
    words: str,
) -> None:
    """Status 2 and one clear line, no traceback."""
    status, _, err = robotball(*arguments.split())
    assert status == 2
    assert re.search(rf"robotball: .*{words}.*\n$", err)
