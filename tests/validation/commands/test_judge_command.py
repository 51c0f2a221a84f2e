"""The commands `judge` and `export`: exit status, words, one-line errors."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from tests.conftest import Robotball


@pytest.fixture
def right(tmp_path: Path) -> Path:
    """A right file of fig12."""
    path = tmp_path / "right.csv"
    rb.integrate(rb.load_scene("fig12"), np.linspace(0, 2, 101)).save(path)
    return path


def test_what_is_exported_can_be_judged(robotball: Robotball, tmp_path: Path) -> None:
    """The reference of an export agrees: status 0; every file is named."""
    status, out, _ = robotball("export", "fig12", "--to", "ball", "--duration", 1)
    assert status == 0
    names = sorted(path.name for path in (tmp_path / "ball").iterdir())
    assert [Path(line).name for line in out.split()] == names
    status, out, _ = robotball("judge", "ball/scene.toml", "ball/reference.csv", "--json", "a.json")
    assert status == 0
    assert "agrees within 0.01 in path and momentum" in out
    record = json.loads((tmp_path / "a.json").read_text())
    (file,) = record["files"]
    assert record["agrees"]
    assert file["path_error"] < 1e-13
    assert {"slip", "slip_known_to", "spin", "lag", "trials", "mistakes"} <= set(file)
    assert record["versions"]["robotball"]


def test_a_mistake_is_named_beside_the_plain_errors(robotball: Robotball, right: Path) -> None:
    """Status 1; the errors under the candidate stand beside those of the file as it is."""
    text = right.read_text().replace("t,x,y,qw,qx,qy,qz", "t,x,y,qx,qy,qz,qw")
    (right.parent / "order.csv").write_text(text)
    status, out, _ = robotball("judge", "fig12", "order.csv")
    assert status == 1
    assert "WRONG: qx, qy, qz, qw hold w, x, y, z\n" in out
    assert re.search(r"without that: path error 0\.0e\+00", out)
    assert re.search(r"\nall is as it should be +0\.0e\+00 +3\.\de\+00", out)
    assert re.search(
        r"\nqx, qy, qz, qw hold w, x, y, z +0\.0e\+00 +\d\.\de[-+]\d\d +0\.0e\+00", out
    )


def test_units_and_a_byte_order_mark_are_told(robotball: Robotball, right: Path) -> None:
    """A line each."""
    lines = right.read_text().split("\n")
    first = next(i for i, line in enumerate(lines) if line.startswith("t,"))
    lines[first] = lines[first].replace("t,x,y", "t,x [mm],y [mm]")
    for i, line in enumerate(lines[first + 1 :], first + 1):
        if line:
            t, x, y, *others = line.split(",")
            lines[i] = ",".join([t, repr(1e3 * float(x)), repr(1e3 * float(y)), *others])
    (right.parent / "mm.csv").write_text("\n".join(lines), encoding="utf-8-sig")
    status, out, _ = robotball("judge", "fig12", "mm.csv")
    assert status == 0
    assert "\n  it begins with a byte order mark, which is skipped\n" in out
    assert "\n  x, y: in mm, as the file says, and taken so\n" in out
