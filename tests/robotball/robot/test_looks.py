"""The drawn shapes of a ball are complete, inside its shell, and do not intersect."""

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
    """Return the ball with pendulums of these lengths, axes and pivots."""
    pendulums = (
        Pendulum(0.1, 1e-4 * np.eye(3), pivot - [0.0, 0.0, length], axis, pivot)
        for length, axis, pivot in hung
    )
    return replace(BALL, hinges=(*BALL.hinges, *map(Hinge, pendulums)))


def test_each_part_is_a_complete_mjcf_file() -> None:
    """It can be compiled without the other parts."""
    for name in ("floor", "shell", "frame", "rotor"):
        part = mujoco.MjModel.from_xml_path(str(PARTS / f"{name}.xml"))
        assert min(part.ngeom, part.nmat) > 0


def test_every_body_has_shapes_and_every_shape_has_a_colour() -> None:
    """For three rotors and two pendulums."""
    ball = with_pendulums((0.4, X, 0 * X), (0.2, Y, 0.1 * Y))
    looks = looks_of(ball)
    assert list(looks) == [name for name, _ in ball.named_bodies]
    assert all(looks.values())
    used = {shape.material for shapes in looks.values() for shape in shapes}
    assert {name for name in used if name[0] != "#"} == set(colours())


def test_concentric_rotors_are_nested_rings() -> None:
    """At any angle: each ring lies between two spheres, with the next ring inside the inner one."""
    reaches = []
    for name in ("rotor1", "rotor2", "rotor3"):
        corners = np.concatenate([shape.triangles for shape in looks_of(BALL)[name]])
        distances = np.linalg.norm(corners, axis=2)
        reaches.append((distances.min(), distances.max()))
    (first, outer), (second, middle), (_, inner) = reaches
    # Measured 0.61 > 0.43 of the part, then 0.7 and 0.7² times as much.
    assert _INSIDE > outer > first > middle > second > inner


def test_a_pendulum_without_parts_is_drawn_as_its_inertia_box() -> None:
    """The homogeneous box with the mass, centre and moments of the body."""
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


def test_a_body_of_parts_is_drawn_with_their_sizes() -> None:
    """A plate of 120 mm by 220 mm; the symbolic hoop is not drawn."""
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
def test_an_unbalanced_frame_has_a_weight_on_its_hoop(
    centre: list[float], axis: list[float], swings: bool
) -> None:
    """In the direction of its centre of mass, between the rotating bodies and the shell."""
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
    # An invisible imbalance.
    balanced = looks_of(off_balance([1e-3, 0.0, 0.0], AXES[0]))["frame"]
    assert all(shape.kind != "sphere" for shape in balanced)
