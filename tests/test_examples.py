"""Each of examples/ runs as it is, and shows what it says."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


def run(folder: Path, *arguments: str) -> str:
    """The output of Python in an empty folder; fails where it fails."""
    project = str(EXAMPLES.parent)
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": project},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_the_script_compares_side_by_side(tmp_path: Path) -> None:
    """Two presets, with their errors, and a picture."""
    out = run(tmp_path, str(EXAMPLES / "side_by_side.py"), "fig06", "fast", "balanced")
    assert out.count("agrees") == 2
    assert (tmp_path / "out" / "fig06-side-by-side.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.slow
def test_the_regression_test_of_a_robot_passes(tmp_path: Path) -> None:
    """By pytest, with no configuration of ours."""
    file = EXAMPLES / "test_my_robot.py"
    options = ("-q", "-p", "no:cacheprovider", "-c", os.devnull)
    assert "3 passed" in run(tmp_path, "-m", "pytest", *options, str(file))


@pytest.mark.slow
def test_the_notebook_runs_from_top_to_bottom(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cell by cell, as a kernel does it, and what a cell ends with can be shown."""
    monkeypatch.chdir(tmp_path)
    book = json.loads((EXAMPLES / "tutorial.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(each["source"]) for each in book["cells"] if each["cell_type"] == "code"]
    names: dict[str, object] = {}
    shown = 0
    for cell in cells:
        *lines, last = cell.splitlines()
        try:
            ending = compile(last, "cell", "eval")
        except SyntaxError:
            exec(cell, names)
            continue
        exec("\n".join(lines), names)
        value = eval(ending, names)
        shown += any(hasattr(value, f"_repr_{kind}_") for kind in ("html", "png"))
    assert shown == 6  # a scene, two motions, a picture, two agreements
    assert all(each["outputs"] == [] for each in book["cells"] if each["cell_type"] == "code")
