"""Logs with published numbers and results."""

from pathlib import Path

import numpy as np
import pytest

import robotball as rb
from robotball.rotations import Array

SPHERE = """title = "Solid sphere"
rolling = "classical"
duration = 10
gravity_direction = [{slope}, 0, {down}]
[shell]
radius = {radius}
mass = {mass}
inertia = {{ axial = {moment}, transverse = {moment} }}
[frame]
mass = 1e-9
inertia = [1e-15, 1e-15, 1e-15]
[friction]
rolling = 0
[start]
attitude = [1, 0, 0, 0]
rest = true
"""


def fitted(
    folder: Path, times: Array, x: Array, free: str, noise: float, radius: float, slope: float = 0.0
) -> rb.Estimate:
    """Fit a number of a solid sphere of 0.1 kg that rolls along X; slope: in degrees."""
    values = {"slope": np.sin(np.radians(slope)), "down": -np.cos(np.radians(slope))}
    values |= {"radius": radius, "mass": 0.1, "moment": 0.4 * 0.1 * radius**2}
    (folder / "ball.toml").write_text(SPHERE.format(**values), encoding="utf-8")
    table = np.column_stack([times, x, 0 * x])
    np.savetxt(folder / "log.csv", table, delimiter=",", header="t,x,y", comments="")
    log = rb.read_log(folder / "log.csv", folder / "ball.toml")
    result = rb.fit(folder / "ball.toml", [log], [free], noise={"position": noise})
    assert result.explains
    return result.found[0]


def test_galileos_inclined_plane_gives_gravity(tmp_path: Path) -> None:
    """Distances in punti of 0.94 mm after equal times, on a plane of 1.7 degrees.

    Galileo's manuscript 72, folio 107v, of 1604. The plane and intervals of 0.55 s are those of
    S. Drake, "Galileo: Pioneer Scientist" (1990). Gravity is known as well as these: 0.05 degrees
    are 3 %.
    """
    punti = np.array([0, 33, 130, 298, 526, 824, 1192, 1620])
    gravity = fitted(
        tmp_path, np.linspace(0.0, 3.85, 8), np.asarray(0.94e-3 * punti), "gravity", 2e-3, 0.01, 1.7
    )
    assert gravity.value == pytest.approx(9.81, rel=0.03)  # measured 9.75


def test_a_golf_ball_stops_after_the_length_of_a_fast_green(tmp_path: Path) -> None:
    """A stimpmeter releases it at 1.83 m/s, and it stops after 12 feet.

    The excerpt has these numbers, to cm. A. R. Penner, "The physics of putting", Canadian Journal
    of Physics 80 (2002) 83, gives 0.065 for the rolling friction over the radius of this green.
    """
    speed, length, radius = 1.83, 12 * 0.3048, 21.35e-3
    t = np.arange(0.0, 3.6, 0.2)
    x = np.round(speed * t - speed**2 / (4 * length) * t**2, 2)
    rolling = fitted(tmp_path, t, x, "friction.rolling", 3e-3, radius)
    assert rolling.value / radius == pytest.approx(0.065, rel=0.02)  # measured 0.0649


def test_the_times_of_a_metal_ball_on_a_classroom_floor_determine_no_resistance(
    tmp_path: Path,
) -> None:
    """Mean times of three videos at each half metre, of a school laboratory's ball.

    R. Trinter and G. Garrett, "Velocity/acceleration of a rolling ball", laboratory report (2015).
    A parabola through the same numbers gives the deceleration independently.
    """
    t = np.array([0.330, 0.699, 1.111, 1.483, 1.870, 2.274])
    x, radius = np.arange(0.5, 3.1, 0.5), 0.0126
    bend, _, _ = np.polyfit(t, x, 2)
    rolling = fitted(tmp_path, t, x, "friction.rolling", 0.02, radius)
    expected = -2 * bend * 7 / 5 * radius / 9.81
    assert abs(rolling.value - expected) < 0.01 * rolling.deviation  # measured 1e-4 of it
    assert not rolling.determined
