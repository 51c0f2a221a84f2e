"""Solids of the parts of a scene file: boxes, discs, rods, by their sizes, masses or densities.

A part lies where the frame's axes have it, from the sphere's centre; SI units. The file is loaded
for scenes whose bodies are given by parts; their tables are among the others, in `scene_tables`.
"""

import itertools
import math

import numpy as np

from robotball.errors import InputError, check_not_negative, check_positive, unknown
from robotball.files import scene_tables as tables
from robotball.robot.ball import Solid, axial_tensor, shell_inertia
from robotball.robot.scene import unit
from robotball.robot.shapes import Shape, tube
from robotball.rotations import Array, Z, direction, rotation_matrix, z_along

# kg/m³, of solid material; grades differ by a few hundredths.
DENSITIES = {
    "abs": 1050.0, "pla": 1240.0, "petg": 1270.0, "pmma": 1190.0, "pc": 1200.0, "nylon": 1140.0,
    "pom": 1410.0, "aluminium": 2700.0, "steel": 7850.0, "brass": 8500.0, "lead": 11340.0,
    "tungsten": 19300.0,
}  # fmt: skip
_SIGNS = [np.array(signs) for signs in itertools.product((-1.0, 1.0), repeat=3)]


def solid_of(part: tables.Part, axis: Array = Z) -> Solid:
    """Return the mass, centre, inertia and reach of a part.

    axis: the direction (3,) of a part that names none. Raises InputError for sizes or masses that
    cannot be.
    """
    name = f"a {type(part).__name__.lower()}"
    match part:
        case tables.Point():
            # It has no inertia of its own, but one by its place once it is put to other parts.
            mass, middle = check_positive(f"{name}'s mass", part.mass, "kg"), np.array(part.centre)
            dot = Shape("sphere", np.zeros(3), middle)
            return Solid(mass, middle, np.zeros((3, 3)), math.hypot(*part.centre), (dot,))
        case tables.Sphere():
            return _sphere(name, part)
        case tables.Box():
            return _box(name, part)
        case tables.Cylinder():
            a, b, h = part.outer, part.inner_radius, part.length
            check_positive(f"{name}'s length", h, "m")
            mass = _mass_of_tube(name, part, a, b, h)
        case tables.Disc():
            a, b, h = part.outer, part.inner_radius, part.thickness
            check_not_negative(f"{name}'s thickness", h, "m")
            mass = _mass_of_tube(name, part, a, b, h)
        case tables.Ring():
            mass = check_positive(f"{name}'s mass", part.mass, "kg")
            a = b = check_positive(f"{name}'s radius", part.radius, "m")
            h = 0.0
        case tables.Rod():
            return _rod(name, part)
    if part.axis is not None:
        axis = direction(f"{name}'s axis", np.array(part.axis))
    # Cylinders, discs and rings are tubes, of their length and hole.
    return _tube(mass, a, b, h, part.centre, axis)


def _sphere(name: str, sphere: tables.Sphere) -> Solid:
    a = check_positive(f"{name}'s radius", sphere.outer, "m")
    wall = a if sphere.thickness is None else sphere.thickness
    # Of unit mass: the wall is checked before its volume is taken.
    moment = shell_inertia(a, 1.0, wall)
    mass = mass_of(name, sphere, volume_of_wall(a, wall))
    reach, middle = math.hypot(*sphere.centre) + a, np.array(sphere.centre)
    shape = Shape("sphere", np.array([a, 0.0, 0.0]), middle)
    return Solid(mass, middle, mass * moment * np.eye(3), reach, (shape,))


def _box(name: str, box: tables.Box) -> Solid:
    x, y, z = (check_positive(f"{name}'s size", edge, "m") for edge in box.size)
    mass = mass_of(name, box, x * y * z)
    moments = mass / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    R = rotation_matrix(unit("attitude", np.array(box.attitude)))
    corners = [box.centre + R @ (signs * box.size) / 2 for signs in _SIGNS]
    reach = max(float(np.linalg.norm(corner)) for corner in corners)
    shape = Shape("box", np.array(box.size) / 2, np.array(box.centre), np.array(box.attitude))
    return Solid(mass, np.array(box.centre), R @ np.diag(moments) @ R.T, reach, (shape,))


def _rod(name: str, rod: tables.Rod) -> Solid:
    check_not_negative(f"{name}'s radius", rod.outer, "m")
    begin, end = np.array(rod.begin), np.array(rod.end)
    x, y, z = ((begin + end) / 2).tolist()
    n, length = direction(name, end - begin), float(np.linalg.norm(end - begin))
    mass = mass_of(name, rod, math.pi * rod.outer**2 * length)
    return _tube(mass, rod.outer, 0.0, length, (x, y, z), n)


def _mass_of_tube(name: str, given: tables.Matter, a: float, b: float, h: float) -> float:
    """Return the mass [kg] of a tube of outer radius a, inner radius b and length h."""
    check_positive(f"{name}'s radius", a, "m")
    if not 0 <= b < a:
        raise InputError(
            f"{name}'s inner_radius must be at least 0 and less than its radius {a:g}, not {b:g} m"
        )
    # (a - b)(a + b), as a² - b² would lose the digits of a thin wall.
    return mass_of(name, given, math.pi * (a - b) * (a + b) * h)


def _tube(mass: float, a: float, b: float, h: float, centre: tables.Triple, axis: Array) -> Solid:
    """Return a tube of outer radius a, inner radius b and length h about a unit vector (3,)."""
    # Of a disc (h = 0) and a hoop (a = b) too: m(a² + b²)/4 + m h²/12 across the axis.
    across = mass * (a * a + b * b) / 4
    middle = np.array(centre)
    ends = [middle - h / 2 * axis, middle + h / 2 * axis]
    reach = max(_reach_of_circle(end, axis, a) for end in ends)
    shape = tube(a, b, h) if b else Shape("cylinder", np.array([a, h / 2, 0.0]))
    inertia = axial_tensor(2 * across, across + mass * h * h / 12, axis)
    return Solid(mass, middle, inertia, reach, (shape.moved(z_along(axis), middle),))


def _reach_of_circle(centre: Array, axis: Array, radius: float) -> float:
    """Return how far from the origin a circle about `axis` reaches."""
    along = float(centre @ axis)
    return math.hypot(along, float(np.linalg.norm(centre - along * axis)) + radius)


def mass_of(name: str, given: tables.Matter, volume: float) -> float:
    """Return the mass [kg] as given, or of a density or a material in a volume [m³].

    Raises InputError unless one of the three is given, and for a density in no volume.
    """
    mass, density, ways = given.mass, given.density, given.given("mass", "density", "material")
    if len(ways) > 1:
        raise InputError(f"{name} takes a mass, a density or a material, not {' and '.join(ways)}")
    if given.material is not None:
        if (word := given.material.lower()) not in DENSITIES:
            raise unknown("material", given.material, DENSITIES)
        density = DENSITIES[word]
    if density is not None:
        check_positive(f"{name}'s density", density, "kg/m³")
        if volume == 0:
            raise InputError(f"{name} of no thickness takes a mass, not a density or a material")
        mass = density * volume
    if mass is None:
        raise InputError(f"{name} needs a mass [kg], a density [kg/m³] or a material")
    return check_positive(f"{name}'s mass", mass, "kg")


def volume_of_wall(radius: float, thickness: float) -> float:
    """Return the volume of a spherical wall inside the radius [m³]."""
    b = 1 - thickness / radius
    return 4 / 3 * math.pi * radius**2 * thickness * (1 + b + b * b)
