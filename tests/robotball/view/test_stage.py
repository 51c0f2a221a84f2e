"""The stage shows bodies, shadows and paths at the motion's positions."""

import mujoco
import numpy as np
import pytest

import robotball as rb
from robotball.robot.looks import looks_of
from robotball.robot.shapes import Shape
from robotball.rotations import Array, rotation_matrix
from robotball.view import gl, stage
from robotball.view.stage import LENS, SUN, Camera, Stage, build_stage, pose
from robotball.view.tracks import track_of
from tests.poses import poses
from tests.random_robots import random_tree
from tests.robots import worked

TIMES = np.linspace(0.0, 0.3, 16)  # s
SIDE = 200  # pixels
HIGH = 9.0  # radii
FIG12 = rb.load_scene("fig12")


@pytest.mark.parametrize(
    "scene",
    [
        rb.load_scene("three_rotors"),
        worked("W4"),
        *(random_tree(np.random.default_rng(3), framed) for framed in (False, True)),
    ],
    ids=["rotors", "W4", "tree", "framed tree"],
)
def test_bodies_on_the_stage_have_the_poses_of_the_motion(scene: rb.Scene) -> None:
    """Including rotors and pendulums, compared with `poses`; measured 7e-16 rad, 5e-16 radii."""
    motion = rb.integrate(scene, TIMES)
    track, looks, expected = track_of(motion), looks_of(scene.ball), poses(motion)
    stands = track.stands(track.at(TIMES[-1:]))
    model = build_stage(looks, ["#0072B2", "#D55E00"], [1.0, 0.35]).compile()
    data = mujoco.MjData(model)
    pose(model, data, looks, [stands] * 2)
    for name, body in scene.ball.named_bodies:
        for ball in ("ball0_", "ball1_"):
            stood = data.body(ball + name)
            turn = stood.xmat.reshape(3, 3)
            assert np.abs(turn - rotation_matrix(expected[name].attitude[-1])).max() < 1e-14
            centre = turn @ body.centre + stood.xpos * scene.ball.radius
            assert np.abs(centre - expected[name].position[-1]).max() < 1e-14


def test_bodies_between_samples_follow_the_motion() -> None:
    """Halfway between samples 20 ms apart, and with only two samples.

    Measured 6e-4 with even rotation between samples, and 2e-6 radii with cubics of four samples.
    """
    times = np.linspace(0.0, 1.0, 51)
    between = (times[:-1] + times[1:]) / 2
    exact = track_of(rb.integrate(FIG12, np.concatenate([[0.0], between])))
    track = track_of(rb.integrate(FIG12, times))
    expected, seen = (track_.stands(track_.at(between)) for track_ in (exact, track))
    for name, (turn, shift) in seen.items():
        assert np.abs(turn - expected[name][0]).max() < 2e-3
        assert np.abs(shift - expected[name][1]).max() < 1e-5
    short = track_of(rb.integrate(FIG12, times[:2]))
    middle = short.at(between[:1]).contact_point
    assert np.abs(middle - short.sampled.contact_point.mean(axis=0)).max() < 1e-15


TRACK = track_of(rb.integrate(FIG12, TIMES))
STANDS = TRACK.stands(TRACK.at(TIMES[:1]))
CENTRE = STANDS["shell"][1][0]


def drawn(points: Array, opacity: float, trail: float) -> Array:
    """Return a picture of fig12's ball from above with a path."""
    looks = looks_of(FIG12.ball)
    shown = Stage((SIDE, SIDE), looks, ["#0072B2"], [points], 7.2, str(gl.find_backend()))
    shown.place([STANDS], [{}])
    camera = Camera(np.array([*CENTRE[:2], 0.0]), HIGH, 0.0, np.pi / 2 - 1e-4)
    picture = shown.draw(camera, [opacity], [trail], len(points) - 1)
    shown.close()
    return picture.astype(float)


def at(picture: Array, point: Array) -> Array:
    """Return the pixels (9, 3) around a point (2,) on the floor, from the picture's centre."""
    x, y = SIDE / 2 * (1 + LENS / HIGH * np.array([point[1], point[0]]))
    return picture[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2].reshape(9, 3)


