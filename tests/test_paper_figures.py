"""Scripts in examples/paper draw their figures, and MuJoCo's motion agrees with the equations."""

import re
import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest

SCRIPTS = sorted((Path(__file__).parents[1] / "examples" / "paper").glob("*.py"))
LINES = 60  # of a script, at most


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Run the scripts in an empty folder; they also set the font size of later figures."""
    monkeypatch.chdir(tmp_path)
    with matplotlib.rc_context():
        yield


def drawn(script: str, *arguments: Any, picture: str = "") -> dict[str, float]:
    """Draw a figure with arguments that shorten it, and return the script's numbers."""
    (path,) = (path for path in SCRIPTS if path.stem == script)
    numbers: dict[str, float] = runpy.run_path(str(path))["main"](*arguments)
    assert Path("out", f"{picture or script}.png").read_bytes()[:4] == b"\x89PNG"
    return numbers


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_is_short_and_imports_only_what_users_have(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= LINES
    imports = re.findall(r"^(?:from|import) (\w+)", text, re.M)
    assert {*imports} <= {"robotball", "matplotlib", "numpy", "dataclasses", "pathlib"}


@pytest.mark.usefixtures("screen")
def test_figs_3_and_4_show_the_ball_at_both_ends_of_a_path() -> None:
    numbers = drawn("fig03_04", picture="fig04")
    assert Path("out/fig03.png").is_file()
    assert numbers["O to P"] == pytest.approx(2.19266, abs=1e-5)
    assert numbers["path error"] < 1e-8  # measured 6.4e-10: MuJoCo's steps


def test_fig_5_has_a_circle_in_d() -> None:
    numbers = drawn("fig05", 0.3)
    assert numbers["radius of d"] == pytest.approx(np.sqrt(5) / 4, abs=1e-5)  # measured 4e-7
    for name in "bcd":
        assert numbers[f"path error of {name}"] < 1e-6  # measured 4.9e-8: MuJoCo's steps


@pytest.mark.parametrize(
    ("number", "points", "period"), [(6, 10, 0.0), (7, 6, 60.0086), (8, 2, 6.09094)]
)
def test_figs_6_to_8_have_their_fixed_points_and_limit_cycles(
    number: int, points: int, period: float
) -> None:
    numbers = drawn("fig06_07_08", number, 0.2, picture=f"fig{number:02}")
    assert numbers["fixed points"] == points
    assert numbers.get("period", 0.0) == pytest.approx(period, rel=1e-5)
    assert numbers["path error"] < 1e-5  # measured 1.6e-6: MuJoCo's steps


def test_fig_9_has_the_ball_of_fig_10_outside_at_f_3_and_inside_at_f_2() -> None:
    numbers = drawn("fig09", 12)
    assert numbers["f = 2"] == pytest.approx(-0.00295, abs=1e-5)
    assert numbers["f = 3"] == pytest.approx(0.03153, abs=1e-5)


def test_fig_11_has_mujocos_crossings_on_the_crossings_of_the_equations() -> None:
    numbers = drawn("fig11", 2, 100.0)
    assert numbers["period, equations"] == pytest.approx(8.74326, abs=1e-5)
    # MuJoCo starts near the cycle, which attracts by a factor 0.928 per period.
    assert numbers["period, MuJoCo"] == pytest.approx(8.74326, abs=0.03)  # measured 0.008
    for name in ("fig12", "fig13", "fig14"):
        assert numbers[f"error of {name}"] < 3e-5  # measured 6.2e-6 for fig14: chaos


def test_fig_10_turns_round_to_a_line_that_is_stable_only_for_smaller_f() -> None:
    numbers = drawn("fig10")
    assert numbers["least dY/dt"] == pytest.approx(-1.0, abs=0.05)  # starts 0.01 from σ₊
    assert numbers["last dY/dt"] == pytest.approx(1.0, abs=1e-4)  # measured 3e-6
    assert numbers["stable below f"] == pytest.approx(2.0806, abs=1e-4)
    assert numbers["path error"] < 1e-6  # measured 3.3e-8: MuJoCo's steps


@pytest.mark.parametrize(("number", "drift"), [(12, 3.65907), (13, 3.665)])
def test_figs_12_and_13_drift_along_X(number: int, drift: float) -> None:
    numbers = drawn("fig12_13", number, 40.0, picture=f"fig{number}")
    # The mean over 40 s is off by the path's oscillation of one metre over that time.
    assert numbers["mean dX/dt"] == pytest.approx(drift, abs=0.03)  # measured 0.011
    assert numbers["path error"] < 1e-5  # measured 1.1e-6: MuJoCo's steps


def test_in_fig_14_both_paths_separate() -> None:
    numbers = drawn("fig14", 80.0)
    assert numbers["quarter"] < 1e-5  # measured 7.3e-7 at 20 s: MuJoCo's steps
    assert numbers["end"] > 30 * numbers["quarter"]  # measured 5.3e-4 at 80 s: chaos
