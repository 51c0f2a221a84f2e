"""Masses, centres, moments and extents of parts of given sizes."""

import math
from typing import Any

import mujoco
import numpy as np
import pytest

from robotball.files.scene_tables import (
    DENSITIES,
    Box,
    Cylinder,
    Disc,
    Part,
    Point,
    Ring,
    Rod,
    Sphere,
)
from robotball.robot.ball import Solid
from robotball.rotations import z_along
from robotball.scene_files.scene_file import solid_of

CENTRE = (0.03, -0.02, 0.05)
AXIS = (1.0, -2.0, 2.0)
LAID = tuple(z_along(np.array(AXIS) / 3).tolist())
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
TURNED = (0.5, -0.5, 0.1, 0.7)  # of length 1


def off(ours: Solid, theirs: Solid) -> float:
    """The largest error of mass, centre and inertia, relative to their sizes."""
    pairs = [(solid.mass, solid.centre, solid.inertia) for solid in (ours, theirs)]
    gaps = [np.abs(a - b).max() / (np.abs(b).max() or 1.0) for a, b in zip(*pairs, strict=True)]
    return float(max(gaps))


SAME: list[tuple[Part, str, list[float], Any, Any]] = [
    (Sphere(density=700.0, radius=0.1, centre=CENTRE), "SPHERE", [0.1, 0, 0], CENTRE, UPRIGHT),
    (Box(mass=1.3, size=(0.2, 0.1, 0.06), centre=CENTRE, attitude=TURNED),
     "BOX", [0.1, 0.05, 0.03], CENTRE, TURNED),
    (Cylinder(density=2700.0, radius=0.04, length=0.12, centre=CENTRE, axis=AXIS),
     "CYLINDER", [0.04, 0.06, 0], CENTRE, LAID),
    (Disc(density=7850.0, diameter=0.08, thickness=0.012, centre=CENTRE, axis=AXIS),
     "CYLINDER", [0.04, 0.006, 0], CENTRE, LAID),
    (Rod(material="STEEL", begin=(0.0, 0.0, 0.0), end=(0.1, -0.2, 0.2), diameter=0.02),
     "CYLINDER", [0.01, 0.15, 0], (0.05, -0.1, 0.1), LAID),
]  # fmt: skip


@pytest.mark.parametrize(("part", "kind", "size", "place", "attitude"), SAME)
def test_parts_are_mujocos_bodies_of_that_shape(
    part: Part, kind: str, size: list[float], place: Any, attitude: Any
) -> None:
    """Mass, centre and tensor, by another program's formulas. Measured 2e-16, rounding."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="b")
    body.add_freejoint()
    geom = body.add_geom(
        type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"), size=size, pos=place, quat=attitude
    )
    if part.mass is not None:
        geom.mass = part.mass
    else:
        geom.density = part.density or DENSITIES[str(part.material).lower()]
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    axes = data.ximat[1].reshape(3, 3)
    inertia = axes @ np.diag(model.body_inertia[1]) @ axes.T
    theirs = Solid(float(model.body_mass[1]), data.xipos[1].copy(), inertia)
    assert off(solid_of(part), theirs) < 2e-15


def without(outer: Part, inner: Part) -> Solid:
    """Return a body with another cut out of its middle."""
    a, b = solid_of(outer), solid_of(inner)
    return Solid(a.mass - b.mass, a.centre, a.inertia - b.inertia)


def tube(outer: float, inner: float = 0.0) -> Cylinder:
    return Cylinder(density=900.0, radius=outer, inner_radius=inner, length=0.3, axis=AXIS)


HOLLOW: dict[str, tuple[Part, Solid]] = {
    "hollow sphere": (
        Sphere(density=900.0, radius=0.2, thickness=0.03),
        without(Sphere(density=900.0, radius=0.2), Sphere(density=900.0, radius=0.17)),
    ),
    "tube": (tube(0.2, 0.15), without(tube(0.2), tube(0.15))),
    "disc with a hole": (
        Disc(mass=0.7, radius=0.2, inner_radius=0.15),
        solid_of(Cylinder(mass=0.7, radius=0.2, inner_radius=0.15, length=1e-9)),
    ),
    "ring": (
        Ring(mass=0.7, radius=0.2),
        solid_of(Disc(mass=0.7, radius=0.2, inner_radius=0.2 * (1 - 1e-15))),
    ),
}


@pytest.mark.parametrize(("part", "expected"), HOLLOW.values(), ids=HOLLOW)
def test_a_hollow_part_is_the_difference_of_two_solid_ones(part: Part, expected: Solid) -> None:
    """Or a tube of zero length. Measured 2e-15: rounding of the difference."""
    assert off(solid_of(part), expected) < 2e-14


@pytest.mark.parametrize(
    ("part", "reach"),
    [
        (Point(mass=1.0, centre=(0.3, 0.0, 0.4)), 0.5),
        (Sphere(mass=1.0, radius=0.1, centre=(0.3, 0.0, 0.4)), 0.6),
        (Box(mass=1.0, size=(0.2, 0.4, 0.6), centre=(0.0, 0.0, 0.1)), math.sqrt(0.21)),
        (Ring(mass=1.0, radius=0.3, centre=(0.0, 0.0, 0.4)), 0.5),
        (Ring(mass=1.0, radius=0.3, centre=(0.4, 0.0, 0.0)), 0.7),
        (Ring(mass=1.0, radius=0.3, centre=(0.4, 0.0, 0.0), axis=(2.0, 0.0, 0.0)), 0.5),
        (Cylinder(mass=1.0, radius=0.3, length=0.4, centre=(0.0, 0.0, 0.2)), 0.5),
        (Rod(mass=1.0, begin=(0.0, 0.0, 0.1), end=(0.0, 0.0, 0.4), radius=0.3), 0.5),
    ],
)
def test_a_part_reaches_as_far_as_its_furthest_point(part: Part, reach: float) -> None:
    """By triangles of 3, 4 and 5."""
    assert solid_of(part).reach == pytest.approx(reach, rel=1e-15)
