"""Paths that a contact point may be wanted to take, from the origin along X at first."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from robotball.errors import InputError, check_positive, check_size
from robotball.rotations import Array

FINE = 2001  # points, of which a path's length is the sum


@dataclass(frozen=True)
class WantedPath:
    """A curve on the plane: point (2,) m and its slope (2,) at a part from 0 to 1 of the way."""

    name: str
    point: Callable[[float], Array]
    slope: Callable[[float], Array]

    @property
    def length(self) -> float:
        """[m]."""
        points = np.array([self.point(u) for u in np.linspace(0, 1, FINE).tolist()])
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def straight(length: float) -> WantedPath:
    """A straight line of a length [m]."""
    check_positive("the line's length", length, "m")
    along = np.array([length, 0.0])
    return WantedPath("line", lambda u: u * along, lambda u: along)


def circle(radius: float, turns: float = 1.0) -> WantedPath:
    """A circle of a radius [m], to the left, to the right for turns below 0."""
    check_positive("the circle's radius", radius, "m")
    check_size("the circle's turns", turns)
    if turns == 0:
        raise InputError("the circle's turns must not be 0")
    whole, side = 2 * np.pi * abs(turns), np.array([1.0, np.sign(turns)])

    def point(u: float) -> Array:
        return radius * side * np.array([np.sin(whole * u), 1 - np.cos(whole * u)])

    def slope(u: float) -> Array:
        return radius * whole * side * np.array([np.cos(whole * u), np.sin(whole * u)])

    return WantedPath("circle", point, slope)


def eight(size: float) -> WantedPath:
    """A figure eight with its crossing at the origin, from there `size` [m] to both ends."""
    check_positive("the figure's size", size, "m")
    turn = 2 * np.pi

    def point(u: float) -> Array:
        return size * np.array([np.sin(turn * u), np.sin(2 * turn * u) / 2])

    def slope(u: float) -> Array:
        return size * turn * np.array([np.cos(turn * u), np.cos(2 * turn * u)])

    return WantedPath("eight", point, slope)


def through(points: Sequence[Sequence[float]]) -> WantedPath:
    """A smooth curve from the origin through points (n, 2) [m] to the last of them."""
    corners = np.array([(0.0, 0.0), *points], dtype=float)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 2:
        raise InputError("waypoints are pairs X,Y, at least one")
    for number in corners.ravel().tolist():
        check_size("a waypoint", number, "m")
    apart = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    if not apart.min() > 0:
        raise InputError(f"waypoint {int(apart.argmin()) + 1} is where the path is already")
    spline = CubicSpline(np.concatenate([[0.0], np.cumsum(apart) / apart.sum()]), corners)
    return WantedPath("waypoints", spline, spline.derivative())
