"""Bodies as people know them: boxes, discs, rods, by their sizes and masses or densities.

A part lies where the frame's axes have it, from the sphere's centre; SI units.
"""

import itertools
import math
from typing import Annotated

import msgspec
import numpy as np

from robotball.drives import key
from robotball.errors import InputError, check_not_negative, check_positive, check_size
from robotball.robot import Solid, axial_tensor, thick_shell_inertia
from robotball.rotations import Array, normalised, rotation_matrix
from robotball.scene import unit

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]
Z = np.array([0.0, 0.0, 1.0])
SIGNS = [np.array(signs) for signs in itertools.product((-1.0, 1.0), repeat=3)]


Mass = Annotated[float, key("its mass", "kg")]
OrMass = Annotated[float | None, key("its mass, or else its density", "kg")]
Density = Annotated[float | None, key("instead of the mass", "kg/m³")]
Radius = Annotated[float, key("its outer radius", "m")]
Place = Annotated[Triple, key("where its middle is, from the sphere's centre", "m")]
Axis = Annotated[
    Triple | None,
    key("what it is symmetric about; without it the axis of the shell or rotor, or else z"),
]
ORIGIN: Triple = (0.0, 0.0, 0.0)
UPRIGHT: Quadruple = (1.0, 0.0, 0.0, 0.0)


class _Part(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="kind"
):
    def _positive(self, name: str, value: float, unit: str = "m") -> float:
        check_positive(f"{self._name()}'s {name}", value, unit)
        return value

    def _name(self) -> str:
        return f"a {type(self).__name__.lower()}"


class Point(_Part, frozen=True, kw_only=True, tag="point"):
    """A mass without a size; it needs another part beside it."""

    mass: Mass
    centre: Place = ORIGIN

    def solid(self, axis: Array = Z) -> Solid:
        mass, reach = self._positive("mass", self.mass, "kg"), math.hypot(*self.centre)
        return Solid(mass, np.array(self.centre), np.zeros((3, 3)), reach)


class Sphere(_Part, frozen=True, kw_only=True, tag="sphere"):
    """A ball, solid or hollow."""

    mass: OrMass = None
    density: Density = None
    radius: Radius
    thickness: Annotated[float | None, key("of its wall; without it the ball is solid", "m")] = None
    centre: Place = ORIGIN

    def solid(self, axis: Array = Z) -> Solid:
        a = self._positive("radius", self.radius)
        wall = a if self.thickness is None else self.thickness
        moment = thick_shell_inertia(a, 1.0, wall)
        mass = mass_of(self._name(), self.mass, self.density, volume_of_wall(a, wall))
        reach = math.hypot(*self.centre) + a
        return Solid(mass, np.array(self.centre), mass * moment * np.eye(3), reach)


class Box(_Part, frozen=True, kw_only=True, tag="box"):
    """A cuboid."""

    mass: OrMass = None
    density: Density = None
    size: Annotated[Triple, key("its three edges, whole lengths", "m")]
    centre: Place = ORIGIN
    attitude: Annotated[
        Quadruple, key("quaternion (w, x, y, z) that turns its edges from x, y, z")
    ] = UPRIGHT

    def solid(self, axis: Array = Z) -> Solid:
        x, y, z = (self._positive("size", edge) for edge in self.size)
        mass = mass_of(self._name(), self.mass, self.density, x * y * z)
        moments = mass / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
        R = rotation_matrix(unit("attitude", np.array(self.attitude)))
        corners = [self.centre + R @ (signs * self.size) / 2 for signs in SIGNS]
        reach = max(float(np.linalg.norm(corner)) for corner in corners)
        return Solid(mass, np.array(self.centre), R @ np.diag(moments) @ R.T, reach)


class Cylinder(_Part, frozen=True, kw_only=True, tag="cylinder"):
    """A cylinder or a tube."""

    mass: OrMass = None
    density: Density = None
    radius: Radius
    length: Annotated[float, key("along the axis", "m")]
    inner_radius: Annotated[float, key("of a tube", "m")] = 0.0
    centre: Place = ORIGIN
    axis: Axis = None

    def solid(self, axis: Array = Z) -> Solid:
        a, b, h = self.radius, self.inner_radius, self._positive("length", self.length)
        _check_hole(self._name(), a, b)
        mass = mass_of(self._name(), self.mass, self.density, math.pi * (a - b) * (a + b) * h)
        return _tube(mass, a, b, h, self.centre, _along(self, self.axis, axis))


