"""Shapes as triangles: corners (n, 6), three a triangle, each a place and its normal."""

from collections.abc import Sequence

import numpy as np

from robotball.looks import Shape
from robotball.rotations import Array, rotation_matrix, z_along

AROUND = 48  # steps of a shape about its axis
SECTION = 8  # of a torus's tube, and of a round end
SMALL = 12  # steps about the axis of what is thin


def triangles_of(shape: Shape) -> Array:
    """The shape where it stands; lengths in radii of the ball."""
    own = _box(shape.size) if shape.kind == "box" else _turned(*_profile(shape))
    return moved(own, rotation_matrix(shape.turn), shape.pos)


def moved(corners: Array, turn: Array, pos: Array) -> Array:
    """Corners (n, 6) turned by a matrix (3, 3) and then shifted by (3,)."""
    return np.concatenate([corners[:, :3] @ turn.T + pos, corners[:, 3:] @ turn.T], axis=1)


def arrow(vector: Array, thickness: float) -> Array:
    """An arrow (n, 6) from the origin along `vector` (3,), its head included."""
    length = float(np.linalg.norm(vector))
    head = min(4 * thickness, length / 2)
    neck, slope = length - head, np.array([head, 2 * thickness]) / np.hypot(head, 2 * thickness)
    profile = [
        (0.0, 0.0, 0.0, -1.0), (thickness, 0.0, 0.0, -1.0), (thickness, 0.0, 1.0, 0.0),
        (thickness, neck, 1.0, 0.0), (thickness, neck, 0.0, -1.0), (2 * thickness, neck, 0.0, -1.0),
        (2 * thickness, neck, *slope), (0.0, length, *slope),
    ]  # fmt: skip
    return moved(
        _turned(np.array(profile), SMALL), rotation_matrix(z_along(vector / length)), np.zeros(3)
    )


def _profile(shape: Shape) -> tuple[Array, int]:
    """The section (m, 4) of a shape turned about z, as r, z and their normal; and the steps."""
    a, b, _ = shape.size
    if shape.kind == "torus":
        c, s = _circle(0.0, 2 * np.pi, SECTION)
        return np.stack([a + b * c, b * s, c, s], axis=1), AROUND
    if shape.kind == "sphere":
        c, s = _circle(-np.pi / 2, np.pi / 2, 2 * SECTION if a > 0.5 else SECTION)
        return np.stack([a * c, a * s, c, s], axis=1), AROUND if a > 0.5 else SMALL
    if shape.kind == "capsule":
        c, s = _circle(-np.pi / 2, np.pi / 2, SECTION)
        return np.stack([a * c, a * s + b * np.where(s > 0, 1, -1), c, s], axis=1), SMALL
    flat, side = (0.0, 1.0), (1.0, 0.0)
    edges = [(0, -b, 0, -1), (a, -b, 0, -1), (a, -b, *side), (a, b, *side), (a, b, *flat),
             (0, b, *flat)]  # fmt: skip
    return np.array(edges, dtype=float), AROUND


def _circle(begin: float, end: float, steps: int) -> tuple[Array, Array]:
    angle = np.linspace(begin, end, steps + 1)
    return np.cos(angle), np.sin(angle)


def _turned(profile: Array, steps: int) -> Array:
    """The surface of a profile (m, 4) turned about z."""
    c, s = _circle(0.0, 2 * np.pi, steps)
    r, z, nr, nz = profile.T
    grid = np.stack(
        [
            np.outer(c, r), np.outer(s, r), np.outer(np.ones_like(c), z),
            np.outer(c, nr), np.outer(s, nr), np.outer(np.ones_like(c), nz),
        ],
        axis=2,
    )  # fmt: skip
    return _faces(grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])


def _faces(a: Array, b: Array, c: Array, d: Array) -> Array:
    return np.stack([a, b, c, a, c, d], axis=-2).reshape(-1, 6)


def _box(size: Array) -> Array:
    corners = []
    square: Sequence[tuple[int, int]] = ((-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1))
    for axis in range(3):
        for side in (-1, 1):
            for a, b in square[::side]:  # seen from outside, anticlockwise
                place, normal = np.zeros(3), np.zeros(3)
                place[axis] = normal[axis] = side
                place[(axis + 1) % 3], place[(axis + 2) % 3] = a, b
                corners.append(np.concatenate([place * size, normal]))
    return np.array(corners)
