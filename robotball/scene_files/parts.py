"""Solids of the parts of a scene file, from their sizes and masses or densities.

Positions are in frame axes, from the sphere's centre; SI units. Only scenes with parts load this
file.
"""

import itertools
import math

import numpy as np

from robotball.files import scene_tables as tables
from robotball.robot.ball import Solid, axial_tensor, shell_inertia, wall_volume
from robotball.robot.scene import unit
from robotball.robot.shapes import Shape, tube
from robotball.rotations import Array, Z, direction, rotation_matrix, z_along

_SIGNS = [np.array(signs) for signs in itertools.product((-1.0, 1.0), repeat=3)]


def solid_of(part: tables.Part, axis: Array = Z) -> Solid:
    """Return the mass, centre, inertia and reach of a part.

    axis: direction (3,) of a part without an axis. Raises InputError for impossible sizes or
    masses.
    """
    match part:
        case tables.Point():
            # Its inertia comes from its position, when parts are composed.
            centre = np.array(part.centre)
            dot = Shape("sphere", np.zeros(3), centre)
            return Solid(part.mass, centre, np.zeros((3, 3)), math.hypot(*part.centre), (dot,))
        case tables.Sphere():
            a, centre = part.outer, np.array(part.centre)
            wall = a if part.thickness is None else part.thickness
            moment = shell_inertia(a, 1.0, wall)  # of unit mass; checks the wall
            mass = part.mass_in(wall_volume(a, wall))
            ball = Shape("sphere", np.array([a, 0.0, 0.0]), centre)
            reach = math.hypot(*part.centre) + a
            return Solid(mass, centre, mass * moment * np.eye(3), reach, (ball,))
        case tables.Box():
            (x, y, z), centre = part.size, np.array(part.centre)
            mass = part.mass_in(x * y * z)
            moments = mass / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
            R = rotation_matrix(unit("attitude", np.array(part.attitude)))
            corners = [centre + R @ (signs * part.size) / 2 for signs in _SIGNS]
            reach = max(float(np.linalg.norm(corner)) for corner in corners)
            box = Shape("box", np.array(part.size) / 2, centre, np.array(part.attitude))
            return Solid(mass, centre, R @ np.diag(moments) @ R.T, reach, (box,))
        case tables.Rod():
            begin, end, a = np.array(part.begin), np.array(part.end), part.outer
            axis, length = direction("rod", end - begin), float(np.linalg.norm(end - begin))
            mass = part.mass_in(math.pi * a**2 * length)
            return _tube(mass, a, 0.0, length, (begin + end) / 2, axis)
        case tables.Ring():
            mass, a, b, h = part.mass, part.radius, part.radius, 0.0
        case tables.Cylinder() | tables.Disc():
            a, b = part.outer, part.inner_radius
            h = part.length if isinstance(part, tables.Cylinder) else part.thickness
            # (a - b)(a + b), because a² - b² would lose digits for a thin wall.
            mass = part.mass_in(math.pi * (a - b) * (a + b) * h)
    if part.axis is not None:
        axis = direction("axis", np.array(part.axis))
    return _tube(mass, a, b, h, np.array(part.centre), axis)


def _tube(mass: float, a: float, b: float, h: float, centre: Array, axis: Array) -> Solid:
    """Return a tube with outer radius a, inner radius b and length h about a unit vector (3,)."""
    # m(a² + b²)/4 + m h²/12 across the axis holds for discs (h = 0) and hoops (a = b) too.
    across = mass * (a * a + b * b) / 4
    reach = max(_reach_of_circle(centre + end * axis, axis, a) for end in (-h / 2, h / 2))
    shape = tube(a, b, h) if b else Shape("cylinder", np.array([a, h / 2, 0.0]))
    inertia = axial_tensor(2 * across, across + mass * h * h / 12, axis)
    return Solid(mass, centre, inertia, reach, (shape.moved(z_along(axis), centre),))


def _reach_of_circle(centre: Array, axis: Array, radius: float) -> float:
    """Return the largest distance from the origin to a circle about `axis`."""
    along = float(centre @ axis)
    return math.hypot(along, float(np.linalg.norm(centre - along * axis)) + radius)
