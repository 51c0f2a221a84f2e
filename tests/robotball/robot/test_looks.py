"""The shapes of a ball are complete, inside its shell, and do not intersect."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.robot.ball import PARTS, Ball, Hinge, Pendulum
from robotball.robot.looks import _INSIDE, _RIM, colours, looks_of
from robotball.rotations import Array, rotation_matrix

BALL = rb.load_scene("three_rotors").ball
X, Y, _ = np.eye(3)


def with_pendulums(*hung: tuple[float, Array, Array]) -> Ball:
    """The ball with pendulums, each by its length, axis and pivot."""
    pendulums = (
        Pendulum(0.1, 1e-4 * np.eye(3), pivot - [0.0, 0.0, length], axis, pivot)
        for length, axis, pivot in hung
    )
    return replace(BALL, hinges=(*BALL.hinges, *map(Hinge, pendulums)))


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
    used = {shape.material for shapes in looks.values() for shape in shapes}
    assert {name for name in used if name[0] != "#"} == set(colours())


def test_rotors_with_one_centre_are_rings_within_rings() -> None:
    """Whatever they turn by: each is between two spheres, and the next inside the inner one."""
    reaches = []
    for name in ("rotor1", "rotor2", "rotor3"):
        corners = np.concatenate([shape.triangles for shape in looks_of(BALL)[name]])
        distances = np.linalg.norm(corners, axis=2)
        reaches.append((distances.min(), distances.max()))
    (first, outer), (second, middle), (_, inner) = reaches
    # Measured 0.61 > 0.43 of the part, then 0.7 of it, and 0.7 of that.
    assert _INSIDE > outer > first > middle > second > inner


def test_a_pendulum_given_by_numbers_is_the_box_of_its_inertia() -> None:
    """A homogeneous box of that mass has the body's centre and moments, turned as they are."""
    turn = rotation_matrix(np.array([0.8, 0.0, 0.6, 0.0]))
    inertia = turn @ np.diag([4e-4, 5e-4, 6e-4]) @ turn.T
    ball = with_pendulums((0.4, X, 0.1 * Y))
    (pendulum,) = ball.pendulums
    ball = ball.with_hinges(body={"pendulum1": replace(pendulum, inertia=inertia)})
    box = looks_of(ball)["pendulum1"][0]
    edges, axes = (2 * BALL.radius * box.size) ** 2, rotation_matrix(box.turn)
    moments = 0.1 / 12 * (edges.sum() - edges)
    assert axes @ np.diag(moments) @ axes.T == pytest.approx(inertia, rel=1e-12, abs=1e-18)
    assert box.pos * BALL.radius == pytest.approx(pendulum.centre)


def test_a_body_of_parts_is_drawn_by_them_at_their_sizes() -> None:
    """The plate of a robot is 120 mm by 220 mm; the hoop, a symbol, is not there."""
    ball = rb.load_scene("pendulum_robot").ball
    plate, motor, battery, axle = looks_of(ball)["frame"]
    assert plate.size * 2 * ball.radius == pytest.approx([0.12, 0.22, 0.005])
    assert motor.size[:2] * ball.radius == pytest.approx([0.018, 0.035])
    assert motor.pos * ball.radius == pytest.approx([0.0, 0.06, -0.025])
    assert (battery.kind, axle.kind) == ("box", "capsule")


def off_balance(centre: list[float], axis: list[float], of: Ball = BALL) -> Ball:
    frame = replace(BALL.frame, centre=BALL.radius * np.array(centre))
    return replace(
        of.with_hinges(body={"frame": frame}), shell=replace(BALL.shell, axis=np.array(axis))
    )


SIDES = [[0.0, 0.0, -0.4], [0.1, -0.2, 0.05], [0.0, 0.9, 0.0]]
AXES = [[0.0, 0.0, 1.0], [0.6, 0.0, -0.8]]


@pytest.mark.parametrize("centre", SIDES)
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("swings", [False, True])
def test_a_frame_off_balance_has_a_weight_on_its_hoop(
    centre: list[float], axis: list[float], swings: bool
) -> None:
    """Towards its centre of mass, in the hoop's plane, outside of what turns, inside the shell."""
    ball = with_pendulums((0.5, X, 0 * X)) if swings else BALL
    *hoop, weight = looks_of(off_balance(centre, axis, ball))["frame"]
    assert len(hoop) == len(looks_of(BALL)["frame"])
    assert weight.kind == "sphere"
    out = float(np.linalg.norm(weight.pos))
    assert weight.pos == pytest.approx(out * np.array(centre) / np.linalg.norm(centre))
    assert out - weight.size[0] >= (_INSIDE if swings else _RIM) - 1e-12
    assert out + weight.size[0] < 0.97
    (ring,) = (shape for shape in hoop if shape.kind == "torus")
    normal = rotation_matrix(ring.turn)[:, 2]
    assert [normal @ weight.pos, normal @ axis] == pytest.approx([0.0, 0.0], abs=1e-12)
    # Less than can be seen.
    balanced = looks_of(off_balance([1e-3, 0.0, 0.0], AXES[0]))["frame"]
    assert all(shape.kind != "sphere" for shape in balanced)
