"""Each of examples/ runs as it is, and shows what it says."""

import ast
import json
import os
import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to run in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_script_compares_side_by_side(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two presets, with their errors, and a picture."""
    monkeypatch.setattr(sys, "argv", ["side_by_side.py", "fig06", "fast", "balanced"])
    runpy.run_path(str(EXAMPLES / "side_by_side.py"), run_name="__main__")
    assert capsys.readouterr().out.count("agrees") == 2
    assert (folder / "out" / "fig06-side-by-side.png").read_bytes()[:4] == b"\x89PNG"


def test_the_regression_test_of_a_robot_passes() -> None:
    """By pytest, with no configuration of ours."""
    options = ("-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-c", os.devnull)
    assert pytest.main([*options, str(EXAMPLES / "test_my_robot.py")]) == 0


def test_the_notebook_runs_from_top_to_bottom() -> None:
    """Cell by cell, as a kernel does it, and what a cell ends with can be shown."""
    book = json.loads((EXAMPLES / "tutorial.ipynb").read_text(encoding="utf-8"))
    cells = [each for each in book["cells"] if each["cell_type"] == "code"]
    names: dict[str, object] = {}
    shown = 0
    for cell in cells:
        *lines, last = ast.parse("".join(cell["source"])).body
        exec(compile(ast.Module(lines, []), "cell", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
            shown += any(hasattr(value, f"_repr_{kind}_") for kind in ("html", "png"))
        else:
            exec(compile(ast.Module([last], []), "cell", "exec"), names)
    assert shown == 6  # a scene, two motions, a picture, two agreements
    assert all(each["outputs"] == [] for each in cells)