@pytest.mark.usefixtures("screen")
@pytest.mark.parametrize("size", [(120, 240), (240, 120)])
def test_a_point_is_projected_to_where_the_renderer_draws_it(size: tuple[int, int]) -> None:
    """A small sphere, from the side, in a wide and a tall picture; measured 0.07 pixels off."""
    point, camera = np.array([0.7, -0.5, 1.2]), Camera(np.array([0.0, 0.0, 0.8]), 7.0, 0.6, 0.4)
    dot = Shape("sphere", np.array([0.1, 0.0, 0.0]), point, material="#ff0000ff")
    backend = str(gl.find_backend())
    shown = Stage(size, {"shell": [dot]}, ["#ff0000"], [np.zeros((2, 2))], 7.0, backend)
    shown.place([{"shell": (np.eye(3)[None], np.zeros((1, 3)))}], [{}])
    red = shown.draw(camera, [1.0], [0.0], 1).astype(int)
    shown.close()
    rows, columns = np.nonzero(red[..., 0] - red[..., 1] > 60)
    x, y, radius = camera.project(point, size)
    assert np.hypot(columns.mean() + 0.5 - x, rows.mean() + 0.5 - y) < 0.3
    # Pixels on its edge are partly red: measured 2.9 for 2.8.
    assert np.sqrt(len(rows) / np.pi) == pytest.approx(0.1 * radius, abs=0.4)


def test_the_sun_of_the_shadows_is_the_floors_light() -> None:
    """Its direction is read from mjcf/floor.xml."""
    model = build_stage({}, [], []).compile()
    assert model.light("sun").dir == pytest.approx(SUN / np.linalg.norm(SUN))


@pytest.mark.usefixtures("screen")
def test_a_shadow_lies_opposite_to_the_sun() -> None:
    """One radius beyond the ball's outline it is 42 levels of 255 darker; on the sun's side 0."""
    path = np.array([[0.0, 3.0], [1.0, 3.0]])
    bare, shaded = (drawn(path, opacity, 0.0) for opacity in (0.0, 1.0))
    away = 1.25 * SUN[:2] / np.linalg.norm(SUN[:2])
    assert (at(bare, away) - at(shaded, away)).mean() > 15
    assert np.abs(at(bare, -away) - at(shaded, -away)).max() < 2


@pytest.mark.usefixtures("screen")
@pytest.mark.parametrize("points", [stage.POINTS, 10])
def test_a_path_is_drawn_to_its_end(points: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Complete and thinned: blue on the path, and only there."""
    monkeypatch.setattr(stage, "POINTS", points)
    line = np.column_stack([np.linspace(-1.0, 1.0, 101), np.full(101, 1.8)]) + CENTRE[:2]
    picture = drawn(line, 0.0, 1.0)
    for x, blue in ((-0.8, True), (0.0, True), (0.9, True), (1.5, False)):
        red, _, strong = at(picture, np.array([x, 1.8])).mean(axis=0)
        assert (strong - red > 50) == blue


@pytest.mark.usefixtures("screen")
def test_the_floor_of_a_turntable_turns_about_the_origin() -> None:
    """A camera that turns with the floor sees the same picture of it; one at rest does not."""
    looks, backend = looks_of(FIG12.ball), str(gl.find_backend())
    shown = Stage((SIDE, SIDE), looks, ["#0072B2"], [np.zeros((2, 2))], 7.2, backend)

    def floor(turn: float, camera_turn: float) -> Array:
        c, s = np.cos(camera_turn), np.sin(camera_turn)
        look = np.array([3 * c, 3 * s, 0.0])
        shown.place([STANDS], [{}], turn)
        camera = Camera(look, 6.0, camera_turn, 1.2)
        return np.asarray(shown.draw(camera, [0.0], [0.0], 0), dtype=float)

    still, carried, left = floor(0.0, 0.0), floor(0.6, 0.6), floor(0.6, 0.0)
    shown.close()
    assert np.abs(carried - still).mean() < 0.5  # of 255; measured 0
    assert np.abs(left - still).mean() > 3.0  # measured 9.9
