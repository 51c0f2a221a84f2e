"""The shapes of a ball are complete, inside its shell, and do not intersect."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.film.looks import BOB, HOOP, INSIDE, RIM, colours, looks_of
from robotball.robot import PARTS, Ball, Pendulum
from robotball.rotations import Array, rotation_matrix

BALL = rb.load_scene("three_rotors").ball
X, Y, _ = np.eye(3)


def with_pendulums(*hung: tuple[float, Array, Array]) -> Ball:
    """The ball with pendulums, each by its length, axis and pivot."""
    pendulums = (
        Pendulum(0.1, 1e-4 * np.eye(3), pivot - [0.0, 0.0, length], axis, pivot)
        for length, axis, pivot in hung
    )
    return replace(BALL, pendulums=tuple(pendulums))


def test_each_part_opens_alone() -> None:
    """The hand-written parts are MJCF of their own."""
    for name in ("floor", "shell", "frame", "rotor"):
        part = mujoco.MjModel.from_xml_path(str(PARTS / f"{name}.xml"))
        assert min(part.ngeom, part.nmat) > 0


def test_every_body_has_its_look_and_every_look_its_colour() -> None:
    """Three rotors and two pendulums."""
    ball = with_pendulums((0.4, X, 0 * X), (0.2, Y, 0.1 * Y))
    looks = looks_of(ball)
    assert list(looks) == [name for name, _ in ball.named_bodies]
    assert all(looks.values())
    assert {shape.material for shapes in looks.values() for shape in shapes} <= set(colours())


def test_rotors_with_one_centre_are_rings_within_rings() -> None:
    """Whatever they turn by: each is between two spheres, and the next inside the inner one."""
    reaches = []
    for name, _ in BALL.named_rotors:
        corners = np.concatenate([shape.triangles for shape in looks_of(BALL)[name]])
        distances = np.linalg.norm(corners, axis=2)
        reaches.append((distances.min(), distances.max()))
    (first, outer), (second, middle), (_, inner) = reaches
    # Measured 0.61 > 0.43 of the part, then 0.7 of it, and 0.7 of that.
    assert INSIDE > outer > first > middle > second > inner


@pytest.mark.parametrize("length", [0.0, 0.1, 0.5, 0.9])
def test_a_pendulum_stays_inside_the_hoop(length: float) -> None:
    """At any angle of its hinge, also one whose centre of mass is near the shell."""
    ball = with_pendulums((length * BALL.radius, X, 0 * X))
    for shape in looks_of(ball)["pendulum1"]:
        assert np.linalg.norm(shape.pos) + shape.size[0] <= INSIDE + 1e-12


def off_balance(centre: list[float], axis: list[float]) -> Ball:
    frame = replace(BALL.frame, centre=BALL.radius * np.array(centre))
    return replace(BALL, frame=frame, shell=replace(BALL.shell, axis=np.array(axis)))


SIDES = [[0.0, 0.0, -0.4], [0.1, -0.2, 0.05], [0.0, 0.9, 0.0]]
AXES = [[0.0, 0.0, 1.0], [0.6, 0.0, -0.8]]


@pytest.mark.parametrize("centre", SIDES)
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("inside", ["rotors", "a pendulum"])
def test_a_frame_off_balance_has_a_weight_on_its_hoop(
    centre: list[float], axis: list[float], inside: str
) -> None:
    """Towards its centre of mass, in the hoop's plane, outside of what turns, inside the shell."""
    swinging = with_pendulums((0.5, X, 0 * X)).pendulums if inside == "a pendulum" else ()
    ball = replace(off_balance(centre, axis), pendulums=swinging)
    *hoop, weight = looks_of(ball)["frame"]
    assert len(hoop) == len(looks_of(BALL)["frame"])
    assert weight.kind == "sphere"
    out = float(np.linalg.norm(weight.pos))
    assert weight.pos == pytest.approx(out * np.array(centre) / np.linalg.norm(centre))
    assert out - weight.size[0] >= (INSIDE if swinging else RIM) - 1e-12
    assert out + weight.size[0] < 0.97
    (ring,) = (shape for shape in hoop if shape.kind == "torus")
    normal = rotation_matrix(ring.turn)[:, 2]
    assert [normal @ weight.pos, normal @ axis] == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("centre", SIDES)
def test_where_nothing_turns_inside_the_weight_is_at_the_frames_centre_of_mass(
    centre: list[float],
) -> None:
    """On an arm from the hoop; one far out is drawn inside the hoop, and a balanced one nowhere."""
    ball = replace(off_balance(centre, AXES[0]), rotors=())
    *_, weight, arm = looks_of(ball)["frame"]
    far = float(np.linalg.norm(centre))
    assert weight.pos == pytest.approx(min(1.0, (INSIDE - BOB) / far) * np.array(centre))
    inner, outer = (np.linalg.norm(arm.pos) + sign * arm.size[1] for sign in (-1, 1))
    assert [inner, outer] == pytest.approx([np.linalg.norm(weight.pos), HOOP])
    # Less than can be seen.
    balanced = looks_of(off_balance([1e-3, 0.0, 0.0], AXES[0]))["frame"]
    assert all(shape.kind != "sphere" for shape in balanced)