class Disc(_Part, frozen=True, kw_only=True, tag="disc"):
    """A disc of no thickness, with or without a round hole."""

    mass: Mass
    radius: Radius
    inner_radius: Annotated[float, key("of its hole", "m")] = 0.0
    centre: Place = ORIGIN
    axis: Axis = None

    def solid(self, axis: Array = Z) -> Solid:
        mass, a, b = self._positive("mass", self.mass, "kg"), self.radius, self.inner_radius
        _check_hole(self._name(), a, b)
        return _tube(mass, a, b, 0.0, self.centre, _along(self, self.axis, axis))


class Ring(_Part, frozen=True, kw_only=True, tag="ring"):
    """A hoop, all of whose mass is at its radius."""

    mass: Mass
    radius: Radius
    centre: Place = ORIGIN
    axis: Axis = None

    def solid(self, axis: Array = Z) -> Solid:
        mass, a = self._positive("mass", self.mass, "kg"), self._positive("radius", self.radius)
        return _tube(mass, a, a, 0.0, self.centre, _along(self, self.axis, axis))


class Rod(_Part, frozen=True, kw_only=True, tag="rod"):
    """A round rod between two points."""

    mass: Mass
    begin: Annotated[Triple, key("the middle of its one end, from the sphere's centre", "m")]
    end: Annotated[Triple, key("the middle of its other end", "m")]
    radius: Annotated[float, key("of its round section", "m")] = 0.0

    def solid(self, axis: Array = Z) -> Solid:
        for coordinate in (*self.begin, *self.end):
            check_size("a rod's end", coordinate, "m")
        check_not_negative("a rod's radius", self.radius, "m")
        begin, end = np.array(self.begin), np.array(self.end)
        x, y, z = ((begin + end) / 2).tolist()
        mass, n = self._positive("mass", self.mass, "kg"), direction("a rod", end - begin)
        return _tube(mass, self.radius, 0.0, float(np.linalg.norm(end - begin)), (x, y, z), n)


Part = Point | Sphere | Box | Cylinder | Disc | Ring | Rod


def _along(part: Part, own: Triple | None, body: Array) -> Array:
    return body if own is None else direction(f"{part._name()}'s axis", np.array(own))


def _tube(mass: float, a: float, b: float, h: float, centre: Triple, axis: Array) -> Solid:
    """A tube of outer radius a, inner radius b and length h about a unit vector (3,)."""
    across = mass * (a * a + b * b) / 4
    middle = np.array(centre)
    ends = [middle - h / 2 * axis, middle + h / 2 * axis]
    reach = max(_reach_of_circle(end, axis, a) for end in ends)
    return Solid(mass, middle, axial_tensor(2 * across, across + mass * h * h / 12, axis), reach)


def _reach_of_circle(centre: Array, axis: Array, radius: float) -> float:
    """How far from the origin a circle about `axis` reaches."""
    along = float(centre @ axis)
    return math.hypot(along, float(np.linalg.norm(centre - along * axis)) + radius)


def mass_of(name: str, mass: float | None, density: float | None, volume: float) -> float:
    """The mass [kg] as given, or of a density [kg/m³] in a volume [m³]; InputError unless one."""
    if mass is not None and density is not None:
        raise InputError(f"{name} takes a mass or a density, not both")
    if density is not None:
        check_positive(f"{name}'s density", density, "kg/m³")
        mass = density * volume
    if mass is None:
        raise InputError(f"{name} needs a mass [kg] or a density [kg/m³]")
    check_positive(f"{name}'s mass", mass, "kg")
    return mass


def volume_of_wall(radius: float, thickness: float) -> float:
    """The volume of a spherical wall inside the radius [m³]."""
    b = 1 - thickness / radius
    return 4 / 3 * math.pi * radius**2 * thickness * (1 + b + b * b)


def _check_hole(name: str, outer: float, inner: float) -> None:
    check_positive(f"{name}'s radius", outer, "m")
    if not 0 <= inner < outer:
        raise InputError(
            f"{name}'s inner_radius must be at least 0 and less than its radius {outer:g}, not "
            f"{inner:g} m"
        )


def direction(name: str, v: Array) -> Array:
    """A unit vector (3,) along `v` (3,); InputError where it has no direction."""
    length = float(np.linalg.norm(v))
    if not (np.isfinite(length) and length > 0):
        raise InputError(f"{name} must have a length and a direction, unlike {v.tolist()}")
    return normalised(v)
