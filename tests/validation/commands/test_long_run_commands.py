"""The commands about long-run motion: their results, and what they say to a scene not theirs."""

import json
import re
from pathlib import Path

import pytest

from tests.conftest import Robotball

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
