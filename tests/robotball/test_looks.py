"""The shapes of a ball are complete, inside its shell, and do not intersect."""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.film.looks import BOB, HOOP, INSIDE, RIM, Shape, colours, looks_of
from robotball.robot import Ball, Pendulum
from robotball.rotations import Array, rotation_matrix

BALL = rb.load_scene("three_rotors").ball
EDGE = np.linspace(0.0, 2 * np.pi, 60, endpoint=False)


def pendulum(length: float, axis: Array, pivot: Array) -> Pendulum:
    return Pendulum(0.1, 1e-4 * np.eye(3), pivot - length * np.eye(3)[2], axis, pivot)


def with_pendulums(*pendulums: Pendulum) -> Ball:
    return replace(BALL, pendulums=pendulums)


def points_of(shape: Shape) -> Array:
    """Points (n, 3) on a shape of a rotor, from the sphere's centre."""
    circle = np.stack([np.cos(EDGE), np.sin(EDGE), 0 * EDGE], axis=1)
    radius, other, _ = shape.size
    if shape.kind == "torus":
        rings = [circle * (radius + other * c) + [0, 0, other * s] for c, s in circle[:, :2]]
        own = np.concatenate(rings)
    elif shape.kind == "sphere":
        own = np.concatenate(
            [
                radius * np.stack([circle[:, 0] * s, circle[:, 1] * s, np.full(60, c)], axis=1)
                for c, s in circle[:, :2]
            ]
        )
    else:
        end = other + (radius if shape.kind == "capsule" else 0.0)
        own = np.concatenate([circle * radius + [0, 0, z] for z in np.linspace(-end, end, 21)])
    return shape.pos + own @ rotation_matrix(shape.turn).T


def test_every_body_has_its_look_and_every_look_its_colour() -> None:
    """Three rotors and two pendulums."""
    x, y, _ = np.eye(3)
    ball = with_pendulums(pendulum(0.4, x, 0 * x), pendulum(0.2, y, 0.1 * y))
    looks = looks_of(ball)
    assert list(looks) == [name for name, _ in ball.named_bodies]
    assert all(looks.values())
    assert {shape.material for shapes in looks.values() for shape in shapes} <= set(colours())


def test_rotors_with_one_centre_are_rings_within_rings() -> None:
    """Whatever they turn by: each is between two spheres, and the next inside the inner one."""
    reaches = []
    for name, _ in BALL.named_rotors:
        distances = [np.linalg.norm(points_of(shape), axis=1) for shape in looks_of(BALL)[name]]
        reaches.append(
            (min(each.min() for each in distances), max(each.max() for each in distances))
        )
    (first, outer), (second, middle), (_, inner) = reaches
    # Measured 0.603 > 0.427 of the part, then 0.7 of it, and 0.7 of that.
    assert INSIDE > outer > first > middle > second > inner


@pytest.mark.parametrize("length", [0.0, 0.1, 0.5, 0.9])
def test_a_pendulum_stays_inside_the_hoop(length: float) -> None:
    """At any angle of its hinge, also one whose centre of mass is near the shell."""
    axis = np.array([1.0, 0.0, 0.0])
    ball = with_pendulums(pendulum(length * BALL.radius, axis, np.zeros(3)))
    for shape in looks_of(ball)["pendulum1"]:
        assert np.linalg.norm(shape.pos) + shape.size[0] <= INSIDE + 1e-12


SIDES = [[0.0, 0.0, -0.4], [0.3, 0.0, 0.0], [0.1, -0.2, 0.05], [0.0, 0.9, 0.0]]
AXES = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.6, 0.0, -0.8]]
X = np.eye(3)[0]


@pytest.mark.parametrize("centre", SIDES)
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("inside", ["rotors", "a pendulum"])
def test_a_frame_off_balance_has_a_weight_on_its_hoop(
    centre: list[float], axis: list[float], inside: str
) -> None:
    """Towards its centre of mass, in the hoop's plane, outside of what turns, inside the shell."""
    swinging = (pendulum(0.5, X, 0 * X),) if inside == "a pendulum" else ()
    ball = replace(off_balance(centre, axis), pendulums=swinging)
    *hoop, weight = looks_of(ball)["frame"]
    assert len(hoop) == len(looks_of(BALL)["frame"])
    assert weight.kind == "sphere"
    out = float(np.linalg.norm(weight.pos))
    assert weight.pos == pytest.approx(out * np.array(centre) / np.linalg.norm(centre))
    reach = INSIDE if swinging else RIM
    assert out - weight.size[0] >= reach - 1e-12
    assert out + weight.size[0] < 0.97
    (ring,) = (shape for shape in hoop if shape.kind == "torus")
    normal = rotation_matrix(ring.turn)[:, 2]
    assert [normal @ weight.pos, normal @ axis] == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("centre", SIDES)
def test_where_nothing_turns_inside_the_weight_is_at_the_frames_centre_of_mass(
    centre: list[float],
) -> None:
    """On an arm from the hoop; one far out is drawn inside the hoop."""
    ball = replace(off_balance(centre, AXES[0]), rotors=())
    *_, weight, arm = looks_of(ball)["frame"]
    far = float(np.linalg.norm(centre))
    assert weight.pos == pytest.approx(min(1.0, (INSIDE - BOB) / far) * np.array(centre))
    inner, outer = (np.linalg.norm(arm.pos) + sign * arm.size[1] for sign in (-1, 1))
    assert [inner, outer] == pytest.approx([np.linalg.norm(weight.pos), HOOP])


def off_balance(centre: list[float], axis: list[float]) -> Ball:
    frame = replace(BALL.frame, centre=BALL.radius * np.array(centre))
    return replace(BALL, frame=frame, shell=replace(BALL.shell, axis=np.array(axis)))


def test_a_balanced_frame_has_no_weight() -> None:
    """Nor one that is off by less than can be seen."""
    for off in (0.0, 1e-3):
        looks = looks_of(off_balance([off, 0.0, 0.0], AXES[0]))
        assert all(shape.kind != "sphere" for shape in looks["frame"])
