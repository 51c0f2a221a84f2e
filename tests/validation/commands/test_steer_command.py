"""`robotball steer`: drives that roll a robot along a path, or what it lacks for it."""

import re
from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from tests.conftest import Robotball

HALF = ("three_rotors", "--path", "circle", "--size", 0.5, "--turns", 0.25, "--duration", 2)


@pytest.mark.slow
def test_a_robot_is_steered_along_an_arc(robotball: Robotball, tmp_path: Path) -> None:
    """Status 0; the scene it writes rolls there by the equations, and its pictures are drawn."""
    status, out, _ = robotball("steer", *HALF)
    assert status == 0
    assert "circle of 0.7854 m in 2 s" in out
    assert "MuJoCo: agrees" in out
    off = float(re.findall(r"equations: at most (\S+) m off the path", out)[0])
    assert off < 3e-5  # measured 1.2e-5, by the interpolation of the rates
    *_, file, path, momentum = map(Path, out.splitlines())
    assert file.name == "three_rotors_circle-size-0.5-turns-0.25-2s.toml"
    assert all((tmp_path / each).read_bytes()[:4] == b"\x89PNG" for each in (path, momentum))
    motion = rb.integrate(rb.load_scene(tmp_path / file))
    # A quarter of a circle of 0.5 m to the left of X, from rest to rest.
    assert motion.contact_point[-1] == pytest.approx([0.5, 0.5], abs=3e-5)
    radii = np.linalg.norm(motion.contact_point - [0.0, 0.5], axis=1)
    assert radii == pytest.approx(0.5, abs=3e-5)


@pytest.mark.slow
def test_what_the_robot_lacks_is_said(robotball: Robotball) -> None:
    """Status 1 and a line that begins with `cannot`, where a hinge may not turn so fast."""
    status, out, _ = robotball("steer", *HALF, "--rate-limit", 1)
    assert status == 1
    assert re.search(r"^cannot: .*rad/s", out, re.MULTILINE)
