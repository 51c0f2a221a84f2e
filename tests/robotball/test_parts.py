"""Parts by their sizes: masses, centres and moments, and how far they reach."""

import math
from typing import Any

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.files.parts import solid_of
from robotball.files.scene_tables import (
    Box,
    Cylinder,
    Disc,
    Part,
    Point,
    Ring,
    Rod,
    Sphere,
)
from robotball.robot import Solid, composed
from robotball.rotations import z_along

CENTRE = (0.03, -0.02, 0.05)
AXIS = (1.0, -2.0, 2.0)
LAID = tuple(z_along(np.array(AXIS) / 3).tolist())
TURNED = (0.5, -0.5, 0.1, 0.7)  # of length 1


def compiled(geom: dict[str, Any]) -> Solid:
    """The same body by MuJoCo's compiler."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="b")
    body.add_freejoint()
    body.add_geom(**geom)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    axes = data.ximat[1].reshape(3, 3)
    inertia = axes @ np.diag(model.body_inertia[1]) @ axes.T
    return Solid(float(model.body_mass[1]), data.xipos[1].copy(), inertia)


GEOM = mujoco.mjtGeom
SAME: dict[str, tuple[Part, dict[str, Any]]] = {
    "sphere": (
        Sphere(density=700.0, radius=0.1, centre=CENTRE),
        {"type": GEOM.mjGEOM_SPHERE, "size": [0.1, 0, 0], "density": 700, "pos": CENTRE},
    ),
    "box": (
        Box(mass=1.3, size=(0.2, 0.1, 0.06), centre=CENTRE, attitude=TURNED),
        {
            "type": GEOM.mjGEOM_BOX,
            "size": [0.1, 0.05, 0.03],
            "mass": 1.3,
            "pos": CENTRE,
            "quat": TURNED,
        },
    ),
    "cylinder": (
        Cylinder(density=2700.0, radius=0.04, length=0.12, centre=CENTRE, axis=AXIS),
        {
            "type": GEOM.mjGEOM_CYLINDER,
            "size": [0.04, 0.06, 0],
            "density": 2700,
            "pos": CENTRE,
            "quat": LAID,
        },
    ),
    "rod": (
        Rod(mass=0.2, begin=(0.0, 0.0, 0.0), end=(0.1, -0.2, 0.2), radius=0.01),
        {
            "type": GEOM.mjGEOM_CYLINDER,
            "size": [0.01, 0.15, 0],
            "mass": 0.2,
            "pos": (0.05, -0.1, 0.1),
            "quat": LAID,
        },
    ),
}


@pytest.mark.parametrize("name", SAME)
def test_parts_are_mujocos_bodies_of_that_shape(name: str) -> None:
    """Mass, centre and tensor, by another program's formulas. Measured 2e-16, rounding."""
    part, geom = SAME[name]
    ours, theirs = solid_of(part), compiled(geom)
    assert ours.mass == pytest.approx(theirs.mass, rel=1e-15)
    np.testing.assert_allclose(ours.centre, theirs.centre, atol=1e-16)
    scale = float(np.abs(theirs.inertia).max())
    assert np.abs(ours.inertia - theirs.inertia).max() < 2e-15 * scale


def without(outer: Part, inner: Part) -> Solid:
    """What is left of a body with another cut out of its middle."""
    a, b = solid_of(outer), solid_of(inner)
    return Solid(a.mass - b.mass, a.centre, a.inertia - b.inertia)


HOLLOW: dict[str, tuple[Part, Solid]] = {
    "hollow sphere": (
        Sphere(density=900.0, radius=0.2, thickness=0.03),
        without(Sphere(density=900.0, radius=0.2), Sphere(density=900.0, radius=0.17)),
    ),
    "tube": (
        Cylinder(density=900.0, radius=0.2, inner_radius=0.15, length=0.3, axis=AXIS),
        without(
            Cylinder(density=900.0, radius=0.2, length=0.3, axis=AXIS),
            Cylinder(density=900.0, radius=0.15, length=0.3, axis=AXIS),
        ),
    ),
    "disc with a hole": (
        Disc(mass=0.7, radius=0.2, inner_radius=0.15),
        solid_of(Cylinder(mass=0.7, radius=0.2, inner_radius=0.15, length=1e-9)),
    ),
    "ring": (
        Ring(mass=0.7, radius=0.2),
        solid_of(Disc(mass=0.7, radius=0.2, inner_radius=0.2 * (1 - 1e-15))),
    ),
}


@pytest.mark.parametrize("name", HOLLOW)
def test_hollow_parts_are_whole_ones_less_what_is_cut_out(name: str) -> None:
    """Or tubes without a length. Measured 2e-15: what a difference leaves of rounding."""
    part, expected = HOLLOW[name]
    solid = solid_of(part)
    assert solid.mass == pytest.approx(expected.mass, rel=2e-14)
    scale = float(np.abs(expected.inertia).max())
    assert np.abs(solid.inertia - expected.inertia).max() < 2e-14 * scale


def test_parts_make_one_body() -> None:
    """Two points on a rod: the reduced mass times the distance squared, across it."""
    points = [Point(mass=1.0, centre=(0.0, 0.0, 0.3)), Point(mass=2.0, centre=(0.0, 0.0, 0.0))]
    body = composed(solid_of(point) for point in points)
    assert body.mass == 3.0
    np.testing.assert_allclose(body.centre, [0.0, 0.0, 0.1], atol=1e-17)
    np.testing.assert_allclose(body.inertia, np.diag([0.06, 0.06, 0.0]), atol=1e-17)


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


REFUSED: dict[str, tuple[Part, str]] = {
    "both": (
        Sphere(mass=1.0, density=1.0, radius=1.0),
        "a sphere takes a mass or a density, not both",
    ),
    "neither": (Sphere(radius=1.0), r"a sphere needs a mass \[kg\] or a density \[kg/m³\]"),
    "no density": (Sphere(density=-1.0, radius=1.0), "a sphere's density must be positive"),
    "flat": (
        Box(mass=1.0, size=(1.0, 0.0, 1.0)),
        "a box's size must be positive and finite, not 0",
    ),
    "too thick": (
        Sphere(mass=1.0, radius=0.1, thickness=0.2),
        "thickness must be positive and at most its radius 0.1, not 0.2 m",
    ),
    "a wide hole": (
        Disc(mass=1.0, radius=0.1, inner_radius=0.1),
        "a disc's inner_radius must be at least 0 and less than its radius 0.1, not 0.1 m",
    ),
    "no rod": (
        Rod(mass=1.0, begin=(0.0, 0.0, 1.0), end=(0.0, 0.0, 1.0)),
        r"a rod must have a length and a direction, unlike \[0.0, 0.0, 0.0\]",
    ),
    "no axis": (
        Ring(mass=1.0, radius=0.1, axis=(0.0, 0.0, 0.0)),
        "a ring's axis must have a length and a direction",
    ),
    "no attitude": (
        Box(mass=1.0, size=(1.0, 1.0, 1.0), attitude=(2.0, 0.0, 0.0, 0.0)),
        r"attitude is not of unit length: \|attitude\| = 2",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_parts_that_cannot_be_are_refused(name: str) -> None:
    """One line each, with the value."""
    part, words = REFUSED[name]
    with pytest.raises(rb.InputError, match=words):
        solid_of(part)
